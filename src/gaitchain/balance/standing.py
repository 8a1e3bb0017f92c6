"""From standing to the first step, and from the last step to standing.

Compiled, but for what begins a walk.
"""

import math
from typing import NamedTuple

import numpy as np

from gaitchain.balance.compiled import compiled
from gaitchain.balance.curves import beyond, clip, hermite
from gaitchain.balance.gains import Gains
from gaitchain.balance.leg_kinematics import Legs, com_from_pelvis, posture
from gaitchain.balance.packed_state import Walk
from gaitchain.balance.pendulum import dcm_of, double_support_map, swaying_lead
from gaitchain.balance.state import (
    SHIFT,
    Foot,
    GaitState,
    Memory,
    Pelvis,
    Planar,
    StepTimes,
)
from gaitchain.messages import Array

_SETTLING = 0.6  # how hard the ZMP pushes the DCM to the middle when stopping


def standing_state(legs: Legs, gains: Gains) -> GaitState:
    """Return the state of a robot that stands with its feet side by side."""
    ahead, middle = gains.foot_zmp.x, -0.5 * legs.hip_width
    beside = Foot(0.0, -legs.hip_width, 0.0)
    return GaitState(
        pelvis=Pelvis(ahead, middle),
        lift_off=beside,
        landing=beside,
        zmp=Planar(ahead, middle),
    )


def memory_at_rest(legs: Legs, joints: Array) -> tuple[Memory, Pelvis]:
    """Return the memory of a reference, (2 n,) [rad], that does not move, and its CoM.

    The CoM is given from the pelvis.
    """
    found = posture(legs, joints)
    com = com_from_pelvis(legs, found)
    links = np.zeros((2, 3, *found.coms.shape[1:]))
    links[:, 0] = found.coms
    still = np.zeros_like(joints)
    memory = Memory(joints, joints.copy(), links, still, still.copy())
    return memory, Pelvis(com[0], com[1])


@compiled
def first_dcm(legs: Legs, gains: Gains, times: StepTimes) -> float:
    """Return the DCM beside the support ankle with which stepping in place begins."""
    growth, _, new = double_support_map(times.omega, times.step - times.single)
    growth *= math.exp(times.omega * times.single)
    between = legs.hip_width + 2.0 * gains.foot_zmp.y
    return gains.foot_zmp.y - swaying_lead(between, between, new, growth)


@compiled
def shift_weight(legs: Legs, walk: Walk, pelvis: Pelvis) -> tuple[Planar, Pelvis]:
    """Shift the weight from between the feet to where the first step begins.

    A cubic from the pelvis now to one that moves with `first_dcm`.

    Args:
        legs: the robot.
        walk: in its weight shift.
        pelvis: reference now, step frame.

    Returns:
        ZMP and pelvis one control period later.
    """
    gains, times, state = walk.gains, walk.times, walk.state
    left = max(times.shift - state.time, times.period)
    dcm = first_dcm(legs, gains, times)
    middle = 0.5 * state.lift_off.y
    end = 0.5 * (dcm + middle)
    y, vy, ay = hermite(
        pelvis.y, pelvis.vy, end, times.omega * (dcm - end), left, times.period
    )
    x, vx, ax = hermite(pelvis.x, pelvis.vx, gains.foot_zmp.x, 0.0, left, times.period)
    square = times.omega**2
    return Planar(x - ax / square, y - ay / square), Pelvis(x, y, vx, vy)


@compiled
def ankles_x(other: Foot, y: float) -> float:
    """Return the x of the line from ankle to ankle at a place beside it [m].

    Where one foot is ahead of the other, what both can bear ends at slanted lines, from
    heel to heel and from toe to toe: a rectangle around both feet is too large.

    Args:
        other: the foot that is not the origin, step frame.
        y: of the place, step frame; beyond the feet, the nearer ankle's counts [m].
    """
    return other.x * clip(y / other.y, 0.0, 1.0)


class StandingBalance(NamedTuple):
    """Whether a standing robot can keep its balance, and by which step if not."""

    is_capturable: bool
    """Some ZMP under both feet brings the DCM to rest, without a step."""
    swing_steps: bool
    """Else the foot that is now the swing foot must step, not the support foot."""


@compiled
def standing_balance(legs: Legs, walk: Walk) -> StandingBalance:
    """Judge whether the ZMP can hold the DCM between the feet, or a foot must step.

    The DCM that counts is the reference's plus the error beyond `far_zone`. Beside both
    feet the one on that side steps, else the one that is further from the DCM: over the
    nearer one, the other has the time to land.

    Args:
        legs: the robot.
        walk: with both feet on the ground.
    """
    gains, state = walk.gains, walk.state
    error, zone, omega = state.error, gains.far_zone, walk.times.omega
    dcm = dcm_of(state.pelvis, omega)
    x, y = dcm.x + beyond(error.x, zone.x), dcm.y + beyond(error.y, zone.y)
    margin, other = gains.sole_margin, state.lift_off
    between = ankles_x(other, y)
    ahead = x > between + legs.stand_front - margin
    behind = x < between + legs.stand_rear + margin
    # A weight shift brings the DCM over the first foot; slow steps, near its middle.
    beside = legs.sole_half_width - margin if state.phase == SHIFT else 0.0
    inner, outer = y > beside, y < other.y - beside
    nearer = x * other.x + y * other.y < 0.5 * (other.x**2 + other.y**2)
    return StandingBalance(
        not (ahead or behind or inner or outer), outer or (not inner and nearer)
    )


@compiled
def settling_zmp(legs: Legs, walk: Walk, pelvis: Pelvis) -> Planar:
    """Return the ZMP that brings the DCM to rest between the feet.

    Arguments are those of `shift_weight`.
    """
    gains, other = walk.gains, walk.state.lift_off
    x, y = dcm_of(pelvis, walk.times.omega)
    middle_x, middle_y = 0.5 * other.x + gains.foot_zmp.x, 0.5 * other.y
    x += _SETTLING * (x - middle_x)
    y += _SETTLING * (y - middle_y)
    y = clip(y, other.y, 0.0)
    between = ankles_x(other, y)
    rearmost = between + legs.stand_rear + gains.sole_margin
    foremost = between + legs.stand_front - gains.sole_margin
    return Planar(clip(x, rearmost, foremost), y)
