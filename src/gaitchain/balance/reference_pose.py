"""The reference pose: where pelvis and feet are, and the joint angles of that.

The swing foot goes from lift-off over kp_2 to its landing in two cubic Hermite
segments, as the chain's key poses ask. Compiled.
"""

import math

import numpy as np

from gaitchain.balance.compiled import compiled
from gaitchain.balance.gains import Gains, clip
from gaitchain.balance.leg_ik import leg_joints
from gaitchain.balance.leg_kinematics import Legs
from gaitchain.balance.one_foot_recovery import lean_shift
from gaitchain.balance.packed_state import Row, attitude_in, state_in
from gaitchain.balance.rotations import product, rotation, turned_back
from gaitchain.balance.state import DOUBLE, SINGLE, Attitude, GaitState, StepTimes
from gaitchain.gait.step_target import StepTarget
from gaitchain.messages import Array

_LEAVING = 0.2  # part of single support
_LOWERING = 3.0  # lifts per single support that a late foot is lowered by


@compiled
def hermite(
    start: float, rate: float, end: float, end_rate: float, span: float, time: float
) -> tuple[float, float, float]:
    """Evaluate the cubic through both ends at a time: value, rate, acceleration."""
    slope = (end - start) / span
    a = (rate + end_rate - 2.0 * slope) / span**2
    b = (3.0 * slope - 2.0 * rate - end_rate) / span
    value = ((a * time + b) * time + rate) * time + start
    return value, (3.0 * a * time + 2.0 * b) * time + rate, 6.0 * a * time + 2.0 * b


@compiled
def swing_foot(
    goal: StepTarget, times: StepTimes, state: GaitState
) -> tuple[float, float, float, float]:
    """Return the swing foot at the end of this period: x, y, height, outward turn.

    Two cubics joined at kp_2, as parts of the way from lift-off to the landing.
    """
    if state.phase != SINGLE:
        foot = state.lift_off if state.phase != DOUBLE else state.landing
        return foot.x, foot.y, 0.0, foot.yaw
    phase = clip(state.time / times.single, 0.0, 1.0)
    top = times.rise / times.single
    if phase < top:
        part, _, _ = hermite(0.0, 0.0, goal.share, goal.share_rate, top, phase)
        height, _, _ = hermite(0.0, 0.0, 1.0, 0.0, top, phase)
    else:
        part, _, _ = hermite(
            goal.share, goal.share_rate, 1.0, goal.landing_rate, 1.0 - top, phase - top
        )
        height, _, _ = hermite(1.0, 0.0, 0.0, -goal.fall_rate, 1.0 - top, phase - top)
    start, end = state.lift_off, state.landing
    late = max(state.time / times.single - 1.0, 0.0)
    return (
        start.x + part * (end.x - start.x),
        start.y + part * (end.y - start.y),
        goal.lift * (height - _LOWERING * late),
        start.yaw + part * (end.yaw - start.yaw),
    )


@compiled
def _free(times: StepTimes, state: GaitState) -> float:
    """How free the other foot is: it leaves and takes over the load smoothly."""
    if state.phase == SINGLE:
        return min(state.time / (_LEAVING * times.single), 1.0)
    if state.phase == DOUBLE:
        return clip((times.step - state.time) / (times.step - times.single), 0.0, 1.0)
    return 0.0


@compiled
def pose_joints(
    legs: Legs,
    gains: Gains,
    times: StepTimes,
    goal: StepTarget,
    state: GaitState,
    attitude: Attitude,
    offset: Array,
    before: Array,
) -> Array:
    """Return the reference joint angles, (2 n,) [rad].

    The support leg carries the pelvis where the plan has it and leans against the
    trunk's tilt; the swing leg aims at its place on the level ground.

    Args:
        legs: the robot.
        gains: of the balance.
        times: the rhythm.
        goal: the chain's choice for this step.
        state: of the walk.
        attitude: of the trunk.
        offset: (2,) how far the robot's CoM is off its model's, ahead and left [m].
        before: (2 n,) reference of a moment ago, where the IK begins [rad].
    """
    x, y, height, yaw = swing_foot(goal, times, state)
    side = state.side
    turn, lean = -side * state.pelvis_yaw, state.lean.angle
    shift = lean_shift(legs, lean)  # along the trunk's y
    pelvis_x = state.pelvis.x - offset[0] + shift * math.sin(turn)
    pelvis_y = state.pelvis.y - side * (offset[1] + shift * math.cos(turn))
    if state.phase == SINGLE:
        phase = clip(state.time / times.single, 0.0, 1.0)
        ahead = phase * phase * (3.0 - 2.0 * phase) - phase
        way = gains.counter_swing * ahead
        pelvis_x -= way * (state.landing.x - state.lift_off.x)
        pelvis_y -= way * (state.landing.y - state.lift_off.y)
    tilt = attitude.roll + lean
    roll, pitch = -gains.trunk * tilt, -gains.trunk * attitude.pitch
    count = before.shape[0] // 2
    joints = np.empty(2 * count)
    first = 0 if side > 0 else 1
    own = slice(first * count, (first + 1) * count)
    trunk = rotation(turn, pitch, roll - lean)
    ankle = np.empty(3)
    ankle[0], ankle[1], ankle[2] = -pelvis_x, -side * pelvis_y, -times.hip_height
    joints[own] = leg_joints(
        legs, first, turned_back(trunk, ankle), trunk.T.copy(), before[own]
    )
    allow = gains.swing_tilt * _free(times, state)
    if allow > 0.0:
        roll += allow * (tilt - roll)
        pitch += allow * (attitude.pitch - pitch)
        trunk = rotation(turn, pitch, roll - lean)
    ankle[0] = x - pelvis_x
    ankle[1] = side * (y - pelvis_y)
    ankle[2] = height - times.hip_height
    foot = product(trunk.T.copy(), rotation(-side * yaw, 0.0, 0.0))
    own = slice((1 - first) * count, (2 - first) * count)
    joints[own] = leg_joints(
        legs, 1 - first, turned_back(trunk, ankle), foot, before[own]
    )
    return joints


@compiled
def standing_joints(legs: Legs, numbers: Row) -> Array:
    """Return the reference joint angles of a walk's row, (2 n,) [rad]."""
    walk = numbers[0]
    return pose_joints(
        legs,
        walk.gains,
        walk.times,
        walk.goal,
        state_in(walk.state),
        attitude_in(walk.attitude),
        np.zeros(2),
        legs.start,
    )
