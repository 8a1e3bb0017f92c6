"""Servo targets that carry planned joint angles, for robots read from a file. Ours.

A position servo sags under its load. The poses of a robot of boxes were trained with
that sag and keep it. A file's servos can be anything, so there the targets lead the
plan by the torques that it needs, as for strides (`feedforward`). What the legs carry
follows from the planned motion of the CoM, p = c - z c'' / g, between the feet as long
as both are on the ground. Compiled.
"""

from typing import NamedTuple

import numpy as np

from gaitchain.balance.compiled import compiled
from gaitchain.balance.curves import clip
from gaitchain.balance.feedforward import LegLoad, holding_torques, lead, rates_of
from gaitchain.balance.leg_kinematics import Legs, com_from_pelvis, legs_of, posture
from gaitchain.messages import GRAVITY, Array
from gaitchain.robot.robot import Robot

_SMOOTH = 0.5  # of a new acceleration in the filtered one
_LIFTED = 0.01  # of the leg: a foot this far up carries nothing
_INSIDE = 0.8  # of the sole: where the ankles push


class PlannedMotion(NamedTuple):
    """How the plan has moved so far; changed in place."""

    joints: Array
    """(2 n,) one control period ago [rad]."""
    com: Array
    """(3, 3) CoM from the support ankle one and two periods ago [m], and its
    acceleration [m/s^2]."""
    support: Array
    """(1,) leg that supported, 0 left, 1 right."""


class KeyposeLead:
    """Turns planned joint angles into servo targets, one control period at a time."""

    def __init__(self, robot: Robot, stand: Array, period_s: float) -> None:
        """Start from a robot that stands still.

        Args:
            robot: the robot.
            stand: (2 n,) its standing pose [rad].
            period_s: control period [s].
        """
        self._legs = None if robot.of_boxes else legs_of(robot)
        self._period_s = period_s
        if self._legs is not None:
            found = posture(self._legs, stand)
            at = com_from_pelvis(self._legs, found) - found.ankles[0]
            com = np.stack([at, at, np.zeros(3)])
            self._motion = PlannedMotion(np.array(stand), com, np.zeros(1))

    def targets(
        self, planned: Array, *, left: bool, shift: tuple[float, float] = (0.0, 0.0)
    ) -> Array:
        """Return the servo targets of one control period, (2 n,) [rad].

        Args:
            planned: (2 n,) joint angles [rad].
            left: whether the left leg is the support leg.
            shift: of the ZMP for balance, ahead and to the left [m].
        """
        if self._legs is None:
            return planned
        support = 0 if left else 1
        return carried(
            self._legs, self._motion, planned, support, np.array(shift), self._period_s
        )


@compiled
def carried(
    legs: Legs,
    motion: PlannedMotion,
    planned: Array,
    support: int,
    shift: Array,
    period_s: float,
) -> Array:
    """Lead planned joint angles by what they carry; note how they move.

    Args:
        legs: the robot.
        motion: of the plan; rewritten.
        planned: (2 n,) joint angles of this control period [rad].
        support: 0 left, 1 right leg supports.
        shift: (2,) of the ZMP for balance [m].
        period_s: control period [s].

    Returns:
        (2 n,) servo targets [rad].
    """
    found = posture(legs, planned)
    own, other = found.ankles[support], found.ankles[1 - support]
    com, way = com_from_pelvis(legs, found) - own, other - own
    if motion.support[0] != support:  # both feet are on the ground
        motion.support[0] = support
        motion.com[:2] += way
    note_com(motion, com, period_s)
    zmp, force = np.empty(3), np.empty(3)
    height = com[2] + legs.ankle_height
    for i in range(2):
        zmp[i] = com[i] - height * motion.com[2, i] / GRAVITY + shift[i]
        force[i] = legs.mass * motion.com[2, i]
    force[2] = legs.mass * GRAVITY
    apart = way[0] * way[0] + way[1] * way[1]
    share = clip((zmp[0] * way[0] + zmp[1] * way[1]) / apart, 0.0, 1.0)
    share *= clip(1.0 - way[2] / (_LIFTED * legs.leg), 0.0, 1.0)
    x, y = in_sole(legs, zmp[0] - share * way[0], zmp[1] - share * way[1])
    count, still = legs.link_mass.shape[1], np.zeros((legs.link_mass.shape[1], 3))
    torques = np.empty(2 * count)
    for leg in range(2):
        part = 1.0 - share if leg == support else share
        load = LegLoad(part * force, x, y, 0.0)
        own_joints = slice(leg * count, (leg + 1) * count)
        torques[own_joints] = holding_torques(legs, found, leg, load, still)
    rates = rates_of(planned, motion.joints, period_s)
    targets = lead(legs, planned, rates, torques)
    motion.joints[:] = planned
    return targets


@compiled
def note_com(motion: PlannedMotion, com: Array, period_s: float) -> None:
    """Take the CoM of this control period, (3,) from the support ankle [m]."""
    latest, before, acceleration = motion.com[0], motion.com[1], motion.com[2]
    for i in range(3):
        new = (com[i] - 2.0 * latest[i] + before[i]) / period_s**2
        acceleration[i] += _SMOOTH * (new - acceleration[i])
        before[i], latest[i] = latest[i], com[i]


@compiled
def in_sole(legs: Legs, x: float, y: float) -> tuple[float, float]:
    """Return the point of the sole nearest to one, less a margin [m]."""
    half = _INSIDE * legs.sole_half_width
    return (
        clip(x, _INSIDE * legs.sole_rear, _INSIDE * legs.sole_front),
        clip(y, -half, half),
    )
