"""A robot pushed over its support foot waits on it, its trunk thrown into the fall."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from walk_record import walk_record

from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.balance.control_step import advance_plan
from gaitchain.balance.gains import open_loop
from gaitchain.balance.leg_kinematics import com_from_pelvis, legs_of, posture
from gaitchain.balance.one_foot_recovery import (
    _AHEAD,
    _SUDDEN,
    lean_on,
    measured_dcm,
    seen_upright,
    waits_on_one_foot,
)
from gaitchain.balance.reference_pose import pose_joints, swing_foot
from gaitchain.balance.state import SINGLE, Attitude, Foot, Lean, Pelvis, Planar, View
from gaitchain.balance.step_plan import _STILL, plan_on_one_foot
from gaitchain.cli.libraries import shipped_library
from gaitchain.gait.library_file import load_library
from gaitchain.gait.zmp import Support
from gaitchain.messages import Command
from gaitchain.sim.model import build_model
from gaitchain.walker.stride_setup import make_walk
from gaitchain.walker.walker import Walker

LIBRARY = load_library(shipped_library())
RES, WALK = LIBRARY.robot, make_walk(LIBRARY.poses, LIBRARY.timing)
LEGS, GAINS, TIMES = WALK.legs, WALK.gains, WALK.times
TARGET = WALK.target._replace(share_rate=1.4, lift=0.04, fall_rate=0.05)
PUSHED = Planar(0.0, 1.01 * GAINS.far_zone.y)
ON_ONE_FOOT = WALK.state._replace(phase=SINGLE, error=PUSHED)
MODEL = build_model(RES)
FEET = [MODEL.body(f"{side}_foot").id for side in ("left", "right")]
SIDES = st.sampled_from([1.0, -1.0])
BESIDE, TURNS = st.floats(-0.24, -0.2), st.floats(0.0, 0.1)
TRIED = settings(deadline=None, max_examples=40, derandomize=True)


def feet(low, high):
    return st.builds(Foot, st.floats(low, high), BESIDE, TURNS)


def seen(dcm, speed=0.0):
    """What the sensors say of a CoM that moves at a speed, its DCM at a place."""
    com = Pelvis(0.0, dcm - speed / TIMES.omega, 0.0, speed)
    return dcm_of(com)


def dcm_of(com, side=1.0, offset=(0.0, 0.0)):
    """The DCM as it is measured of a CoM."""
    view = View(com, 0.0, Planar(), Foot(0.0, -0.2), 0.5, 0.01)
    state = ON_ONE_FOOT._replace(side=side)
    parts = {"state": state, "measured": view, "com_offset": Planar(*offset)}
    return measured_dcm(walk_record(GAINS, TIMES, **parts))


def waits(state, dcm, gains=GAINS):
    return waits_on_one_foot(LEGS, walk_record(gains, TIMES, state=state), dcm)


@TRIED
@given(SIDES, st.floats(-1.0, 1.0))
def test_a_robot_waits_from_one_dcm_until_a_further_one(side, speed):
    """Out over its foot and back in; place and speed count as the DCM alone."""
    way = 0.1 - np.abs(np.linspace(-0.2, 0.2, 401))
    state, found = ON_ONE_FOOT._replace(side=side), []
    for dcm in way:
        state = state._replace(one_foot=waits(state, seen(dcm, speed)))
        found.append(state.one_foot)
    begins, ends = np.flatnonzero(np.diff(found))  # once, without a break
    assert way[begins] <= -GAINS.one_foot_from <= way[begins + 1]
    assert way[ends] >= -GAINS.one_foot_until >= way[ends + 1]


@TRIED
@given(st.integers(0, 4), st.floats(allow_nan=False), st.sampled_from([0.0, 1.0]))
def test_nobody_waits_on_two_feet_or_without_a_push_or_feedback(phase, dcm, before):
    if phase != SINGLE:
        state = ON_ONE_FOOT._replace(phase=phase, one_foot=before)
        assert waits(state, seen(dcm)) == 0.0
    calm = ON_ONE_FOOT._replace(error=Planar(0.0, 0.99 * GAINS.far_zone.y))
    assert waits(calm, seen(dcm)) == 0.0
    assert waits(ON_ONE_FOOT, seen(dcm), open_loop(GAINS)) == 0.0


@TRIED
@given(st.floats(-0.5, 0.5), st.floats(-1.0, 1.0), st.sampled_from([0.0, 1.0]))
def test_a_robot_that_falls_ahead_must_step(ahead, speed, before):
    """And one that falls back; who can stand on the sole waits."""
    state = ON_ONE_FOOT._replace(one_foot=before)
    com = Pelvis(ahead - speed / TIMES.omega, 0.05, speed, 0.0)
    can = LEGS.sole_rear < ahead < _AHEAD * LEGS.sole_front
    assert waits(state, dcm_of(com)) == float(can)


def test_what_was_learned_of_the_com_counts():
    """To the left of the trunk: outward over the left foot, inward over the right."""
    com = Pelvis(0.02, -0.05, 0.0, 0.0)
    for side in (1.0, -1.0):
        dcm = dcm_of(com, side, (0.01, 0.02))
        np.testing.assert_allclose(dcm, (0.03, -0.05 + side * 0.02))


def leans(path):
    """Lean in each period, (n, 3); a path has DCMs, sides and their periods."""
    state, found = ON_ONE_FOOT, [ON_ONE_FOOT.lean]
    for dcm, side, periods in path:
        view, state = seen(dcm), state._replace(side=side)
        for _ in range(periods):
            state = state._replace(one_foot=waits(state, view))
            walk = walk_record(GAINS, TIMES, state=state)
            state = state._replace(lean=lean_on(walk, view))
            found.append(state.lean)
    return np.array(found)


RETURN = round(4.0 / GAINS.lean_back / TIMES.period)
PATHS = st.lists(st.tuples(st.floats(-0.2, 0.2), SIDES, st.integers(1, 40)), min_size=1)


@TRIED
@given(PATHS)
def test_no_push_bends_the_robot_too_far_or_too_suddenly(path):
    """It never overshoots, the hip bears it, and at last it is upright again."""
    angle, speed, _ = leans([*path, (-0.2, 1.0, RETURN)]).T
    assert np.abs(angle).max() <= GAINS.lean_most + 1e-12
    turning = np.abs(np.diff(speed)) / TIMES.period
    assert turning.max() <= _SUDDEN * GAINS.lean_rate**2 * GAINS.lean_most + 1e-9
    trunk = MODEL.body("trunk")
    inertia = trunk.inertia[0] + trunk.mass[0] * trunk.ipos[2] ** 2
    assert inertia * turning.max() < RES.reduced.joint_torque_limit
    assert abs(angle[-1]) < 0.03 * GAINS.lean_most  # e^-4, and the angle comes later


@TRIED
@given(PATHS, st.floats(-0.9 * GAINS.one_foot_from, 0.1), SIDES)
def test_the_trunk_leans_over_the_foot_it_stands_on(path, last, side):
    """The further the DCM is out, the further it leans."""
    found = leans([(dcm, side, periods) for dcm, _, periods in path])
    assert (side * found[:, 0]).min() >= -1e-12
    wanted = np.clip(GAINS.lean * (last - GAINS.lean_from), 0.0, GAINS.lean_most)
    angle = leans([(last, side, 100)])[-1, 0]
    assert side * angle == pytest.approx(wanted, abs=1e-4)


STATES = st.builds(
    ON_ONE_FOOT._replace,
    side=SIDES,
    time=st.just(0.5 * TIMES.single),  # the pelvis gives way to no foot
    pelvis=st.builds(
        ON_ONE_FOOT.pelvis._replace, x=st.floats(-0.03, 0.08), y=st.floats(-0.12, 0.0)
    ),
    lift_off=feet(-0.15, 0.0),
    landing=feet(0.0, 0.15),
)
ANGLES = st.floats(-GAINS.lean_most, GAINS.lean_most)


def leaning(state, angle):
    """A robot that leans as its reference does: joints, and it on a level foot at 0."""
    state = state._replace(lean=Lean(angle, 0.0, angle))
    parts = {"target": TARGET, "state": state, "attitude": Attitude(-angle)}
    joints = pose_joints(LEGS, walk_record(GAINS, TIMES, **parts), LEGS.start)
    data, foot = mujoco.MjData(MODEL), FEET[0 if state.side > 0 else 1]
    data.qpos[:3], data.qpos[7:] = 0.0, joints
    mujoco.mj_forward(MODEL, data)
    turn = data.xmat[foot].reshape(3, 3).T
    data.qpos[:3] = -turn @ data.xpos[foot]
    mujoco.mju_mat2Quat(data.qpos[3:7], turn.ravel())
    mujoco.mj_forward(MODEL, data)
    return joints, data


@TRIED
@given(STATES, ANGLES, st.floats(-0.1, 0.1))
def test_the_trunk_leans_and_both_feet_stay(state, angle, yaw):
    """To the left by the angle, whichever foot supports."""
    side, (_, data) = state.side, leaning(state._replace(pelvis_yaw=yaw), angle)
    swing = FEET[1 if side > 0 else 0]
    walk = walk_record(GAINS, TIMES, target=TARGET, state=state)
    x, y, height, turn = swing_foot(walk)
    turns = [-side * yaw, 0.0, -angle], [-side * turn, 0.0, 0.0]
    trunk, level = Rotation.from_euler("ZYX", turns).as_matrix().reshape(2, 9)
    np.testing.assert_allclose(data.body("trunk").xmat, trunk, atol=1e-6)
    np.testing.assert_allclose(data.xmat[swing], level, atol=1e-6)
    np.testing.assert_allclose(data.xpos[swing], (x, side * y, height), atol=1e-6)


@TRIED
@given(STATES, ANGLES, st.floats(-0.1, 0.1))
def test_a_leaning_robot_is_seen_upright(state, angle, yaw):
    """CoM from where the pelvis was planned; joints from where it is; both level."""
    joints, data = leaning(state._replace(pelvis_yaw=yaw), angle)
    com, found = seen_upright(LEGS, joints, angle)
    planned = state.pelvis.x, state.side * state.pelvis.y, TIMES.hip_height
    heading = Rotation.from_euler("z", -state.side * yaw)
    expected = heading.apply(data.subtree_com[1] - planned, inverse=True)
    np.testing.assert_allclose(com, expected, atol=1e-6)
    trunk = data.body("trunk")
    lead = legs_of(RES).trunk_com - LEGS.trunk_com  # the pelvis frame's own origin
    origin = trunk.xpos + trunk.xmat.reshape(3, 3) @ lead
    centres = heading.apply(data.xanchor[1:] - origin, inverse=True)
    axes = heading.apply(data.xaxis[1:], inverse=True)
    ankles = heading.apply(data.xpos[FEET] - origin, inverse=True)
    feet = heading.inv().as_matrix() @ data.xmat[FEET].reshape(2, 3, 3)
    np.testing.assert_allclose(found.centres, centres.reshape(2, 6, 3), atol=1e-6)
    np.testing.assert_allclose(found.axes, axes.reshape(2, 6, 3), atol=1e-6)
    np.testing.assert_allclose(found.ankles, ankles, atol=1e-6)
    np.testing.assert_allclose(found.feet, feet, atol=1e-6)
    com, found = seen_upright(LEGS, joints, 0.0)
    as_it_is = posture(LEGS, joints)
    expected = com_from_pelvis(LEGS, as_it_is), *as_it_is
    assert all(map(np.array_equal, (com, *found), expected))


@TRIED
@given(st.tuples(*[st.floats(-0.2, 0.2)] * 3), st.floats(0.0, 1.1), feet(-0.1, 0.3))
def test_a_waiting_robot_has_its_zmp_at_the_soles_edge(places, part, landing):
    """Ahead the ZMP is under the DCM, so that the step can end long after."""
    (length, *dcm), time_s = places, part * TIMES.single
    target, back = TARGET._replace(length=length), 0.2 / TIMES.omega
    pelvis = Pelvis(dcm[0] - back, dcm[1] - back, 0.2, 0.2)
    state = ON_ONE_FOOT._replace(
        one_foot=1.0,
        time=time_s,
        pelvis=pelvis,
        landing=landing,
        error=Planar(0.0, 0.001),
    )
    walk = walk_record(GAINS, TIMES, target=target, state=state)
    plan = plan_on_one_foot(LEGS, walk, pelvis)
    assert plan.landing == landing
    assert plan.zmp.y == LEGS.sole_half_width - GAINS.sole_margin
    assert plan.rate == (1.0 if time_s <= TIMES.rise else _STILL)
    low, high = LEGS.sole_rear + GAINS.sole_margin, LEGS.sole_front - GAINS.sole_margin
    # A DCM off the ZMP goes as e^(w t), and is off by less than 1 m at touch-down.
    near = np.exp(-TIMES.omega * max(TIMES.single - time_s, GAINS.fixed_s) / _STILL)
    assert plan.zmp.x == pytest.approx(np.clip(dcm[0], low, high), abs=near + 1e-12)
    # The reference follows sideways however little it is off; its CoM swings there.
    advance_plan(LEGS, walk, 0.02)
    after = walk.state.pelvis
    assert (walk.state.rate, walk.state.landing.item()) == (plan.rate, landing)
    turn, about = TIMES.omega * TIMES.period, plan.zmp.y - 0.02
    speed = pelvis.vy / TIMES.omega + GAINS.one_foot_follow * TIMES.period * 0.001
    swung = about + (pelvis.y - about) * np.cosh(turn) + speed * np.sinh(turn)
    assert after.y == pytest.approx(swung, abs=1e-12)


POSES = LIBRARY.poses
NEVER_WAITS, NEVER_LEANS = (
    replace(LIBRARY, poses=replace(POSES, balance={**POSES.balance, **factor}))
    for factor in ({"one_foot_from": -1e6}, {"lean": 0.0})
)


def pushed(library, impulse_ns, side):
    """Walk, be pushed over a foot 0.04 s after it landed, and go on for 4 s.

    Return whether it fell; lean and true tilt to the pushed side; and of the periods in
    which it waited the step's time, true ZMP beside the ankle, the other foot's load.
    """
    walker, backend, first = Walker(library), MujocoBackend(RES), 0 if side > 0 else 1
    landed = (Support.RIGHT_TO_LEFT, Support.LEFT_TO_RIGHT)[first]
    backend.connect(walker.stand)
    walker.command(Command(0.3))
    tilts, waited, since = [], [], -1
    while since < 404 and not backend.fallen:
        backend.write(walker.step(backend.read()).position)
        state = walker.gait._walk.state
        since += since >= 0 or (
            walker.gait.steps >= 10 and walker.gait.support == landed
        )
        if since == 4:
            backend.push(impulse_ns, 90.0 * side)
        elif since > 4:
            tilts.append((side * state.lean.angle, -side * backend.tilt[0]))
        if state.one_foot and state.side == side:
            off = backend.zmp() - backend.foot_positions()[first, :2]
            zmp = side * off @ backend.data.xmat[FEET[first], 1:5:3]  # across the foot
            waited.append((state.time, zmp, backend.foot_loads()[1 - first]))
    return backend.fallen, np.array(tilts), np.reshape(waited, (-1, 3)).T


@pytest.mark.parametrize("impulse_ns", [11.5, 12.0, 12.5])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_robot_that_waits_survives_what_it_fell_after(side, impulse_ns):
    """At least 1 N s more than it needs to fall without, and 1 less than with."""
    assert pushed(NEVER_WAITS, impulse_ns, side)[0]
    fell, tilts, (times, zmps, loads) = pushed(LIBRARY, impulse_ns, side)
    assert not fell
    assert TIMES.rise < times.max() < TIMES.rise + 0.02  # then the time stands still
    assert np.nanmin(zmps) > 0.8 * LEGS.sole_half_width
    assert not loads.any()
    # It leaned over its foot, really so, was upright 3 s later, and waited less.
    assert tilts.max(axis=0).min() > 0.2
    assert np.abs(tilts[300:]).max() < np.radians(2.0)
    assert len(times) < 0.8 * len(pushed(NEVER_LEANS, impulse_ns, side)[2][0])
