"""Plan a step: ZMP, landing and time that keep the balance. Compiled, ours.

The robot is off by e, the DCM measured minus the DCM of the reference.

1. The ankles move the ZMP against e, inside the sole (`feedforward.ankle_shift`).
2. The reference follows the robot (`follow`), beyond a dead zone that is left to stiff
   servos. At its begin a step gets the ZMP that ends it as the chain wants it
   (`step_ends`).
3. Where that does not do any more, the foot lands elsewhere, earlier or later: of some
   times that one is taken whose landing costs least (`plan_single`). Feet may cross.

A textbook step adjustment, e exp(w t), acts on what stiff ankles already pull back and
destabilises the robot; hence the zones.
"""

import math
from typing import NamedTuple

from gaitchain.balance.compiled import compiled
from gaitchain.balance.curves import beyond, clip
from gaitchain.balance.dcm_error import pushed_error
from gaitchain.balance.gains import Gains, zmp_ends
from gaitchain.balance.leg_kinematics import Legs
from gaitchain.balance.packed_state import Walk
from gaitchain.balance.pendulum import (
    dcm_of,
    double_support_map,
    steady_lead,
    swaying_lead,
)
from gaitchain.balance.reference_pose import innermost, swing_foot
from gaitchain.balance.state import Foot, Pelvis, Planar, StepTimes
from gaitchain.gait.step_target import StepTarget

_PARTS = (0.53, 0.6, 0.7, 0.8, 0.9, 1.1)  # of the time left: when else to land
_BETWEEN = 0.5  # of the way from the ZMP to the heels: the most of `most_further`
_MISSED = 100.0  # cost of a landing missed by a leg; one moved by a leg costs 1


@compiled
def follow(walk: Walk) -> Pelvis:
    """Move the reference toward the robot: its speed, so that it never jumps.

    Args:
        walk: its gains, times, and the pelvis and error of its state.

    Returns:
        The pendulum with v increased by omega times the error taken over.
    """
    gains, pelvis, error = walk.gains, walk.state.pelvis, walk.state.error
    step = walk.times.omega * walk.times.period
    dx = gains.follow.x * beyond(error.x, gains.dead_zone.x)
    dy = gains.follow.y * beyond(error.y, gains.dead_zone.y)
    return Pelvis(pelvis.x, pelvis.y, pelvis.vx + step * dx, pelvis.vy + step * dy)


class StepEnd(NamedTuple):
    """ZMP and DCM at the end of a step, along one axis, seen from the landing foot."""

    zmp: float
    """ZMP from the ankle [m]."""
    dcm: float
    """DCM from the ankle [m]."""


@compiled
def step_ends(
    target: StepTarget, gains: Gains, times: StepTimes
) -> tuple[StepEnd, StepEnd]:
    """Find the ZMP and DCM over the landing foot that a steady walk would have.

    Its steps are as long as this one, and by turns as wide as this one and the next. A
    step that stops ends with both between the feet.

    Returns:
        Along x and y of this step's frame.
    """
    growth, _, new = double_support_map(times.omega, times.step - times.single)
    growth *= math.exp(times.omega * times.single)
    if target.stops > 0.0:
        middle = 0.5 * target.width
        ahead = gains.foot_zmp.x - 0.5 * target.length
        return StepEnd(ahead, ahead), StepEnd(middle, middle)
    # Of the next foot, whose frame is mirrored: its inside is at positive y here.
    zmp_x, zmp_y = gains.foot_zmp.x, -gains.foot_zmp.y
    dcm_x = zmp_x + steady_lead(target.length, new, growth)
    outward = 2.0 * gains.foot_zmp.y
    beside, then = target.width + outward, target.next_width + outward
    dcm_y = zmp_y + swaying_lead(then, beside, new, growth)
    c, s = math.cos(target.turn), math.sin(target.turn)
    # The landing foot is turned outward, that is clockwise here.
    return (
        StepEnd(c * zmp_x + s * zmp_y, c * dcm_x + s * dcm_y),
        StepEnd(c * zmp_y - s * zmp_x, c * dcm_y - s * dcm_x),
    )


@compiled
def most_further(legs: Legs, walk: Walk) -> float:
    """Return at most how much further a stop lands than its DCM asks, either way [m].

    It is 0 for all other steps. A robot that stops with one foot ahead of the other
    stands on both: the DCM over the hind one is near the line from heel to heel, and is
    to end between the feet. A pushed robot, whose foot lands far from where it was to
    be, steps on in any case, and needs all of its reach: it is 0 there, too.

    Args:
        legs: the robot.
        walk: in single support.
    """
    if walk.target.stops == 0.0 or walk.state.worst > pushed_error(walk):
        return 0.0
    return _BETWEEN * (walk.gains.foot_zmp.x - legs.stand_rear)


@compiled
def landing_zmp(gains: Gains, target: StepTarget, landing: Foot) -> Planar:
    """Return where the ZMP arrives at the end of double support, step frame [m]."""
    if target.stops > 0.0:
        return Planar(0.5 * landing.x + gains.foot_zmp.x, 0.5 * landing.y)
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


class _Option(NamedTuple):
    """A way to end the step: when, where, and what it costs."""

    cost: float
    zmp: Planar
    place: Planar
    time: float


@compiled
def plan_single(legs: Legs, walk: Walk, pelvis: Pelvis) -> StepPlan:
    """Find the ZMP, the landing and the time that end the step at the least cost.

    The DCM at the end of double support, xi_4 = A (p + (xi - p) E) + k_a p + k_b p_4
    with E = exp(w t) after the rest t of single support, is to be at the landing foot
    plus `step_ends`; a stop may land further (`most_further`). At the step's begin that
    is solved for p, which then stays; later, and where p would leave the sole, for the
    landing, for each of some times t. What the foot cannot reach until then is missed.
    The cost is `_cost`. [Khadiv16] solves a quadratic program for place, time and ZMP;
    with the time as the only free number a few candidates are as good, and never fail
    to converge.

    Args:
        legs: the robot.
        walk: in single support; the landing of its state is the one planned so far.
        pelvis: reference now, step frame.

    Returns:
        The plan.
    """
    gains, times, state = walk.gains, walk.times, walk.state
    left = max(times.single - state.time, 0.0)
    dcm = dcm_of(pelvis, times.omega)
    swing_x, swing_y, _, _ = swing_foot(legs, walk)
    swing = Planar(swing_x, swing_y)
    best = _option(legs, walk, dcm, swing, left)
    landing = Foot(state.landing.x, state.landing.y, state.landing.yaw)
    if left <= gains.fixed_s:
        return StepPlan(best.zmp, landing, 1.0)
    for part in _PARTS:
        time = max(part * left, min(gains.shortest_s, left))
        option = _option(legs, walk, dcm, swing, time)
        if option.cost < best.cost:
            best = option
    far = gains.swing_speed * times.period
    landing = Foot(
        landing.x + clip(best.place.x - landing.x, -far, far),
        landing.y + clip(best.place.y - landing.y, -far, far),
        landing.yaw,
    )
    return StepPlan(best.zmp, landing, left / best.time)


@compiled
def _option(legs: Legs, walk: Walk, dcm: Planar, swing: Planar, time: float) -> _Option:
    """Plan the step for one time of touch-down, `time` from now [s]."""
    state = walk.state
    first = Planar(state.first_zmp.x, state.first_zmp.y)
    x, y = _plan_axes(legs, walk, dcm, first, time)
    growth = math.exp(walk.times.omega * time)
    wanted = Planar(_landing(x, growth), _landing(y, growth))
    place = _reachable(legs, walk, wanted, swing, time)
    return _Option(
        _cost(legs, walk, wanted, place, time), Planar(x.zmp, y.zmp), place, time
    )


@compiled
def _reachable(
    legs: Legs, walk: Walk, wanted: Planar, swing: Planar, time: float
) -> Planar:
    """Return the place nearest to a wanted one where the swing foot can be in time."""
    gains, target = walk.gains, walk.target
    reach, far = gains.landing_reach, gains.swing_speed * time
    x = clip(wanted.x, target.length - reach.x, target.length + reach.x)
    x = clip(x, swing.x - far, swing.x + far)
    y = clip(wanted.y, -target.width - reach.y, innermost(legs, gains, x))
    return Planar(x, clip(y, swing.y - far, swing.y + far))


@compiled
def _cost(legs: Legs, walk: Walk, wanted: Planar, place: Planar, time: float) -> float:
    """Return the cost of a landing, of its time, and of what it misses, in legs^2."""
    gains, target, leg = walk.gains, walk.target, legs.leg
    missed = math.hypot(wanted.x - place.x, wanted.y - place.y) / leg
    moved = math.hypot(place.x - target.length, place.y + target.width) / leg
    delay = (walk.state.time + time) / walk.times.single - 1.0
    weight = gains.later if delay > 0.0 else gains.sooner
    return _MISSED * missed**2 + moved**2 + weight * delay**2


class _Axis(NamedTuple):
    """One axis of the plan, and what its landing follows from."""

    zmp: float
    dcm: float
    aim: float
    growth: float
    old: float
    new: float
    end: StepEnd
    further: float
    """At most how much further from its aim the foot lands than the DCM asks [m]."""


@compiled
def _plan_axes(
    legs: Legs, walk: Walk, dcm: Planar, first_zmp: Planar, left: float
) -> tuple[_Axis, _Axis]:
    """Plan both axes from a DCM, with that much of single support left [s]."""
    gains, times, target = walk.gains, walk.times, walk.target
    end_x, end_y = step_ends(target, gains, times)
    half, margin = legs.zmp_half_width, gains.sole_margin
    rear, front = zmp_ends(legs, gains)
    more = most_further(legs, walk)
    along = _zmp_bounds(rear, front, margin, first_zmp.x)
    across = _zmp_bounds(-half, half, margin, first_zmp.y)
    return (
        _plan_axis(times, dcm.x, left, target.length, end_x, along, more),
        _plan_axis(times, dcm.y, left, -target.width, end_y, across, 0.0),
    )


@compiled
def _zmp_bounds(
    low: float, high: float, margin: float, first: float
) -> tuple[float, float]:
    """Return the bounds of a step's ZMP: the sole, then where the step began with it.

    Within a step the ankles move it; a plan that moves it as well does so twice.
    """
    if math.isnan(first):
        margin = min(margin, 0.5 * (high - low))
        return low + margin, high - margin
    return first, first


@compiled
def _plan_axis(
    times: StepTimes,
    dcm: float,
    left: float,
    aim: float,
    end: StepEnd,
    bounds: tuple[float, float],
    further: float,
) -> _Axis:
    growth, old, new = double_support_map(times.omega, times.step - times.single)
    swing = math.exp(times.omega * left)
    wanted = aim + end.dcm - new * (aim + end.zmp) - growth * swing * dcm
    zmp = wanted / (growth * (1.0 - swing) + old)
    zmp = clip(zmp, bounds[0], bounds[1])
    return _Axis(zmp, dcm, aim, growth, old, new, end, further)


@compiled
def _landing(axis: _Axis, swing: float) -> float:
    """Where the foot must land when the DCM error grows by `swing`.

    A stop goes as far beyond its aim again, up to `further`: so the DCM, over one foot
    otherwise, ends in the middle between both.
    """
    touch_down = axis.zmp + (axis.dcm - axis.zmp) * swing
    end = axis.growth * touch_down + axis.old * axis.zmp + axis.new * axis.end.zmp
    place = (end - axis.end.dcm) / (1.0 - axis.new)
    return place + clip(place - axis.aim, -axis.further, axis.further)
