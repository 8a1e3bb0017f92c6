"""Where a step shall end: ZMP and DCM over the landing foot. Compiled."""

import math
from typing import NamedTuple

from gaitchain.balance.compiled import compiled
from gaitchain.balance.gains import Gains
from gaitchain.balance.leg_kinematics import Legs
from gaitchain.balance.pendulum import double_support_map, steady_lead
from gaitchain.balance.state import Foot, Planar, StepTimes
from gaitchain.gait.step_target import StepTarget


class StepEnd(NamedTuple):
    """What the end of a step shall be, along one axis, seen from the landing foot."""

    zmp: float
    """ZMP from the ankle [m]."""
    dcm: float
    """DCM from the ankle [m]."""


@compiled
def step_ends(
    goal: StepTarget, gains: Gains, legs: Legs, times: StepTimes
) -> tuple[StepEnd, StepEnd]:
    """Find the ZMP and DCM over the landing foot that a steady walk would have.

    A step that stops ends with both between the feet.

    Returns:
        Along x and y of this step's frame.
    """
    growth, _, new = double_support_map(times.omega, times.step - times.single)
    growth *= math.exp(times.omega * times.single)
    if goal.stops > 0.0:
        middle = 0.5 * goal.width
        return StepEnd(gains.foot_zmp.x, gains.foot_zmp.x), StepEnd(middle, middle)
    # Of the next foot, whose frame is mirrored: its inside is at positive y here.
    zmp_x, zmp_y = gains.foot_zmp.x, -gains.foot_zmp.y
    dcm_x = zmp_x + steady_lead(goal.length, new, growth, 1.0)
    between = legs.hip_width + 2.0 * gains.foot_zmp.y
    dcm_y = zmp_y + steady_lead(between, new, growth, -1.0)
    c, s = math.cos(goal.turn), math.sin(goal.turn)
    # The landing foot is turned outward, that is clockwise here.
    return (
        StepEnd(c * zmp_x + s * zmp_y, c * dcm_x + s * dcm_y),
        StepEnd(c * zmp_y - s * zmp_x, c * dcm_y - s * dcm_x),
    )


@compiled
def landing_zmp(gains: Gains, goal: StepTarget, landing: Foot) -> Planar:
    """Return where the ZMP arrives at the end of double support, step frame [m]."""
    if goal.stops > 0.0:
        return Planar(landing.x + gains.foot_zmp.x, 0.5 * landing.y)
    c, s = math.cos(landing.yaw), math.sin(landing.yaw)
    ahead, inward = gains.foot_zmp.x, -gains.foot_zmp.y
    return Planar(
        landing.x + c * ahead + s * inward, landing.y + c * inward - s * ahead
    )
