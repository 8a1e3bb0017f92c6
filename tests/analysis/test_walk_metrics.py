"""The figures of a walk, on records made by hand."""

import json
import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from other_robots import with_legs
from standing_record import LEFT, PERIOD, RES, RIGHT, TICKS, record

from gaitchain.analysis.rule_checks import nearest_angle, nearest_speed
from gaitchain.analysis.simulated_walk import run_schedule
from gaitchain.analysis.walk_metrics import (
    fall_cause,
    percent,
    summarise,
    support_region,
    zmp_margins,
)
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.gait.schedule import Segment
from gaitchain.messages import Command
from gaitchain.robot.box_robot import box_legs
from gaitchain.sim.world import World
from gaitchain.walker.walker import Walker

SCHEDULE = (Segment(Command(0.1), steps=2), Segment(Command(0.04), steps=1))


def track(*speeds, rest=50, drift=0.0):
    """Base positions: one speed per step, then rest while coasting by `drift`."""
    steps = [np.full(TICKS, speed * PERIOD) for speed in speeds]
    moved = np.concatenate([[0.0], *steps, np.full(rest, drift / rest)])
    return np.cumsum(moved)[: len(speeds) * TICKS + rest]


def test_speeds_and_distance():
    walk = record(1.0 + track(0.1, 0.08, 0.02, drift=0.01))
    summary = summarise(RES, walk, SCHEDULE)
    first, last = summary.segments
    assert not summary.fell
    assert summary.cause is None
    assert first.commanded_mps == 0.1
    assert first.duration_s == pytest.approx(2.0)
    assert first.achieved_mps == pytest.approx(0.09)
    # The last segment includes coming to rest (less the very last period).
    assert last.duration_s == pytest.approx(1.0)
    assert last.achieved_mps == pytest.approx(0.02 + 0.01 * 49 / 50)
    assert summary.distance_m == pytest.approx(0.18 + 0.02 + 0.01 * 49 / 50)
    error = (2.0 * 0.01 + 1.0 * abs(last.achieved_mps - 0.04)) / 3.0
    assert summary.speed_error_mps == pytest.approx(error)


def test_a_joint_is_judged_by_its_own_limits():
    """A fast joint may be far from its limit, and a slow one at it; so with angles."""
    full = box_legs(RES.reduced)
    lower, upper = full.lower.copy(), full.upper.copy()
    lower[4], upper[4] = -0.1, 0.5
    robot = with_legs(RES, replace(full, lower=lower, upper=upper))
    values = np.zeros((350, 12))
    values[17, 3], values[200, 4], values[300, 7] = 1.2, 0.48, 0.6
    limits = np.full(12, 10.0)
    limits[7] = 1.0
    walk = record(track(0, 0, 0), joint_position=values, joint_velocity=-values)
    names = walk.joint_names
    assert nearest_angle(robot, walk) == (names[4], 0.48, -0.1, 0.5)
    assert nearest_angle(RES, walk)[:2] == (names[3], 1.2)
    slow = replace(walk, speed_limit=limits)
    assert nearest_speed(robot, slow) == (names[7], 0.6, -1.0, 1.0)
    free = replace(walk, speed_limit=np.inf)
    assert nearest_speed(robot, free) == (names[3], 1.2, -np.inf, np.inf)


def test_extremes():
    values = np.zeros((350, 12))
    values[17, 3], values[200, 7] = -1.0, 0.5
    walk = record(track(0, 0, 0), joint_position=values, joint_velocity=2.0 * values)
    summary = summarise(RES, replace(walk, torque=-30.0 * values), SCHEDULE)
    assert summary.max_joint_angle_deg == pytest.approx(math.degrees(1.0))
    assert summary.max_joint_speed_deg_s == pytest.approx(math.degrees(2.0))
    assert summary.max_torque_nm == pytest.approx(30.0)


def test_segments_after_a_fall_are_unknown():
    x = track(0.1, 0.1, 0.1)[:250]
    walk = record(x, fell_at_s=2.5)
    summary = summarise(RES, walk, SCHEDULE)
    assert summary.fell
    assert summary.segments[0].achieved_mps == pytest.approx(0.1)
    assert math.isnan(summary.segments[1].achieved_mps)
    assert summary.speed_error_mps == pytest.approx(0.0, abs=1e-12)
    early = summarise(RES, record(x[:60], fell_at_s=0.6), SCHEDULE)
    assert all(math.isnan(s.achieved_mps) for s in early.segments)
    assert math.isnan(early.speed_error_mps)


def test_json_holds_no_nan():
    walk = record(track(0.1)[:60], fell_at_s=0.6)
    plain = summarise(RES, walk, SCHEDULE).to_json()
    again = json.loads(json.dumps(plain, allow_nan=False))
    assert again["speed_error_mps"] is None
    assert [s["achieved_mps"] for s in again["segments"]] == [None, None]
    assert [s["commanded_mps"] for s in again["segments"]] == [0.1, 0.04]
    assert again["fell"] is True
    assert "fell" in again["cause"]


TILTS = {
    "forward": (0.0, 1.0, 0.0),
    "backward": (0.0, -1.0, 0.0),
    "to the left": (-1.0, 0.0, 0.0),
    "to the right": (1.0, 0.0, 0.0),
}


@pytest.mark.parametrize("side", TILTS)
@pytest.mark.parametrize("degrees", [50.0, 80.0])
def test_the_side_of_a_fall(side, degrees):
    half = math.radians(0.5 * degrees)
    walk = record(track(0.1, 0.1)[:150], fell_at_s=1.5)
    walk.qpos[-1, 3:7] = math.cos(half), *(math.sin(half) * np.array(TILTS[side]))
    assert f"fell {side} at 1.50 s" in fall_cause(walk)


def test_the_cause_names_step_key_moment_and_support():
    walk = record(track(0.1, 0.1)[:150], fell_at_s=1.5)
    walk.qpos[-1, 3:7] = math.cos(0.5), 0.0, math.sin(0.5), 0.0
    walk.key_pose[-1] = 2, 5
    walk.support[-1] = "rs"
    cause = fall_cause(walk)
    assert "in step 2 moving to kp_3, planned support rs" in cause
    walk.key_pose[-1] = 0, 0
    assert fall_cause(walk) == "fell forward at 1.50 s, standing after step 2"
    assert fall_cause(record(track(0.1))) is None


def test_the_cause_says_what_broke_first_and_what_to_try():
    """A record that holds its robot says more than where and when it fell."""
    walk = record(track(0.1, 0.1)[:150], fell_at_s=1.5, robot=RES)
    walk.qpos[-1, 3:7] = math.cos(0.5), 0.0, math.sin(0.5), 0.0
    place = "fell forward at 1.50 s, standing after step 2"
    assert fall_cause(walk) == f"{place}: no rule broke before"
    walk.torque[70:, 3] = 120.0
    assert fall_cause(walk) == (
        f"{place}: torque saturation at left_knee 120.0 N m, 0.80 s before; try "
        "hip_height up (straighter knees), or joint_torque_limit up"
    )
    pushed = replace(walk, events=((0.65, "a push"),))
    assert "left_knee 120.0 N m after a push, 0.80 s before; try" in fall_cause(pushed)


@pytest.mark.parametrize(
    ("rows", "step"), [(99, 1), (100, 1), (101, 2), (300, 3), (301, 3), (350, 3)]
)
def test_the_cause_counts_the_steps(rows, step):
    """Row 100 is the first of step 2; what comes after the last step belongs to it."""
    walk = record(track(0.1, 0.1, 0.1)[:rows], fell_at_s=rows * PERIOD)
    walk.qpos[-1, 3:7] = math.cos(0.5), 0.0, math.sin(0.5), 0.0
    walk.key_pose[-1] = 1, 0
    assert f"in step {step} moving to kp_2" in fall_cause(walk)
    walk.key_pose[-1] = 0, 0
    assert f"standing after step {step}" in fall_cause(walk)


def assert_falls(side, degrees, heading, off):
    """Turned by a heading, then tipped over to a direction `off` that of a side."""
    turn, yaw, tilt, axis = (np.empty(n) for n in (4, 4, 4, 3))
    mujoco.mju_axisAngle2Quat(turn, [0.0, 0.0, 1.0], math.radians(off))
    mujoco.mju_rotVecQuat(axis, np.array(TILTS[side]), turn)
    mujoco.mju_axisAngle2Quat(tilt, axis, math.radians(degrees))
    mujoco.mju_axisAngle2Quat(yaw, [0.0, 0.0, 1.0], math.radians(heading))
    pose = np.empty(4)
    mujoco.mju_mulQuat(pose, yaw, tilt)
    walk = record(track(0.1, 0.1)[:150], fell_at_s=1.5)
    for same in (pose, -pose):
        walk.qpos[-1, 3:7] = same
        assert fall_cause(walk).startswith(f"fell {side} at 1.50 s")


@given(
    st.sampled_from(sorted(TILTS)),
    st.floats(45.0, 85.0),
    st.floats(-180.0, 180.0),
)
def test_the_side_of_a_fall_is_the_robots_own(side, degrees, heading):
    assert_falls(side, degrees, heading, off=0.0)


@given(
    st.sampled_from(sorted(TILTS)),
    st.floats(45.0, 85.0),
    st.floats(-180.0, 180.0),
    st.floats(-40.0, 40.0),
)
def test_the_side_of_a_fall_is_the_nearest(side, degrees, heading, off):
    """Seldom does it fall to exactly one side."""
    assert_falls(side, degrees, heading, off)


def one_row(zmp, support, left=LEFT, right=RIGHT):
    return record(
        np.zeros(1),
        zmp=np.array([zmp]),
        feet=np.array([[left, right]]),
        support=np.array([support]),
    )


# The sole of RES reaches from 0.09 m behind the ankle to 0.13 m ahead of it, and
# 0.065 m to each side.
@pytest.mark.parametrize(
    ("zmp", "support", "expected"),
    [
        ((0.02, 0.1), "ls", 0.065),
        ((0.02, 0.035), "ls", 0.0),
        ((0.02, 0.0), "ls", -0.035),
        ((0.02, 0.0), "rs", -0.035),
        ((0.02, -0.1), "rs", 0.065),
        ((0.12, 0.1), "ls", 0.01),
        ((-0.1, 0.1), "ls", -0.01),
        ((0.02, 0.0), "lr", 0.11),
        ((0.02, 0.0), "rl", 0.11),
        ((0.02, 0.0), "stand", 0.11),
        ((0.02, 0.2), "stand", -0.035),
        ((math.nan, math.nan), "stand", -math.inf),
    ],
)
def test_margins_where_the_feet_stand(zmp, support, expected):
    (margin,) = zmp_margins(RES, one_row(zmp, support))
    assert margin == pytest.approx(expected, abs=1e-12)


def test_the_region_moves_and_turns_with_the_foot():
    ahead = one_row((0.52, 0.1), "ls", left=(0.5, 0.1, 0.0))
    assert zmp_margins(RES, ahead)[0] == pytest.approx(0.065)
    turned = one_row((0.0, 0.12), "ls", left=(0.0, 0.1, math.pi / 2))
    corners = support_region(RES, turned, 0)
    np.testing.assert_allclose(corners.min(axis=0), [-0.065, 0.01], atol=1e-12)
    np.testing.assert_allclose(corners.max(axis=0), [0.065, 0.23], atol=1e-12)
    assert zmp_margins(RES, turned)[0] == pytest.approx(0.065)


def test_a_stride_has_a_slanted_region():
    """Right foot 0.2 m ahead: the hull cuts the two empty corners."""
    row = one_row((0.12, 0.0), "lr", right=(0.2, -0.1, 0.0))
    region = support_region(RES, row, 0)
    assert len(region) == 6
    assert zmp_margins(RES, row)[0] > 0.0
    empty = replace(row, zmp=np.array([[0.3, 0.1]]))
    assert zmp_margins(RES, empty)[0] < 0.0


def test_the_share_of_time_inside():
    walk = record(track(0.1, 0.1, 0.1))
    walk.zmp[:70, 1] = 1.0  # far outside
    assert summarise(RES, walk, SCHEDULE).zmp_inside_support == pytest.approx(0.8)


@pytest.mark.parametrize(
    ("share", "said"),
    [
        (1.0, "100 %"),
        (0.9976, "99.7 %"),
        (0.99999, "99.9 %"),
        (0.57, "57 %"),
        (0.8809, "88 %"),
        (0.0004, "0 %"),
    ],
)
def test_a_hundred_percent_are_all(share, said):
    assert percent(share) == said


def test_a_real_walk(library):
    schedule = (
        Segment(Command(0.04), steps=1),
        Segment(Command(0.05), steps=2),
        Segment(Command(0.02), steps=1),
    )
    walk = run_schedule(
        Walker(library, feedback=False), MujocoBackend(library.robot), schedule
    )
    rows = len(walk.time_s)
    assert rows == 4 * 300 + 100
    assert walk.step_ticks == (0, 300, 600, 900, 1200)
    np.testing.assert_allclose(np.diff(walk.time_s), 0.01)
    assert walk.time_s[0] == 0.0
    assert walk.qpos.shape == (rows, 19)
    assert walk.feet.shape == (rows, 2, 3)
    np.testing.assert_array_equal(walk.joint_position, walk.qpos[:, 7:])
    assert [str(walk.support[t]) for t in (10, 290, 310, 590)] == [
        "ls",
        "lr",
        "rs",
        "rl",
    ]
    assert walk.key_pose[10, 0] == 1
    summary = summarise(library.robot, walk, schedule)
    assert not summary.fell
    assert summary.distance_m == pytest.approx(
        sum(s.achieved_mps * s.duration_s for s in summary.segments)
    )
    assert summary.distance_m > 0.1
    limits = library.robot.reduced.numbers()
    assert summary.max_torque_nm <= limits["joint_torque_limit"]
    assert np.radians(summary.max_joint_angle_deg) <= limits["joint_angle_limit"]
    assert 0.5 < summary.zmp_inside_support <= 1.0
    json.dumps(summary.to_json(), allow_nan=False)


def test_a_real_fall_ends_the_record(library):
    schedule = (Segment(Command(0.08), steps=4),)
    backend = MujocoBackend(library.robot, World(servo_gain=0.1))
    walk = run_schedule(Walker(library, feedback=False), backend, schedule)
    assert walk.fell_at_s == pytest.approx(0.01 * len(walk.time_s))
    summary = summarise(library.robot, walk, schedule)
    assert summary.fell
    assert summary.cause.startswith("fell ")
    assert f"at {walk.fell_at_s:.2f} s" in summary.cause
    assert ": tracking lag at " in summary.cause
    assert summary.cause.endswith("try servo_stiffness up, or --step-s up")
    assert "\n" not in summary.cause


TIMED = (
    Segment(Command(0.1), 3.0),
    Segment(Command(0.0, 0.05, 0.2), 2.0),
    Segment(Command(0.0, 0.0, -0.3), 1.0),
)


def moved(velocity, schedule=TIMED, rest=100, **changes):
    """A record of a base that moves as commanded: (vx, vy, yaw rate) per segment."""
    asked = [
        np.tile(v, (round(s.duration_s / PERIOD), 1))
        for v, s in zip(velocity, schedule, strict=True)
    ]
    rates = np.concatenate([*asked, np.zeros((rest, 3))])
    yaw = np.concatenate([[0.0], np.cumsum(rates[:-1, 2] * PERIOD)]) + 0.7
    middle = yaw + 0.5 * rates[:, 2] * PERIOD
    steps = PERIOD * np.column_stack(
        [
            np.cos(middle) * rates[:, 0] - np.sin(middle) * rates[:, 1],
            np.sin(middle) * rates[:, 0] + np.cos(middle) * rates[:, 1],
        ]
    )
    walk = record(np.zeros(len(rates)), **changes)
    walk.qpos[1:, :2] = np.cumsum(steps[:-1], axis=0)
    walk.qpos[:, 3:7] = 0.0
    walk.qpos[:, 3], walk.qpos[:, 6] = np.cos(0.5 * yaw), np.sin(0.5 * yaw)
    return walk


def asked(schedule=TIMED):
    return [(s.command.vx, s.command.vy, s.command.yaw_rate) for s in schedule]


def test_a_timed_walk_as_commanded_has_no_error():
    """Whatever the heading: the robot's own frame is what counts."""
    summary = summarise(RES, moved(asked()), TIMED)
    assert summary.speed_error_mps == pytest.approx(0.0, abs=1e-9)
    # Two seconds of the first segment do not count, turning in place never does.
    assert summary.speed_mps == pytest.approx((0.1 * 1.0 + 0.05 * 2.0) / 3.0)
    assert summary.yaw_drift_deg == pytest.approx(0.0, abs=1e-9)
    assert summary.lateral_drift_m == pytest.approx(0.0, abs=1e-9)
    for segment, command in zip(summary.segments, asked(), strict=True):
        did = segment.achieved
        assert (did.vx, did.vy, did.yaw_rate) == pytest.approx(command, abs=1e-9)
    assert [s.commanded_mps for s in summary.segments] == pytest.approx([0.1, 0.05, 0])
    assert summary.segments[1].achieved_mps == pytest.approx(0.05)
    assert math.isnan(summary.segments[2].achieved_mps)
    plain = json.loads(json.dumps(summary.to_json(), allow_nan=False))
    assert plain["segments"][1]["command"]["vy"] == 0.05
    assert plain["segments"][2]["achieved_mps"] is None
    assert plain["zmp_rms_m"] is None


def test_errors_and_drifts_of_a_timed_walk():
    did = [(0.08, 0.01, 0.0), (0.0, 0.07, 0.2), (0.0, 0.0, -0.2)]
    summary = summarise(RES, moved(did), TIMED)
    assert summary.speed_mps == pytest.approx((0.08 * 1.0 + 0.07 * 2.0) / 3.0)
    assert summary.speed_error_mps == pytest.approx(0.02)
    assert summary.yaw_drift_deg == pytest.approx(math.degrees(0.1))
    assert summary.lateral_drift_m == pytest.approx(0.01 * 3.0 + 0.02 * 2.0)


def test_a_short_timed_walk_has_no_speed_yet():
    schedule = (Segment(Command(0.1), 2.0),)
    summary = summarise(RES, moved([(0.1, 0, 0)], schedule), schedule)
    assert math.isnan(summary.speed_mps)
    assert summary.segments[0].achieved_mps == pytest.approx(0.1)


def test_a_timed_segment_with_a_fall_is_unknown():
    walk = moved(asked(), rest=0)
    rows = 400
    cut = {
        name: value[:rows]
        for name, value in vars(walk).items()
        if isinstance(value, np.ndarray)
    }
    summary = summarise(RES, replace(walk, **cut, fell_at_s=4.0), TIMED)
    assert summary.fell
    assert summary.speed_mps == pytest.approx(0.1)
    assert math.isnan(summary.segments[1].achieved.vx)
    # One second less a row of the second segment was walked.
    assert summary.yaw_drift_deg == pytest.approx(0.0, abs=1e-6)
    assert math.isnan(summary.stop_s)


@pytest.mark.parametrize(
    ("still_from", "expected"), [(0, 0.0), (600, 0.0), (640, 0.4), (700, math.nan)]
)
@pytest.mark.parametrize("axis", ["x", "height"])
def test_the_time_to_stop(still_from, expected, axis):
    walk = moved(asked())
    moving = 0.01 * np.maximum(still_from - np.arange(700), 0)
    if axis == "x":
        walk.feet[:, 1, 0] += moving
    else:
        walk.foot_height[:, 0] += moving
    summary = summarise(RES, walk, TIMED)
    assert summary.stop_s == pytest.approx(expected, nan_ok=True)


def test_trembling_feet_stand_still():
    walk = moved(asked())
    walk.feet[:, :, 0] += 0.0009 * (-1.0) ** np.arange(700)[:, None]
    assert summarise(RES, walk, TIMED).stop_s == 0.0


def test_a_schedule_that_stands_at_its_end_stops_before():
    schedule = (*TIMED[:2], Segment(Command(), 1.0))
    walk = moved([*asked()[:2], (0, 0, 0)])
    walk.feet[:530, 0, 0] += 0.1
    assert summarise(RES, walk, schedule).stop_s == pytest.approx(0.3)


def test_the_zmp_beside_the_plan():
    """Only in single support, and where a ZMP is planned and measured."""
    walk = moved(asked())
    walk.support[:200], walk.support[200:300] = "ls", "rl"
    walk.planned_zmp[:100], walk.zmp[:100] = (0.0, 0.0), (0.03, 0.04)
    walk.planned_zmp[200:300] = 1.0, 1.0
    walk.zmp[50:60] = math.nan
    assert summarise(RES, walk, TIMED).zmp_rms_m == pytest.approx(0.05)


def test_the_papers_walks_have_the_same_figures():
    walk = record(track(0.1, 0.08, 0.02))
    summary = summarise(RES, walk, SCHEDULE)
    assert summary.speed_mps == pytest.approx((0.1 + 0.08 + 0.02) / 3.0)
    assert summary.yaw_drift_deg == summary.lateral_drift_m == 0.0
    assert summary.stop_s == 0.0
    assert math.isnan(summary.zmp_rms_m)
