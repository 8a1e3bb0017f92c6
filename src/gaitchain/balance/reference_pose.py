"""The reference pose: where pelvis and feet are, and the joint angles of that.

The swing foot goes from lift-off over kp_2 to its landing in two cubic Hermite
segments, as the chain's key poses ask. Compiled.
"""

from typing import Any

import numpy as np

from gaitchain.balance.compiled import compiled
from gaitchain.balance.crouch import hips_above_ankles
from gaitchain.balance.curves import clip, hermite
from gaitchain.balance.gains import Gains
from gaitchain.balance.heel_off import heel_lift, pitched
from gaitchain.balance.leg_ik import leg_joints
from gaitchain.balance.leg_kinematics import Legs
from gaitchain.balance.packed_state import Row, Walk
from gaitchain.balance.rotations import product, rotation, turned_back
from gaitchain.balance.state import DOUBLE, SETTLE, SHIFT, SINGLE
from gaitchain.messages import Array

_LEAVING = 0.2  # part of single support
_LOWERING = 3.0  # lifts per single support that a late foot is lowered by
_CROSSING = 2.0  # sideways over ahead: how the foot goes around the other one's corner


@compiled
def innermost(legs: Legs, gains: Gains, x: float) -> float:
    """Return how far in the swing ankle may be, y in the step frame [m].

    Beside the other foot it keeps its distance; beyond the other one's toes or heel, a
    whole sole away, it may cross.

    Args:
        legs: the robot.
        gains: of the balance.
        x: of the swing ankle [m].
    """
    past = max(abs(x) - (legs.sole_front - legs.sole_rear), 0.0)
    return min(_CROSSING * past - gains.narrowest, gains.across)


@compiled
def swing_foot(legs: Legs, walk: Walk) -> tuple[float, float, float, float]:
    """Return the swing foot at the end of this period: x, y, height, outward turn.

    Two cubics joined at kp_2, as parts of the way from lift-off to the landing; where
    the foot crosses the other one, it goes around it.
    """
    target, times, state = walk.target, walk.times, walk.state
    if state.phase != SINGLE:
        foot = state.lift_off if state.phase != DOUBLE else state.landing
        return foot.x, foot.y, 0.0, foot.yaw
    phase = clip(state.time / times.single, 0.0, 1.0)
    top = times.rise / times.single
    share, rate = target.share, target.share_rate
    if phase < top:
        part, _, _ = hermite(0.0, 0.0, share, rate, top, phase)
        height, _, _ = hermite(0.0, 0.0, 1.0, 0.0, top, phase)
    else:
        rest, since = 1.0 - top, phase - top
        part, _, _ = hermite(share, rate, 1.0, target.landing_rate, rest, since)
        height, _, _ = hermite(1.0, 0.0, 0.0, -target.fall_rate, rest, since)
    start, end = state.lift_off, state.landing
    late = max(state.time / times.single - 1.0, 0.0)
    x = start.x + part * (end.x - start.x)
    y = start.y + part * (end.y - start.y)
    # A foot that stood nearer than allowed leaves from there.
    nearer = max(start.y - innermost(legs, walk.gains, start.x), 0.0)
    return (
        x,
        min(y, innermost(legs, walk.gains, x) + (1.0 - part) * nearer),
        target.lift * (height - _LOWERING * late),
        start.yaw + part * (end.yaw - start.yaw),
    )


@compiled
def _unloaded(walk: Walk) -> float:
    """Part of the swing foot's load that is gone: it leaves and comes smoothly."""
    times, state = walk.times, walk.state
    if state.phase == SINGLE:
        return min(state.time / (_LEAVING * times.single), 1.0)
    if state.phase == DOUBLE:
        return clip((times.step - state.time) / (times.step - times.single), 0.0, 1.0)
    return 0.0


@compiled
def _pelvis(walk: Any) -> tuple[float, float]:
    """Return where the pelvis is from the support foot: ahead, to the left [m].

    In single support it moves with the swing foot's lead over a steady way.
    """
    state, offset = walk.state, walk.com_offset
    x, y = state.pelvis.x - offset.x, state.pelvis.y - state.side * offset.y
    if state.phase == SINGLE:
        phase = clip(state.time / walk.times.single, 0.0, 1.0)
        ahead = phase * phase * (3.0 - 2.0 * phase) - phase
        way = walk.gains.counter_swing * ahead
        x -= way * (state.landing.x - state.lift_off.x)
        y -= way * (state.landing.y - state.lift_off.y)
    return x, y


@compiled
def _tilt_held(walk: Any) -> tuple[float, float]:
    """Return the roll and pitch by which the legs turn the trunk back [rad]."""
    held = walk.gains.trunk
    if walk.state.phase in (SETTLE, SHIFT):
        held *= walk.gains.settled_trunk
    return -held * walk.attitude.roll, -held * walk.attitude.pitch


@compiled
def pose_joints(legs: Legs, walk: Any, before: Array) -> Array:
    """Return the reference joint angles, (2 n,) [rad].

    The support leg carries the pelvis where the pendulum is, less the learned CoM
    offset, and turns it against the trunk's tilt; the swing leg aims at its place on
    level ground. The hind foot, which is about to leave the ground or just has, lifts
    its heel where its leg would not reach.

    Args:
        legs: the robot.
        walk: its attitude, and its state at the end of this period; its `heel` is
            rewritten.
        before: (2 n,) where the inverse kinematics begins [rad].
    """
    gains, state, attitude = walk.gains, walk.state, walk.attitude
    x, y, lifted, yaw = swing_foot(legs, walk)
    side = state.side
    turn = -side * state.pelvis_yaw
    pelvis_x, pelvis_y = _pelvis(walk)
    roll, pitch = _tilt_held(walk)
    count = before.shape[0] // 2
    joints = np.empty(2 * count)
    first = 0 if side > 0 else 1
    own = slice(first * count, (first + 1) * count)
    trunk = rotation(turn, pitch, roll)
    ankle = np.empty(3)
    height = hips_above_ankles(walk) - state.sag
    ankle[0], ankle[1], ankle[2] = -pelvis_x, -side * pelvis_y, -height
    at, foot = turned_back(trunk, ankle), trunk.T.copy()
    state.heel = 0.0
    if state.phase == DOUBLE:
        state.heel = heel_lift(legs, first, at, foot, before[own], gains.stretched)
        at, foot = pitched(legs, at, foot, state.heel)
    joints[own] = leg_joints(legs, first, at, foot, before[own])
    allow = gains.swing_tilt * _unloaded(walk)
    if allow > 0.0:
        roll += allow * (attitude.roll - roll)
        pitch += allow * (attitude.pitch - pitch)
        trunk = rotation(turn, pitch, roll)
    ankle[0] = x - pelvis_x
    ankle[1] = side * (y - pelvis_y)
    ankle[2] = lifted - height
    at = turned_back(trunk, ankle)
    foot = product(trunk.T.copy(), rotation(-side * yaw, 0.0, 0.0))
    own = slice((1 - first) * count, (2 - first) * count)
    if state.phase == SINGLE:
        pitch = heel_lift(legs, 1 - first, at, foot, before[own], gains.stretched)
        at, foot = pitched(legs, at, foot, pitch)
    joints[own] = leg_joints(legs, 1 - first, at, foot, before[own])
    return joints


@compiled
def standing_joints(legs: Legs, numbers: Row) -> Array:
    """Return the reference joint angles of a walk's row, (2 n,) [rad]."""
    # `legs.start` is read-only: another type, for which all would be compiled again.
    return pose_joints(legs, numbers[0], legs.start.copy())
