"""Hold a motion that was planned in joint angles: the paper's walk, with balance.

Of the balance only what needs no other step: the ankles. Compiled.
"""

from typing import NamedTuple

import numpy as np

from gaitchain.balance.compiled import compiled
from gaitchain.balance.feedforward import load_torques
from gaitchain.balance.gains import Gains, clip
from gaitchain.balance.leg_kinematics import Legs, posture
from gaitchain.balance.state import Attitude, Planar, View
from gaitchain.balance.step_plan import beyond
from gaitchain.balance.support_foot import see_support
from gaitchain.messages import GRAVITY, Array

_EXPECTED = 2.0  # dead zones: errors that the servos' sag explains
_PART = 0.4  # of the ankle gain: slow steps leave time


class Hold(NamedTuple):
    """What the sensors said, and what the servos are told."""

    view: View
    error: Planar
    """DCM, measured minus planned, step frame [m]."""
    targets: Array
    """(2 n,) [rad]"""


@compiled
def hold(
    legs: Legs,
    gains: Gains,
    omega: float,
    period_s: float,
    attitude: Attitude,
    side: float,
    single: bool,
    planned: Array,
    before: Array,
    joints: Array,
    rates: Array,
) -> Hold:
    """Turn planned joint angles into servo targets that keep the balance.

    Where one foot carries, its ankle pushes the ZMP against a DCM error beyond what
    the sag of the servos explains. The poses were trained in physics with that sag, so
    it is not compensated.

    Args:
        legs: the robot.
        gains: of the balance.
        omega: of the pendulum [1/s].
        period_s: control period [s].
        attitude: of the trunk.
        side: +1 left, -1 right foot supports.
        single: whether it supports alone.
        planned: (2 n,) joint angles [rad].
        before: (2 n,) the same one control period ago [rad].
        joints: (2 n,) measured [rad].
        rates: (2 n,) measured [rad/s].

    Returns:
        View, error and targets.
    """
    view = see_support(legs, attitude, side, joints, rates)
    level = Attitude(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    plan = see_support(legs, level, side, planned, (planned - before) / period_s)
    error = Planar(
        view.com.x - plan.com.x + (view.com.vx - plan.com.vx) / omega,
        view.com.y - plan.com.y + (view.com.vy - plan.com.vy) / omega,
    )
    if not single:
        return Hold(view, error, planned)
    push = Planar(
        _PART * gains.ankle.x * beyond(error.x, _EXPECTED * gains.dead_zone.x),
        _PART * gains.ankle.y * beyond(error.y, _EXPECTED * gains.dead_zone.y),
    )
    half = 0.5 * legs.sole_half_width
    push = Planar(
        clip(push.x, legs.sole_rear, -legs.sole_rear), clip(push.y, -half, half)
    )
    force = np.zeros(3)
    force[2] = legs.mass * GRAVITY
    found, middle = posture(legs, planned), Planar(0.0, 0.0)
    still = np.zeros((2, 3, legs.link_mass.shape[1], 3))
    shifted = load_torques(legs, found, side, force, 1.0, push, middle, still, 0.0)
    centred = load_torques(legs, found, side, force, 1.0, middle, middle, still, 0.0)
    return Hold(view, error, planned + (shifted - centred) / legs.stiffness)
