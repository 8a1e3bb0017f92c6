"""A walk ready to stand: the pelvis frame's origin is over the robot's CoM."""

import math
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from other_robots import with_legs

from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.balance.gains import derive_gains, open_loop
from gaitchain.balance.leg_ik import leg_joints
from gaitchain.balance.leg_kinematics import com_from_pelvis, legs_of, posture
from gaitchain.discover.loaded_robot import load_robot
from gaitchain.gait.stride.draw import draw_strides
from gaitchain.gait.stride.shape import MODEL_SHAPE, StrideShape
from gaitchain.messages import CONTROL_PERIOD_S
from gaitchain.robot.box_robot import box_legs, load_box_robot
from gaitchain.walker.stride_setup import centred, make_walk

SHARED = Path(__file__).parents[3] / "shared" / "robots"
RES = load_box_robot("res")
SHAPE = StrideShape()
TIMING = SHAPE.timing(RES)
HEIGHT = SHAPE.hip_height * RES.reduced.leg_length
TRUNKS = st.floats(-0.08, 0.08)

AHEAD = derive_gains(legs_of(RES)).foot_zmp.x


def leaning(x, y=0.0):
    """The robot with its trunk's CoM elsewhere."""
    full = box_legs(RES.reduced)
    com = full.trunk_com + np.array([x, y, 0.0])
    return with_legs(RES, replace(full, trunk_com=com))


def standing(legs):
    """Joints with both feet side by side, the ankles behind the pelvis' origin."""
    joints = np.array(legs.start)
    for leg in range(2):
        own = slice(6 * leg, 6 * leg + 6)
        ankle = np.array([-AHEAD, (0.5 - leg) * legs.hip_width, -HEIGHT])
        joints[own] = leg_joints(legs, leg, ankle, np.eye(3), legs.start[own])
    return joints


@settings(max_examples=30)
@given(TRUNKS)
def test_the_com_is_over_the_origin_and_only_points_move(lean):
    before = legs_of(leaning(lean))
    after, _ = centred(before, HEIGHT, AHEAD)
    joints = standing(after)
    old, new = posture(before, joints), posture(after, joints)
    assert com_from_pelvis(after, new)[0] == pytest.approx(0.0, abs=1e-6)
    way = old.ankles[0] - new.ankles[0]
    np.testing.assert_array_equal(way[1:], 0.0)
    for name in ("centres", "coms", "ankles"):
        moved = getattr(old, name) - getattr(new, name)
        np.testing.assert_allclose(moved, np.broadcast_to(way, moved.shape), atol=1e-12)
    np.testing.assert_array_equal(old.axes, new.axes)
    np.testing.assert_array_equal(old.feet, new.feet)


@settings(max_examples=30)
@given(TRUNKS, st.floats(-0.02, 0.02))
def test_height_and_sides_stay(lean, aside):
    """Only x moves: a robot heavier on one side keeps its middle."""
    before = legs_of(leaning(lean, aside))
    after, _ = centred(before, HEIGHT, AHEAD)
    np.testing.assert_array_equal(after.at[..., 1:], before.at[..., 1:])
    np.testing.assert_array_equal(after.at[:, 1:], before.at[:, 1:])
    np.testing.assert_array_equal(after.trunk_com[1:], before.trunk_com[1:])
    changed = {
        name
        for name, old, new in zip(before._fields, before, after, strict=True)
        if not np.array_equal(old, new)
    }
    assert changed <= {"at", "trunk_com"}
    assert not after.at.flags.writeable


@settings(max_examples=30)
@given(TRUNKS)
def test_the_pendulum_is_as_high_as_the_com(lean):
    legs = legs_of(leaning(lean))
    after, height = centred(legs, HEIGHT, AHEAD)
    found = posture(after, standing(after))
    above = com_from_pelvis(after, found)[2] - found.ankles[0, 2]
    assert height == pytest.approx(above + legs.ankle_height, abs=1e-6)
    walk = make_walk(poses(leaning(lean)), TIMING)
    assert walk.times.omega == pytest.approx(np.sqrt(9.81 / height))
    assert walk.times.hip_height == HEIGHT


def poses(robot):
    return draw_strides(robot, "brisk", 3)


@pytest.mark.parametrize("lean", [-0.04, 0.0, 0.04])
def test_a_standing_walk_has_its_com_over_the_pelvis_point(lean):
    """To 2 mm: where the plan swings its pendulum, there is the robot's CoM."""
    walk = make_walk(poses(leaning(lean)), TIMING)
    com = com_from_pelvis(walk.legs, posture(walk.legs, walk.stand))
    assert com[0] == pytest.approx(0.0, abs=2e-3)


def test_a_standing_walk_stays_where_it_stands():
    """Its ZMP is where settling brings it, and its pelvis over that."""
    walk = make_walk(poses(RES), TIMING)
    at = walk.state.pelvis.x
    assert at == pytest.approx(walk.gains.foot_zmp.x, abs=2e-3)
    assert walk.state.zmp.x == pytest.approx(at, abs=2e-3)


def test_a_walk_has_the_robots_gains():
    robot = leaning(0.03)
    walk = make_walk(poses(robot), TIMING)
    assert walk.gains == derive_gains(legs_of(robot))
    assert walk.times.period == CONTROL_PERIOD_S
    blind = make_walk(poses(robot), TIMING, 0.005, feedback=False)
    assert blind.gains == open_loop(derive_gains(legs_of(robot)))
    assert blind.times.period == 0.005


@pytest.mark.parametrize("part", [0.85, 1.0, 1.1])
def test_a_robot_stands_and_steps_in_its_stance(part):
    """The feet are that far apart, the legs as long as they are."""
    shape = replace(SHAPE, stance=part)
    drawn = draw_strides(RES, "brisk", 3, shape=shape)
    stance = part * RES.reduced.hip_width
    walk = make_walk(drawn, TIMING)
    left, right = posture(walk.legs, walk.stand).ankles
    assert left[1] - right[1] == pytest.approx(stance, abs=1e-6)
    assert drawn.step_target(0, 0, 0).width == pytest.approx(stance)


@pytest.mark.parametrize("name", ["unitree_h1/h1.xml", "robotis_op3/op3.xml"])
def test_a_stand_bears_the_robots_weight(name):
    """Without feedback; under the angles alone H1's knees give way by 2 deg."""
    path = Path(os.environ.get("MENAGERIE_ROOT") or SHARED) / name
    if not path.is_file():
        pytest.skip(f"no {path}; set MENAGERIE_ROOT")
    robot = load_robot(str(path))
    poses = draw_strides(robot, "brisk", 2)
    walk, off, tilt = make_walk(poses, MODEL_SHAPE.timing(robot)), [], []
    for targets in (walk.stand, walk.stand_targets):
        backend = MujocoBackend(robot)
        backend.connect(walk.stand)
        for _ in range(100):
            backend.write(targets)
        off.append(np.abs(backend.joints - walk.stand).max())
        tilt.append(abs(backend.tilt[1]))
    assert off[1] < min(0.3 * off[0], math.radians(0.5))
    assert tilt[1] < tilt[0]
