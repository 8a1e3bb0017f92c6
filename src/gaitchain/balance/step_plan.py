"""Keep the balance: ankle, next step's place, next step's time. Compiled, ours.

The robot is off by e, the DCM measured minus the DCM of the reference.

1. The ankles move the ZMP against e, inside the sole (`forces.ankle_shift`).
2. The reference follows the robot (`follow`), beyond a dead zone that is left to stiff
   servos; `plan_single` then finds the ZMP that still ends the step as the chain wants
   it, near the one it began with.
3. Where that does not do, the foot lands elsewhere.
4. Where that is out of reach, the step is hurried or held back.
5. A robot that leans over its support foot is held there (`lean`).

A textbook step adjustment, e exp(w t), acts on what stiff ankles already pull back and
destabilises the robot; hence the zones.
"""

import math
from typing import NamedTuple

from gaitchain.balance.compiled import compiled
from gaitchain.balance.gains import Gains, clip
from gaitchain.balance.leg_kinematics import Legs
from gaitchain.balance.pendulum import dcm_of, double_support_map
from gaitchain.balance.state import NOT_YET, Foot, Pelvis, Planar, StepTimes
from gaitchain.balance.terminal_dcm import StepEnd, step_ends
from gaitchain.gait.step_target import StepTarget

_STEADY = 1e-4  # m: a DCM this close to the ZMP stays there
_STILL = 0.02  # rate of the time of a step that waits
_RETURNING = 0.005  # m: further than this inside the ZMP, the DCM moves back inward


@compiled
def beyond(error: float, zone: float) -> float:
    """Return what of an error lies beyond a dead zone."""
    if error > zone:
        return error - zone
    if error < -zone:
        return error + zone
    return 0.0


@compiled
def follow(
    pelvis: Pelvis,
    error: Planar,
    gains: Gains,
    omega: float,
    period_s: float,
    holds: float,
) -> Pelvis:
    """Move the reference towards the robot: its speed, so that it never jumps.

    A robot that is held on one foot is followed sideways without a dead zone.

    Returns:
        The pendulum with v increased by omega times the error taken over.
    """
    step = omega * period_s
    dx = gains.follow.x * beyond(error.x, gains.dead_zone.x)
    dx += gains.far_follow.x * beyond(error.x, gains.far_zone.x)
    dy = gains.follow.y * beyond(error.y, gains.dead_zone.y)
    dy += gains.far_follow.y * beyond(error.y, gains.far_zone.y)
    if holds > 0.0:
        dy = gains.hold_follow * error.y
    return Pelvis(pelvis.x, pelvis.y, pelvis.vx + step * dx, pelvis.vy + step * dy)


class StepPlan(NamedTuple):
    """The plan for the rest of a single support."""

    zmp: Planar
    """ZMP until touch-down, step frame [m]."""
    landing: Foot
    rate: float
    """Of the step's time."""


@compiled
def plan_single(
    legs: Legs,
    gains: Gains,
    times: StepTimes,
    goal: StepTarget,
    pelvis: Pelvis,
    landing: Foot,
    first_zmp: Planar,
    time_s: float,
) -> StepPlan:
    """Find the ZMP, the landing and the time that end the step as the chain wants it.

    The DCM at the end of double support, xi_4 = A (p + (xi - p) E) + k_a p + k_b p_4
    with E = exp(w t) over the rest of single support, is to be at the landing foot plus
    `step_ends`. That is solved for p; where p leaves its bounds, for the landing; where
    that is out of reach, for t.

    Args:
        legs: the robot.
        gains: of the balance.
        times: the rhythm.
        goal: the chain's choice.
        pelvis: reference now, step frame.
        landing: where the foot is to land so far.
        first_zmp: plan of the step's first tick; NaN while it has none.
        time_s: since lift-off.

    Returns:
        The plan.
    """
    left = max(times.single - time_s, 0.0)
    dcm = dcm_of(pelvis, times.omega)
    axis_x, axis_y = _plan_axes(legs, gains, times, goal, dcm, first_zmp, left)
    zmp = Planar(axis_x.zmp, axis_y.zmp)
    if left <= gains.fixed_s:
        return StepPlan(zmp, landing, 1.0)
    rate = _hurry(gains, goal, axis_x, axis_y, times.omega, left)
    x = _landing(axis_x, math.exp(times.omega * left / rate))
    y = _landing(axis_y, math.exp(times.omega * left / rate))
    reach, speed = gains.landing_reach, gains.landing_speed
    x = clip(x, goal.length - reach.x, goal.length + reach.x)
    y = clip(y, -goal.width - reach.y, -gains.narrowest)
    far_x, far_y = speed.x * times.period, speed.y * times.period
    return StepPlan(
        zmp,
        Foot(
            landing.x + clip(x - landing.x, -far_x, far_x),
            landing.y + clip(y - landing.y, -far_y, far_y),
            landing.yaw,
        ),
        rate,
    )


@compiled
def plan_held(
    legs: Legs,
    gains: Gains,
    times: StepTimes,
    goal: StepTarget,
    pelvis: Pelvis,
    landing: Foot,
    time_s: float,
) -> StepPlan:
    """Hold the robot on its support foot: ZMP at the outer edge, swing foot up.

    Ahead, the ZMP is where the step could still end long after.
    """
    dcm = dcm_of(pelvis, times.omega)
    left = max(times.single - time_s, gains.fixed_s) / _STILL
    ahead, _ = _plan_axes(legs, gains, times, goal, dcm, NOT_YET, left)
    edge = legs.sole_half_width - gains.sole_margin
    rate = _STILL if time_s > times.rise else 1.0
    return StepPlan(Planar(ahead.zmp, edge), landing, rate)


class _Axis(NamedTuple):
    """One axis of the plan, and what its landing follows from."""

    zmp: float
    dcm: float
    aim: float
    growth: float
    old: float
    new: float
    end: StepEnd


@compiled
def _plan_axes(
    legs: Legs,
    gains: Gains,
    times: StepTimes,
    goal: StepTarget,
    dcm: Planar,
    first_zmp: Planar,
    left: float,
) -> tuple[_Axis, _Axis]:
    """Plan both axes from a DCM."""
    end_x, end_y = step_ends(goal, gains, legs, times)
    reach, half = gains.zmp_reach, legs.sole_half_width
    along = _zmp_bounds(legs.sole_rear, legs.sole_front, gains, reach.x, first_zmp.x)
    across = _zmp_bounds(-half, half, gains, reach.y, first_zmp.y)
    return (
        _plan_axis(times, dcm.x, left, goal.length, end_x, along),
        _plan_axis(times, dcm.y, left, -goal.width, end_y, across),
    )


@compiled
def _zmp_bounds(
    low: float, high: float, gains: Gains, reach: float, first: float
) -> tuple[float, float]:
    low, high = low + gains.sole_margin, high - gains.sole_margin
    if math.isnan(first):
        return low, high
    return max(low, first - reach), min(high, first + reach)


@compiled
def _plan_axis(
    times: StepTimes,
    dcm: float,
    left: float,
    aim: float,
    end: StepEnd,
    bounds: tuple[float, float],
) -> _Axis:
    growth, old, new = double_support_map(times.omega, times.step - times.single)
    swing = math.exp(times.omega * left)
    wanted = aim + end.dcm - new * (aim + end.zmp) - growth * swing * dcm
    zmp = wanted / (growth * (1.0 - swing) + old)
    zmp = clip(zmp, bounds[0], bounds[1])
    return _Axis(zmp, dcm, aim, growth, old, new, end)


@compiled
def _landing(axis: _Axis, swing: float) -> float:
    """Where the foot must land when the DCM error grows by `swing`."""
    touch_down = axis.zmp + (axis.dcm - axis.zmp) * swing
    end = axis.growth * touch_down + axis.old * axis.zmp + axis.new * axis.end.zmp
    return (end - axis.end.dcm) / (1.0 - axis.new)


@compiled
def _time_to_land(axis: _Axis, place: float, omega: float) -> float:
    """Time after which the foot must land at a place, 0 where it is too late [s]."""
    end = (1.0 - axis.new) * place + axis.end.dcm - axis.new * axis.end.zmp
    touch_down = (end - axis.old * axis.zmp) / axis.growth
    away = axis.dcm - axis.zmp
    if abs(away) < _STEADY:
        return 0.0
    swing = (touch_down - axis.zmp) / away
    return math.log(swing) / omega if swing > 1.0 else 0.0


@compiled
def _hurry(
    gains: Gains, goal: StepTarget, x: _Axis, y: _Axis, omega: float, left: float
) -> float:
    """Return the rate of the step's time that keeps the landing within reach."""
    swing = math.exp(omega * left)
    beside, ahead = _landing(y, swing), _landing(x, swing)
    widest = -goal.width - gains.hurry_beyond.y
    wanted = left
    if beside > -gains.narrowest:
        # It leans over its support foot: wait while it comes back; where it falls
        # over the outer edge, put the other foot down and step out with this one.
        coming_back = y.dcm < y.zmp - _RETURNING
        wanted = _time_to_land(y, -gains.narrowest, omega) if coming_back else 0.0
    elif beside < widest:
        wanted = _time_to_land(y, widest, omega)
    off = ahead - goal.length
    if abs(off) > gains.hurry_beyond.x and wanted <= left:
        furthest = goal.length + math.copysign(gains.hurry_beyond.x, off)
        wanted = min(wanted, _time_to_land(x, furthest, omega))
    return clip(left / max(wanted, gains.shortest_s), gains.slowest, gains.fastest)
