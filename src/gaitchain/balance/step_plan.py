"""Plan a step: ZMP, landing and time that keep the balance. Compiled, ours.

The robot is off by e, the DCM measured minus the DCM of the reference.

1. The ankles move the ZMP against e, inside the sole (`feedforward.ankle_shift`).
2. The reference follows the robot (`follow`), beyond a dead zone that is left to stiff
   servos; `plan_single` then finds the ZMP that still ends the step as the chain wants
   it (`step_ends`), near the one it began with.
3. Where that does not do, the foot lands elsewhere.
4. Where that is out of reach, the step is hurried or held back.
5. A robot that leans over its support foot waits on it (`one_foot_recovery`).

A textbook step adjustment, e exp(w t), acts on what stiff ankles already pull back and
destabilises the robot; hence the zones.
"""

import math
from typing import NamedTuple

from gaitchain.balance.compiled import compiled
from gaitchain.balance.curves import beyond, clip
from gaitchain.balance.gains import Gains
from gaitchain.balance.leg_kinematics import Legs
from gaitchain.balance.packed_state import Walk
from gaitchain.balance.pendulum import dcm_of, double_support_map, steady_lead
from gaitchain.balance.state import NOT_YET, Foot, Pelvis, Planar, StepTimes
from gaitchain.gait.step_target import StepTarget

_STEADY = 1e-4  # m: a DCM this close to the ZMP stays there
_STILL = 0.02  # rate of the time of a step that waits
_RETURNING = 0.005  # m: further than this inside the ZMP, the DCM moves back inward


@compiled
def follow(walk: Walk) -> Pelvis:
    """Move the reference toward the robot: its speed, so that it never jumps.

    A robot that waits on one foot is followed sideways without a dead zone.

    Args:
        walk: its gains, times, and the pelvis and error of its state.

    Returns:
        The pendulum with v increased by omega times the error taken over.
    """
    gains, pelvis, error = walk.gains, walk.state.pelvis, walk.state.error
    step = walk.times.omega * walk.times.period
    dx = gains.follow.x * beyond(error.x, gains.dead_zone.x)
    dx += gains.far_follow.x * beyond(error.x, gains.far_zone.x)
    dy = gains.follow.y * beyond(error.y, gains.dead_zone.y)
    dy += gains.far_follow.y * beyond(error.y, gains.far_zone.y)
    if walk.state.one_foot > 0.0:
        dy = gains.one_foot_follow * error.y
    return Pelvis(pelvis.x, pelvis.y, pelvis.vx + step * dx, pelvis.vy + step * dy)


class StepEnd(NamedTuple):
    """ZMP and DCM at the end of a step, along one axis, seen from the landing foot."""

    zmp: float
    """ZMP from the ankle [m]."""
    dcm: float
    """DCM from the ankle [m]."""


@compiled
def step_ends(
    target: StepTarget, gains: Gains, legs: Legs, times: StepTimes
) -> tuple[StepEnd, StepEnd]:
    """Find the ZMP and DCM over the landing foot that a steady walk would have.

    A step that stops ends with both between the feet.

    Returns:
        Along x and y of this step's frame.
    """
    growth, _, new = double_support_map(times.omega, times.step - times.single)
    growth *= math.exp(times.omega * times.single)
    if target.stops > 0.0:
        middle = 0.5 * target.width
        return StepEnd(gains.foot_zmp.x, gains.foot_zmp.x), StepEnd(middle, middle)
    # Of the next foot, whose frame is mirrored: its inside is at positive y here.
    zmp_x, zmp_y = gains.foot_zmp.x, -gains.foot_zmp.y
    dcm_x = zmp_x + steady_lead(target.length, new, growth, 1.0)
    between = legs.hip_width + 2.0 * gains.foot_zmp.y
    dcm_y = zmp_y + steady_lead(between, new, growth, -1.0)
    c, s = math.cos(target.turn), math.sin(target.turn)
    # The landing foot is turned outward, that is clockwise here.
    return (
        StepEnd(c * zmp_x + s * zmp_y, c * dcm_x + s * dcm_y),
        StepEnd(c * zmp_y - s * zmp_x, c * dcm_y - s * dcm_x),
    )


@compiled
def landing_zmp(gains: Gains, target: StepTarget, landing: Foot) -> Planar:
    """Return where the ZMP arrives at the end of double support, step frame [m]."""
    if target.stops > 0.0:
        return Planar(landing.x + gains.foot_zmp.x, 0.5 * landing.y)
    c, s = math.cos(landing.yaw), math.sin(landing.yaw)
    ahead, inward = gains.foot_zmp.x, -gains.foot_zmp.y
    return Planar(
        landing.x + c * ahead + s * inward, landing.y + c * inward - s * ahead
    )


class StepPlan(NamedTuple):
    """The plan for the rest of a single support."""

    zmp: Planar
    """ZMP until touch-down, step frame [m]."""
    landing: Foot
    rate: float
    """Of the step's time."""


@compiled
def plan_single(legs: Legs, walk: Walk, pelvis: Pelvis) -> StepPlan:
    """Find the ZMP, the landing and the time that end the step as the chain wants it.

    The DCM at the end of double support, xi_4 = A (p + (xi - p) E) + k_a p + k_b p_4
    with E = exp(w t) over the rest of single support, is to be at the landing foot plus
    `step_ends`. That is solved for p; where p leaves its bounds, for the landing; where
    that is out of reach, for t.

    Args:
        legs: the robot.
        walk: in single support; the landing of its state is the one planned so far.
        pelvis: reference now, step frame.

    Returns:
        The plan.
    """
    gains, times, target, state = walk.gains, walk.times, walk.target, walk.state
    left = max(times.single - state.time, 0.0)
    dcm, first = (
        dcm_of(pelvis, times.omega),
        Planar(state.first_zmp.x, state.first_zmp.y),
    )
    axis_x, axis_y = _plan_axes(legs, walk, dcm, first, left)
    place_x, place_y, rate = state.landing.x, state.landing.y, 1.0
    if left > gains.fixed_s:
        rate = _hurry(gains, target, axis_x, axis_y, times.omega, left)
        x = _landing(axis_x, math.exp(times.omega * left / rate))
        y = _landing(axis_y, math.exp(times.omega * left / rate))
        reach, speed = gains.landing_reach, gains.landing_speed
        x = clip(x, target.length - reach.x, target.length + reach.x)
        y = clip(y, -target.width - reach.y, -gains.narrowest)
        far_x, far_y = speed.x * times.period, speed.y * times.period
        place_x += clip(x - place_x, -far_x, far_x)
        place_y += clip(y - place_y, -far_y, far_y)
    landing = Foot(place_x, place_y, state.landing.yaw)
    return StepPlan(Planar(axis_x.zmp, axis_y.zmp), landing, rate)


@compiled
def plan_on_one_foot(legs: Legs, walk: Walk, pelvis: Pelvis) -> StepPlan:
    """Keep the robot on its support foot: ZMP at the outer edge, swing foot up.

    Ahead, the ZMP is where the step could still end long after. Arguments are those of
    `plan_single`.
    """
    gains, times, state = walk.gains, walk.times, walk.state
    dcm = dcm_of(pelvis, times.omega)
    left = max(times.single - state.time, gains.fixed_s) / _STILL
    ahead, _ = _plan_axes(legs, walk, dcm, NOT_YET, left)
    edge = legs.sole_half_width - gains.sole_margin
    rate = _STILL if state.time > times.rise else 1.0
    landing = Foot(state.landing.x, state.landing.y, state.landing.yaw)
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
    legs: Legs, walk: Walk, dcm: Planar, first_zmp: Planar, left: float
) -> tuple[_Axis, _Axis]:
    """Plan both axes from a DCM, with that much of single support left [s]."""
    gains, times, target = walk.gains, walk.times, walk.target
    end_x, end_y = step_ends(target, gains, legs, times)
    reach, half = gains.zmp_reach, legs.sole_half_width
    along = _zmp_bounds(legs.sole_rear, legs.sole_front, gains, reach.x, first_zmp.x)
    across = _zmp_bounds(-half, half, gains, reach.y, first_zmp.y)
    return (
        _plan_axis(times, dcm.x, left, target.length, end_x, along),
        _plan_axis(times, dcm.y, left, -target.width, end_y, across),
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
    gains: Gains, target: StepTarget, x: _Axis, y: _Axis, omega: float, left: float
) -> float:
    """Return the rate of the step's time that keeps the landing within reach."""
    swing = math.exp(omega * left)
    beside, ahead = _landing(y, swing), _landing(x, swing)
    widest = -target.width - gains.hurry_beyond.y
    wanted = left
    if beside > -gains.narrowest:
        # It leans over its support foot: wait while it comes back; where it falls
        # over the outer edge, put the other foot down and step out with this one.
        coming_back = y.dcm < y.zmp - _RETURNING
        wanted = _time_to_land(y, -gains.narrowest, omega) if coming_back else 0.0
    elif beside < widest:
        wanted = _time_to_land(y, widest, omega)
    off = ahead - target.length
    if abs(off) > gains.hurry_beyond.x and wanted <= left:
        furthest = target.length + math.copysign(gains.hurry_beyond.x, off)
        wanted = min(wanted, _time_to_land(x, furthest, omega))
    return clip(left / max(wanted, gains.shortest_s), gains.slowest, gains.fastest)
