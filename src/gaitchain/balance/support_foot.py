"""From trunk and legs to the base relative to the support foot.

Position and velocity come from the encoders, the trunk's tilt and its turning from the
gyro (`attitude`); nothing here knows where the robot really is. Ours.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from gaitchain.balance.compiled import compiled
from gaitchain.balance.curves import clip
from gaitchain.balance.heel_off import toe_roll
from gaitchain.balance.leg_kinematics import (
    Legs,
    Posture,
    angular_momentum,
    com_from_pelvis,
    com_velocity,
    cross,
    link_speeds,
    posture,
)
from gaitchain.balance.packed_state import Walk
from gaitchain.balance.rotations import product, rotation, turned, turned_back
from gaitchain.balance.state import (
    SINGLE,
    Attitude,
    Foot,
    Pelvis,
    Planar,
    View,
)
from gaitchain.messages import GRAVITY, Array

TIPPED = 0.02
"""Tilt from which on a foot stands on its edge alone [rad]."""


@compiled
def lowest_corner(legs: Legs, foot: Array) -> float:
    """Return the height of a sole's lowest corner over its ankle, negative [m]."""
    along = min(legs.sole_rear * foot[2, 0], legs.sole_front * foot[2, 0])
    across = legs.sole_half_width * abs(foot[2, 1])
    return float(along - across - legs.ankle_height * foot[2, 2])


@compiled
def see_support(
    legs: Legs,
    attitude: Attitude,
    side: float,
    joints: Array,
    rates: Array,
    heel: float = 0.0,
) -> View:
    """Locate pelvis and CoM from the support foot.

    The foot need not stand still: where it tips over an edge of its sole, or turns on
    the ground, its ankle moves, and gyro and joints tell how fast.

    Args:
        legs: the robot.
        attitude: of the trunk.
        side: +1 left, -1 right foot supports.
        joints: (2 n,) [rad].
        rates: (2 n,) [rad/s].
        heel: planned pitch of the support foot about its toes; if it has one, its place
            is that of the level foot [rad].

    Returns:
        Positions and velocities in the step frame; velocities are over the ground.
    """
    support = 0 if side > 0 else 1
    level = rotation(0.0, attitude.pitch, attitude.roll)
    found = posture(legs, joints)
    spin = _spin(attitude, level)
    links, ankle_speeds = link_speeds(legs, found, rates, spin)
    trunk = np.empty(3)
    cross(spin, legs.trunk_com, trunk)
    speed = com_velocity(legs, links, trunk)
    turning = turned(level, angular_momentum(legs, found.coms, links, trunk))
    ankle = turned(level, found.ankles[support])
    foot = product(level, found.feet[support])
    if heel > 0.0:
        ankle -= _rolled(legs, foot)
    com = turned(level, com_from_pelvis(legs, found)) - ankle
    rolling = _rolling(legs, found, support, rates, spin, foot)
    speed = turned(level, speed - ankle_speeds[support] + rolling)
    yaw = math.atan2(foot[1, 0], foot[0, 0])
    c, s = math.cos(yaw), math.sin(yaw)
    height = com[2] + legs.ankle_height
    swing_foot = product(level, found.feet[1 - support])
    swing = turned(level, found.ankles[1 - support]) - ankle
    swing_yaw = math.atan2(swing_foot[1, 0], swing_foot[0, 0])
    swing_low = swing[2] + lowest_corner(legs, swing_foot)
    lean, pitch = foot[1, 2], foot[0, 2]
    if legs.ankle_rolls == 0:  # it stands on an edge, which may not point ahead
        pitch += legs.sole_taper * abs(lean)
        lean = 0.5 * (lean + swing_foot[1, 2])
    return View(
        Pelvis(
            c * com[0] + s * com[1],
            side * (c * com[1] - s * com[0]),
            c * speed[0] + s * speed[1],
            side * (c * speed[1] - s * speed[0]),
        ),
        Planar(
            (c * turning[1] - s * turning[0]) / height,
            -side * (c * turning[0] + s * turning[1]) / height,
        ),
        yaw,
        Planar(-lean, pitch),
        Foot(
            c * swing[0] + s * swing[1],
            side * (c * swing[1] - s * swing[0]),
            -side * (swing_yaw - yaw),
        ),
        -ankle[2] - swing_low,
        swing_low - lowest_corner(legs, foot),
    )


@compiled
def _rolled(legs: Legs, foot: Array) -> Array:
    """Return how far a foot's ankle moved as it pitched about its toes, (3,) [m].

    Args:
        legs: the robot.
        foot: (3, 3) its rotation in the level frame.
    """
    pitch = math.atan2(-foot[2, 0], math.hypot(foot[0, 0], foot[1, 0]))
    level = rotation(math.atan2(foot[1, 0], foot[0, 0]), 0.0, 0.0)
    return turned(level, toe_roll(legs, pitch))


class Touch(NamedTuple):
    """Whether the swing foot is on the ground."""

    sure: bool
    """Its sole is level with the other one, and bears load where that is measured."""
    likely: bool
    """One of the two."""


@compiled
def touched_down(legs: Legs, walk: Walk) -> Touch:
    """Return whether the swing foot is on the ground.

    A foot that is level with the other one may hang over lower ground, and one that
    bears load may be caught by a block's side: an early touch-down needs both.

    Args:
        legs: the robot.
        walk: the foot's clearance is measured, and the load where there are sensors.
    """
    gains, load = walk.gains, walk.load
    level = bool(walk.measured.clearance < gains.touch)
    borne = load.right if walk.state.side > 0.0 else load.left
    if math.isnan(borne):
        return Touch(level, level)
    bears = bool(borne > gains.touch_load * legs.mass * GRAVITY)
    return Touch(level and bears, level or bears)


@compiled
def _rolling(
    legs: Legs, found: Posture, support: int, rates: Array, spin: Array, foot: Array
) -> Array:
    """Return how fast a support foot's ankle moves over the ground it rolls on.

    v = w x (ankle - pivot): w from the gyro and the leg's joints; the pivot is the
    sole's edge or corner that bears the tipped foot, the middle of a flat sole.

    Args:
        legs: the robot.
        found: its posture.
        support: 0 left, 1 right.
        rates: (2 n,) joint velocities [rad/s].
        spin: (3,) angular velocity of the trunk, in its frame [rad/s].
        foot: (3, 3) rotation of the foot in the level frame.

    Returns:
        (3,) trunk frame [m/s].
    """
    count = found.axes.shape[1]
    turning = spin.copy()
    for j in range(count):
        for i in range(3):
            turning[i] += rates[support * count + j] * found.axes[support, j, i]
    ahead, left = clip(-foot[2, 0] / TIPPED, -1.0, 1.0), -foot[2, 1] / TIPPED
    pivot = np.empty(3)  # from the ankle, in the foot
    pivot[0] = 0.5 * (1.0 + ahead) * legs.sole_front
    pivot[0] += 0.5 * (1.0 - ahead) * legs.sole_rear
    pivot[1] = clip(left, -1.0, 1.0) * legs.sole_half_width
    pivot[2] = -legs.ankle_height
    arm, moved = -turned(found.feet[support], pivot), np.empty(3)
    cross(turning, arm, moved)
    return moved


@compiled
def _spin(attitude: Attitude, level: Array) -> Array:
    """Return the trunk's angular velocity in its own frame, (3,) [rad/s]."""
    cos, sin = math.cos(attitude.pitch), math.sin(attitude.pitch)
    spin = np.empty(3)  # about the axes of the level frame
    spin[0] = cos * attitude.roll_rate
    spin[1] = attitude.pitch_rate
    spin[2] = attitude.yaw_rate - sin * attitude.roll_rate
    return turned_back(level, spin)


@compiled
def note_slip(walk: Any) -> None:
    """Note how far the support foot has turned on the ground in single support.

    The gyro tells: a heading of the foot that changes is a foot that slips. Physics
    measured the usual slip over the same time; where a step ended is another question,
    for which the turn in double support counts, too (`walker.stride_gait`).

    Args:
        walk: its heading and slip are rewritten.
    """
    state = walk.state
    if state.phase != SINGLE:
        return
    heading = walk.attitude.yaw + walk.measured.foot_yaw
    if math.isnan(state.heading):
        state.heading = heading
    state.slip = abs(heading - state.heading)


@compiled
def measured_step(
    legs: Legs, joints: Array, side: float, heel: float = 0.0
) -> tuple[float, float, float]:
    """Measure a step by the legs while both feet stand: swing foot from support foot.

    Args:
        legs: the robot.
        joints: (2 n,) [rad].
        side: +1 if the left foot is the one stepped from.
        heel: planned pitch of that foot about its toes; if it has one, the step counts
            from the level foot [rad].

    Returns:
        Step ahead and to the left of the support foot [m], turn to the left [rad].
    """
    support = 0 if side > 0 else 1
    found = posture(legs, joints)
    foot, landed = found.feet[support], found.feet[1 - support]
    way = found.ankles[1 - support] - found.ankles[support]
    if heel > 0.0:
        pitched = product(landed.T.copy(), foot)
        way += turned(landed, _rolled(legs, pitched))
        yaw = math.atan2(pitched[1, 0], pitched[0, 0])
        foot = product(landed, rotation(yaw, 0.0, 0.0))
    made = turned_back(foot, way)
    relative = product(foot.T.copy(), landed)
    return made[0], made[1], math.atan2(relative[1, 0], relative[0, 0])
