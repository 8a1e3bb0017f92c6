"""Balance a motion that was planned in joint angles: the paper's walk. Compiled.

Only the ankles work: all other feedback needs the next step, which such a plan lacks.
"""

from typing import NamedTuple

import numpy as np

from gaitchain.balance.compiled import compiled
from gaitchain.balance.curves import beyond, clip
from gaitchain.balance.feedforward import LegLoad, holding_torques
from gaitchain.balance.gains import Gains
from gaitchain.balance.leg_kinematics import Legs, posture
from gaitchain.balance.state import Attitude, Planar, View
from gaitchain.balance.support_foot import see_support
from gaitchain.messages import GRAVITY, Array

_EXPECTED = 2.0  # dead zones: errors that the servos' sag explains
_PART = 0.4  # of the ankle gain: slow steps leave time


class Stance(NamedTuple):
    """How the robot stands in this control period."""

    attitude: Attitude
    """Orientation of the trunk."""
    omega: float
    """Natural frequency of the pendulum [1/s]."""
    side: float
    """+1 left, -1 right foot supports."""
    single: bool
    """Whether it supports alone."""


class JointMotion(NamedTuple):
    """The joints at one moment."""

    angles: Array
    """(2 n,) [rad]"""
    rates: Array
    """(2 n,) [rad/s]"""


class Correction(NamedTuple):
    """Where the robot is, and the servo targets that answer it."""

    view: View
    error: Planar
    """DCM, measured minus planned, step frame [m]."""
    targets: Array
    """(2 n,) [rad]"""


@compiled
def correct_ankles(
    legs: Legs,
    gains: Gains,
    stance: Stance,
    planned: JointMotion,
    measured: JointMotion,
) -> Correction:
    """Turn planned joint angles into servo targets that keep the balance.

    Where one foot carries, its ankle pushes the ZMP against a DCM error beyond what
    the sag of the servos explains. The poses were trained in physics with that sag, so
    it is not compensated.

    Args:
        legs: the robot.
        gains: of the balance.
        stance: which foot supports, and the trunk's attitude.
        planned: the joints by the plan.
        measured: the joints by the encoders.

    Returns:
        View, error and targets.
    """
    side = stance.side
    view = see_support(legs, stance.attitude, side, measured.angles, measured.rates)
    level = Attitude(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    plan = see_support(legs, level, side, planned.angles, planned.rates)
    error = Planar(
        view.com.x - plan.com.x + (view.com.vx - plan.com.vx) / stance.omega,
        view.com.y - plan.com.y + (view.com.vy - plan.com.vy) / stance.omega,
    )
    if not stance.single:
        return Correction(view, error, planned.angles)
    x = _PART * gains.ankle.x * beyond(error.x, _EXPECTED * gains.dead_zone.x)
    y = _PART * gains.ankle.y * beyond(error.y, _EXPECTED * gains.dead_zone.y)
    half = 0.5 * legs.sole_half_width
    front = min(legs.sole_front, -legs.sole_rear)
    x, y = clip(x, legs.sole_rear, front), clip(y, -half, half)
    leg, count = 0 if side > 0 else 1, legs.link_mass.shape[1]
    force, still = np.zeros(3), np.zeros((count, 3))
    force[2] = legs.mass * GRAVITY
    found = posture(legs, planned.angles)
    pushing, centred = LegLoad(force, x, side * y, 0.0), LegLoad(force, 0.0, 0.0, 0.0)
    shifted = holding_torques(legs, found, leg, pushing, still)
    upright = holding_torques(legs, found, leg, centred, still)
    lead, own = np.zeros(2 * count), slice(leg * count, (leg + 1) * count)
    lead[own] = (shifted - upright) / legs.stiffness[own]
    return Correction(view, error, planned.angles + lead)
