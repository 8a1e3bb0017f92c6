"""From standing to the first step, and from the last step to standing.

What a control period computes is compiled.
"""

import math

import numpy as np

from gaitchain.balance.compiled import compiled
from gaitchain.balance.gains import Gains, clip
from gaitchain.balance.leg_kinematics import Legs, com_from_pelvis, posture
from gaitchain.balance.packed_state import Row
from gaitchain.balance.pendulum import dcm_of, double_support_map, steady_lead
from gaitchain.balance.reference_pose import hermite
from gaitchain.balance.state import (
    NOT_YET,
    SHIFT,
    STAND,
    UPRIGHT,
    Foot,
    GaitState,
    Memory,
    Pelvis,
    Planar,
    StepTimes,
)
from gaitchain.balance.step_plan import beyond
from gaitchain.messages import Array

_SETTLING = 0.6  # how hard the ZMP pushes the DCM to the middle when stopping


def standing_state(legs: Legs, gains: Gains) -> GaitState:
    """Return the state of a robot that stands with its feet side by side."""
    width, ahead = legs.hip_width, gains.foot_zmp.x
    beside = Foot(0.0, -width, 0.0)
    return GaitState(
        phase=STAND,
        side=1.0,
        time=0.0,
        pelvis=Pelvis(ahead, -0.5 * width, 0.0, 0.0),
        pelvis_yaw=0.0,
        lift_off=beside,
        landing=beside,
        zmp=Planar(ahead, -0.5 * width),
        first_zmp=NOT_YET,
        error=Planar(0.0, 0.0),
        rate=1.0,
        holds=0.0,
        lean=UPRIGHT,
        worst=0.0,
        caution=0.0,
    )


def memory_at_rest(legs: Legs, joints: Array) -> Memory:
    """Return the memory of a walk whose reference, (2 n,) [rad], does not move."""
    found = posture(legs, joints)
    com = com_from_pelvis(legs, found)
    links = np.zeros((2, 3, *found.coms.shape[1:]))
    links[:, 0] = found.coms
    return Memory(
        joints=joints,
        next_joints=joints.copy(),
        links=links,
        com=np.array([com[0], com[1], 0.0, 0.0]),
        reaction=np.zeros(2),
        offset=np.zeros(2),
        zmp=np.zeros(2),
        load=np.full(2, math.nan),
    )


@compiled
def first_dcm(legs: Legs, gains: Gains, times: StepTimes) -> float:
    """Return the DCM beside the support ankle with which stepping in place begins."""
    growth, _, new = double_support_map(times.omega, times.step - times.single)
    growth *= math.exp(times.omega * times.single)
    between = legs.hip_width + 2.0 * gains.foot_zmp.y
    return gains.foot_zmp.y - steady_lead(between, new, growth, -1.0)


@compiled
def shift_weight(
    legs: Legs, gains: Gains, times: StepTimes, state: GaitState, pelvis: Pelvis
) -> tuple[Planar, Pelvis]:
    """Shift the weight from between the feet to where the first step begins.

    A cubic from the pelvis now to one that moves with `first_dcm`; the ZMP follows.
    """
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
def topples(legs: Legs, numbers: Row) -> tuple[bool, bool]:
    """Return whether no ZMP under both feet can hold the robot, and which foot goes.

    The DCM that counts is the robot's own, where it was pushed.

    Args:
        legs: the robot.
        numbers: (1,) row of the walk.

    Returns:
        Whether it topples; whether the foot that is now the swing foot must step.
    """
    walk = numbers[0]
    gains, state = walk.gains, walk.state
    error, zone, omega = state.error, gains.far_zone, walk.times.omega
    dcm = dcm_of(state.pelvis, omega)
    x, y = dcm.x + beyond(error.x, zone.x), dcm.y + beyond(error.y, zone.y)
    margin, other = gains.sole_margin, state.lift_off
    ahead = x > max(0.0, other.x) + legs.sole_front - margin
    behind = x < min(0.0, other.x) + legs.sole_rear + margin
    # A weight shift brings the DCM over the first foot; slow steps, near its middle.
    beside = legs.sole_half_width - margin if state.phase == SHIFT else 0.0
    inner, outer = y > beside, y < other.y - beside
    return ahead or behind or inner or outer, outer or (not inner and y > 0.5 * other.y)


@compiled
def settling_zmp(
    legs: Legs, gains: Gains, times: StepTimes, pelvis: Pelvis, other: Foot
) -> Planar:
    """Return the ZMP that brings the DCM to rest between the feet."""
    x, y = dcm_of(pelvis, times.omega)
    middle_x, middle_y = 0.5 * other.x + gains.foot_zmp.x, 0.5 * other.y
    x += _SETTLING * (x - middle_x)
    y += _SETTLING * (y - middle_y)
    margin = gains.sole_margin
    return Planar(
        clip(
            x,
            min(0.0, other.x) + legs.sole_rear + margin,
            max(0.0, other.x) + legs.sole_front - margin,
        ),
        clip(y, other.y, 0.0),
    )
