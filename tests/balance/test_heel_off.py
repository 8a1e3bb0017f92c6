"""A hind foot whose leg would not reach pitches about its toes."""

import math
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from leg_makes import MAKES, make_legs

from gaitchain.balance.heel_off import heel_lift, pitched
from gaitchain.balance.leg_ik import leg_joints
from gaitchain.balance.leg_kinematics import com_from_pelvis, legs_of, posture
from gaitchain.balance.rotations import rotation
from gaitchain.balance.state import DOUBLE, Attitude, Foot, GaitState, seen_from
from gaitchain.balance.support_foot import lowest_corner, measured_step, see_support
from gaitchain.balance.walk_controller import rehearse
from gaitchain.build.stride_feasibility import feasible_pairs
from gaitchain.build.stride_rollout import walk_strides
from gaitchain.discover.loaded_robot import load_robot
from gaitchain.gait.stride.shape import ARRIVAL, MODEL_SHAPE
from gaitchain.gait.stride.strides import StridePoses
from gaitchain.robot.box_robot import load_box_robot
from gaitchain.sim.world import World
from gaitchain.walker.stride_setup import make_walk

SHARED = Path(__file__).parents[3] / "shared" / "robots"
G1 = Path(os.environ.get("MENAGERIE_ROOT") or SHARED) / "unitree_g1" / "g1.xml"
RES = legs_of(load_box_robot("res"))
LEGS, SEEDS = st.sampled_from([0, 1]), st.integers(0, 2**32 - 1)
REACH = 0.985
"""Part of its reach at which a leg begins to lift its heel."""


def hip_to_ankle(legs, leg, own):
    """From the hip's to the ankle's joint, and the whole posture, pelvis frame."""
    joints = np.tile(own, 2)
    found = posture(legs, joints)
    return found.centres[leg, legs.knee + 1] - found.centres[leg, legs.knee - 1], found


def hind_foot(legs, leg, rng, far):
    """A foot behind the hip whose leg would be so long; joints of a moment ago."""
    count = legs.link_mass.shape[1]
    own = legs.start[leg * count : (leg + 1) * count]
    way, found = hip_to_ankle(legs, leg, own)
    back = rng.uniform(0.1, 0.5)
    aim = np.array([-math.sin(back), 0.0, -math.cos(back)]) * far * legs.reach
    ankle = found.ankles[leg] - way + aim
    near = ankle - 0.1 * aim
    return ankle, leg_joints(legs, leg, near, np.eye(3), own)


def toes(legs, ankle, foot):
    return ankle + foot @ [legs.sole_front, 0.0, -legs.ankle_height]


@settings(max_examples=60)
@given(st.sampled_from(MAKES), LEGS, SEEDS)
def test_a_hind_leg_is_as_long_as_allowed_and_its_toes_stay(make, leg, seed):
    rng = np.random.default_rng(seed)
    legs = make_legs(make, rng)
    ankle, own = hind_foot(legs, leg, rng, rng.uniform(0.99, 1.06))
    pitch = heel_lift(legs, leg, ankle, np.eye(3), own, REACH)
    at, foot = pitched(legs, ankle, np.eye(3), pitch)
    assert toes(legs, at, foot) == pytest.approx(toes(legs, ankle, np.eye(3)))
    assert foot @ [0.0, 1.0, 0.0] == pytest.approx([0.0, 1.0, 0.0])
    assume(0.0 < pitch < 0.7)
    _, found = hip_to_ankle(legs, leg, own)
    hip, end = found.centres[leg, legs.knee - 1], found.centres[leg, legs.knee + 1]
    arm = found.feet[leg].T @ (end - found.ankles[leg])

    def length(other):
        at, foot = pitched(legs, ankle, np.eye(3), other)
        return np.linalg.norm(at + foot @ arm - hip)

    shortest = min(length(other) for other in np.linspace(0.0, 0.7, 71))
    wanted = max(REACH * legs.reach, shortest)  # some ankle is all but over the toes
    assert length(pitch) == pytest.approx(wanted, abs=1e-4)


@settings(max_examples=40)
@given(LEGS, SEEDS)
def test_such_a_foot_is_met(leg, seed):
    rng = np.random.default_rng(seed)
    ankle, own = hind_foot(RES, leg, rng, rng.uniform(0.99, 1.06))
    pitch = heel_lift(RES, leg, ankle, np.eye(3), own, REACH)
    assume(pitch < 0.7)
    at, foot = pitched(RES, ankle, np.eye(3), pitch)
    own = leg_joints(RES, leg, at, foot, own)
    way, found = hip_to_ankle(RES, leg, own)
    assert np.linalg.norm(way) == pytest.approx(REACH * RES.reach, abs=1e-6)
    assert found.ankles[leg] == pytest.approx(at, abs=1e-6)
    assert found.feet[leg] == pytest.approx(foot, abs=1e-6)


@settings(max_examples=40)
@given(LEGS, SEEDS)
def test_a_leg_that_reaches_or_is_ahead_keeps_its_foot_level(leg, seed):
    rng = np.random.default_rng(seed)
    ankle, own = hind_foot(RES, leg, rng, rng.uniform(0.9, 0.984))
    assert heel_lift(RES, leg, ankle, np.eye(3), own, REACH) == 0.0
    ankle, own = hind_foot(RES, leg, rng, 1.05)
    mirrored = ankle * [-1.0, 1.0, 1.0]
    assert heel_lift(RES, leg, mirrored, np.eye(3), own, REACH) == 0.0


def test_the_heel_leaves_the_ground_without_a_jump():
    """As the hip moves on, the pitch grows from 0 and goes on smoothly."""
    rng = np.random.default_rng(0)
    ankle, own = hind_foot(RES, 0, rng, 0.98)
    pitches = []
    for moved in np.linspace(0.0, 0.12 * RES.leg, 400):
        target = ankle - [moved, 0.0, 0.0]
        pitch = heel_lift(RES, 0, target, np.eye(3), own, REACH)
        at, foot = pitched(RES, target, np.eye(3), pitch)
        own = leg_joints(RES, 0, at, foot, own)
        pitches.append(pitch)
    assert pitches[0] == 0.0
    assert pitches[-1] > 0.15
    assert np.all(np.diff(pitches) >= 0.0)
    assert np.diff(pitches).max() < 0.01


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("turn", [0.0, 0.3])
def test_a_robot_on_its_toes_is_where_its_level_foot_says(side, turn):
    """The step and the CoM count from the place of the level foot."""
    support, swing = (0, 1) if side > 0 else (1, 0)
    out = side * 0.5 * RES.hip_width
    hind = np.array([-0.2 * RES.leg, out, -0.86 * RES.leg])
    fore = np.array([0.15 * RES.leg, -out, -0.86 * RES.leg])
    landed = rotation(-side * turn, 0.0, 0.0)
    joints = RES.start.copy()
    joints[6 * swing : 6 * swing + 6] = leg_joints(
        RES, swing, fore, landed, RES.start[:6]
    )
    made, coms = [], []
    for pitch in (0.0, 0.35):
        at, foot = pitched(RES, hind, np.eye(3), pitch)
        joints[6 * support : 6 * support + 6] = leg_joints(
            RES, support, at, foot, RES.start[:6]
        )
        made.append(measured_step(RES, joints, side, pitch))
        view = see_support(RES, Attitude(), side, joints, np.zeros(12), pitch)
        com = com_from_pelvis(RES, posture(RES, joints)) - hind
        coms.append((view.com.x - com[0], side * view.com.y - com[1]))
    ahead, left, turned = fore[0] - hind[0], fore[1] - hind[1], -side * turn
    assert made[0] == pytest.approx((ahead, left, turned), abs=1e-6)
    assert made[1] == pytest.approx(made[0], abs=1e-6)
    assert np.array(coms) == pytest.approx(0.0, abs=1e-6)


def test_the_foot_that_landed_stands_level():
    """The pitch is that of the foot that leaves; the next support foot has none."""
    state = GaitState(phase=DOUBLE, landing=Foot(0.1, -0.1, 0.0), heel=0.3)
    assert seen_from(state.landing, state).heel == 0.0


@pytest.fixture(scope="module")
def long_strides():
    """Poses, times and gaits of G1 with strides of 0.63 legs."""
    if not G1.is_file():
        pytest.skip(f"no {G1}; set MENAGERIE_ROOT")
    robot = load_robot(G1)
    gains = {**MODEL_SHAPE.balance, "follow": 3.0}
    shape = replace(MODEL_SHAPE, step_s=0.44, hip_height=0.895, balance=gains)
    leg = robot.reduced.leg_length
    rows = np.array([(0.0, 0.0, 0.0), (0.31, 0.0, 0.0), (0.63, 0.0, 0.0)])
    rows[:, 0] *= leg
    layers = rows, np.array([shape.passing(leg)]), np.array([ARRIVAL]), rows
    poses = StridePoses(robot, shape.hip_height * leg, layers, shape.balance)
    lasts = [1, *[2] * 14, 1, 0]
    gaits = [(a, 0, 0, b) for a, b in zip([0, *lasts], lasts, strict=False)]
    return poses, shape.timing(robot), np.array(gaits)


def test_strides_are_planned_that_level_feet_cannot_make(long_strides):
    poses, timing, gaits = long_strides
    assert feasible_pairs(poses, timing, math.inf)[2, 2]
    walk, legs = make_walk(poses, timing, feedback=False), legs_of(poses.robot)
    walk.begin_shift(left_support=True)
    longest, heels, lowest = 0.0, [], 0.0
    for joints in rehearse(walk, poses.step_targets(gaits[:, 1:].tolist())):
        found = posture(legs, joints)
        way = found.centres[:, legs.knee + 1] - found.centres[:, legs.knee - 1]
        behind = way[:, 0] < 0.0
        longest = max(longest, *np.linalg.norm(way[behind], axis=1), 0.0)
        heels.extend(np.degrees(np.arcsin(-found.feet[:, 2, 0])))
        # With the feet on the ground none of them is below it.
        if walk.phase == DOUBLE:
            soles = [
                found.ankles[i, 2] + lowest_corner(legs, found.feet[i])
                for i in range(2)
            ]
            lowest = max(lowest, abs(soles[0] - soles[1]))
    assert longest < 0.99 * legs.reach
    assert 5.0 < max(heels) < 30.0
    assert min(heels) > -1e-3
    assert lowest < 0.003 * legs.leg


def test_such_a_walk_holds_in_physics(long_strides):
    poses, timing, gaits = long_strides
    found = walk_strides(poses, timing, gaits, World())
    assert found.fell_in is None
    planned = poses.strides[gaits[2:-2, 3], 0]
    assert found.advance[2:-2].mean() == pytest.approx(planned.mean(), rel=0.12)
