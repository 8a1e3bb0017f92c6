"""The plan of a step, against numerical integration of the pendulum it plans for."""

import math
from dataclasses import replace

import numpy as np
import pytest
import scipy
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from other_robots import with_legs
from walk_record import walk_record

from gaitchain.balance.curves import beyond, clip, hermite
from gaitchain.balance.gains import Gains, derive_gains, open_loop, scale_of
from gaitchain.balance.leg_kinematics import legs_of
from gaitchain.balance.pendulum import (
    double_support_map,
    steady_lead,
    swaying_lead,
)
from gaitchain.balance.reference_pose import innermost, swing_foot
from gaitchain.balance.state import (
    DOUBLE,
    SINGLE,
    Foot,
    GaitState,
    Pelvis,
    Planar,
    seen_from,
    step_times,
)
from gaitchain.balance.step_plan import follow, landing_zmp, plan_single, step_ends
from gaitchain.errors import CommandError
from gaitchain.gait.step_target import StepTarget
from gaitchain.gait.stride.shape import StrideShape
from gaitchain.messages import GRAVITY
from gaitchain.robot.box_robot import JOINT_NAMES, load_box_robot
from gaitchain.walker.stride_setup import centred

RES = load_box_robot("res")
LEGS = legs_of(RES)
SHAPE = StrideShape()
TIMING = SHAPE.timing(RES)
HIPS = SHAPE.hip_height * RES.reduced.leg_length
TIMES = step_times(
    TIMING, HIPS, centred(LEGS, HIPS, derive_gains(LEGS).foot_zmp.x)[1], 0.01
)
GAINS = derive_gains(LEGS)
FAR = Planar(1e3, 1e3)
FREE = GAINS._replace(
    landing_reach=FAR, swing_speed=1e6, narrowest=-1e3, across=1e3, fixed_s=-1.0
)
"""Feet that can land anywhere, at once, until the very end."""
UNHURRIED = FREE._replace(sooner=1e9, later=1e9)
DOUBLE_S = TIMES.step - TIMES.single
NOT_YET = Planar(math.nan, math.nan)
TARGET = StepTarget(
    0.0, LEGS.hip_width, 0.0, 0.5, 1.4, 0.04, 0.0, 0.05, 0.0, 0.0, LEGS.hip_width
)


def numbers(low, high):
    return st.floats(low, high).map(lambda value: round(value, 6))


TARGETS = st.builds(
    TARGET._replace,
    length=numbers(-0.15, 0.3),
    width=numbers(0.2, 0.3),
    next_width=numbers(0.2, 0.3),
    turn=numbers(-0.1, 0.3),
)
DCMS = st.tuples(numbers(-0.15, 0.3), numbers(-0.25, 0.05))


def at_dcm(dcm):
    """A pelvis at rest there, whose DCM is its place."""
    return Pelvis(*dcm, 0.0, 0.0)


def planned(gains, target, dcm, time_s, landing=None, first=NOT_YET):
    """Plan from a pelvis at a DCM where the robot really is."""
    state = GaitState(
        SINGLE,
        time=time_s,
        landing=landing or Foot(target.length, -target.width, target.turn),
        first_zmp=first,
    )
    walk = walk_record(gains, TIMES, target=target, state=state)
    return plan_single(LEGS, walk, at_dcm(dcm))


def end_of_step(gains, target, dcm, plan, left):
    """Integrate xi' = omega (xi - p) over the rest of single and double support."""
    zmp, aim = np.array(plan.zmp), np.array(landing_zmp(gains, target, plan.landing))
    double = TIMES.step - TIMES.single

    def run(start, slope, time_s):
        way = scipy.integrate.solve_ivp(
            slope, (0.0, time_s), start, rtol=1e-10, atol=1e-12
        )
        return way.y[:, -1]

    w = TIMES.omega
    touch_down = run(np.array(dcm), lambda t, y: w * (y - zmp), left / plan.rate)
    return run(
        touch_down, lambda t, y: w * (y - zmp - (aim - zmp) * t / double), double
    )


def wanted_end(gains, target, plan):
    ends = step_ends(target, gains, TIMES)
    return np.array([plan.landing.x + ends[0].dcm, plan.landing.y + ends[1].dcm])


def steady_dcm(target):
    """DCM at lift-off of a walk that repeats itself, after a step to that target."""
    growth, _, new = double_support_map(TIMES.omega, TIMES.step - TIMES.single)
    growth *= math.exp(TIMES.omega * TIMES.single)
    ahead = GAINS.foot_zmp.x + steady_lead(target.length, new, growth)
    widths = np.array([target.next_width, target.width]) + 2.0 * GAINS.foot_zmp.y
    return ahead, GAINS.foot_zmp.y - swaying_lead(*widths, new, growth)


def at_time(dcm, time_s):
    """The DCM after some time over the foot's own ZMP."""
    zmp = np.array(GAINS.foot_zmp)
    return tuple(zmp + (np.array(dcm) - zmp) * math.exp(TIMES.omega * time_s))


def bounds(gains):
    margin, half = gains.sole_margin, LEGS.sole_half_width
    return (
        (LEGS.sole_rear + margin, LEGS.sole_front - margin),
        (margin - half, half - margin),
    )


def inside(gains, zmp):
    spans = bounds(gains)
    return all(low < p < high for p, (low, high) in zip(zmp, spans, strict=True))


@pytest.mark.parametrize("length", [-0.1, 0.0, 0.15, 0.3])
def test_a_steady_walk_needs_no_correction(length):
    """At its nominal DCM the ZMP stays in the foot's place, the foot at its target."""
    target = TARGET._replace(length=length)
    dcm = steady_dcm(target)
    first = NOT_YET
    for time_s in np.arange(0.0, TIMES.single - 0.02, 0.02):
        plan = planned(GAINS, target, at_time(dcm, time_s), time_s, first=first)
        first = first if time_s else plan.zmp
        np.testing.assert_allclose(plan.zmp, GAINS.foot_zmp, atol=1e-9)
        np.testing.assert_allclose(
            plan.landing, (length, -target.width, 0.0), atol=1e-9
        )
        assert plan.rate == pytest.approx(1.0)


@pytest.mark.parametrize("outward", [0.05, 0.2])
def test_steps_aside_need_no_correction_where_they_are_expected(outward):
    """Each second step brings the feet together; the ZMP stays in the foot's place."""
    apart = LEGS.hip_width + outward
    wide = TARGET._replace(width=apart)
    closing = TARGET._replace(next_width=apart)
    for before, target in ((closing, wide), (wide, closing)):
        dcm = steady_dcm(before)
        plan = planned(GAINS, target, dcm, 0.0)
        np.testing.assert_allclose(plan.zmp, GAINS.foot_zmp, atol=1e-9)
        assert plan.landing.y == pytest.approx(-target.width, abs=1e-9)
    unexpected = planned(GAINS, wide, steady_dcm(TARGET), 0.0)
    assert unexpected.zmp.y > GAINS.foot_zmp.y + 0.1 * outward


@settings(max_examples=60)
@given(TARGETS, numbers(-0.01, 0.01), numbers(-0.01, 0.01), numbers(0.0, 0.3))
def test_where_the_zmp_suffices_the_landing_is_the_targets(target, dx, dy, time_s):
    hips = LEGS.hip_width
    target = target._replace(width=hips, next_width=hips, turn=0.0)
    nominal = at_time(steady_dcm(target), time_s)
    dcm = nominal[0] + dx, nominal[1] + dy
    plan = planned(UNHURRIED, target, dcm, time_s)
    assume(inside(UNHURRIED, plan.zmp))
    np.testing.assert_allclose(
        plan.landing, (target.length, -target.width, target.turn), atol=1e-9
    )
    end = end_of_step(UNHURRIED, target, dcm, plan, TIMES.single - time_s)
    np.testing.assert_allclose(end, wanted_end(UNHURRIED, target, plan), atol=1e-7)


@settings(max_examples=60)
@given(TARGETS, DCMS, numbers(0.0, 0.3))
def test_where_it_does_not_the_foot_lands_where_the_dcm_asks(target, dcm, time_s):
    plan = planned(UNHURRIED, target, dcm, time_s)
    assume(not inside(UNHURRIED, plan.zmp))
    assert plan.rate == pytest.approx(1.0)
    end = end_of_step(UNHURRIED, target, dcm, plan, TIMES.single - time_s)
    np.testing.assert_allclose(end, wanted_end(UNHURRIED, target, plan), atol=1e-7)


@settings(max_examples=60)
@given(TARGETS, DCMS, numbers(0.0, 0.3))
def test_a_hurried_step_ends_well_too(target, dcm, time_s):
    """The place fits the time that is left at the new rate."""
    plan = planned(FREE, target, dcm, time_s)
    end = end_of_step(FREE, target, dcm, plan, TIMES.single - time_s)
    np.testing.assert_allclose(end, wanted_end(FREE, target, plan), atol=1e-7)


@pytest.mark.parametrize("length", [0.0, 0.2])
def test_a_stop_ends_at_rest_between_the_feet(length):
    target = TARGET._replace(length=length, stops=1.0)
    dcm = steady_dcm(TARGET._replace(length=0.5 * length))
    plan = planned(UNHURRIED, target, dcm, 0.0)
    assert inside(UNHURRIED, plan.zmp)
    end = end_of_step(UNHURRIED, target, dcm, plan, TIMES.single)
    middle = (0.5 * length + GAINS.foot_zmp.x, -0.5 * target.width)
    np.testing.assert_allclose(end, middle, atol=1e-7)
    aim = landing_zmp(GAINS, target, plan.landing)
    np.testing.assert_allclose(aim, middle, atol=1e-9)


@settings(max_examples=100)
@given(
    TARGETS,
    st.tuples(numbers(-1.0, 1.0), numbers(-1.0, 1.0)),
    numbers(0.0, 0.5),
    st.tuples(numbers(-0.1, 0.3), numbers(-0.35, -0.16)),
)
def test_whatever_happens_the_plan_keeps_its_bounds(target, dcm, time_s, place):
    before = Foot(*place, target.turn)
    plan = planned(GAINS, target, dcm, time_s, before)
    assert 1.0 / 1.1 - 1e-9 <= plan.rate <= 1.0 / 0.53 + 1e-9
    for p, (low, high) in zip(plan.zmp, bounds(GAINS), strict=True):
        assert low - 1e-12 <= p <= high + 1e-12
    moved = plan.landing.x - before.x, plan.landing.y - before.y
    for way in moved:
        assert abs(way) <= GAINS.swing_speed * TIMES.period + 1e-12
    # Never further from the target than it may be, unless it was before.
    off = abs(plan.landing.x - target.length), abs(before.x - target.length)
    assert off[0] <= max(GAINS.landing_reach.x, off[1]) + 1e-12
    assert plan.landing.y <= max(GAINS.across, before.y) + 1e-12
    assert plan.landing.yaw == target.turn
    if TIMES.single - time_s <= GAINS.fixed_s:
        assert plan.landing == before
        assert plan.rate == 1.0


@settings(max_examples=60)
@given(TARGETS, DCMS, numbers(0.0, 0.3), st.tuples(numbers(-0.05, 0.08), DCMS))
def test_the_zmp_stays_where_the_step_began_with_it(target, dcm, time_s, first):
    begun = Planar(first[0], 0.1 * first[1][1])
    assert planned(GAINS, target, dcm, time_s, first=begun).zmp == begun


def test_a_push_outward_hurries_the_step_and_leaning_inward_does_not():
    ahead, beside = steady_dcm(TARGET)
    out = planned(GAINS, TARGET, (ahead, beside - 0.12), 0.05)
    back = planned(GAINS, TARGET, (ahead, 0.03), 0.05)
    assert out.rate > 1.0
    assert back.rate <= 1.0
    assert out.landing.y < -TARGET.width < back.landing.y


@pytest.mark.parametrize("push", [0.1, -0.1])
def test_the_foot_lands_on_the_side_of_the_push(push):
    dcm = steady_dcm(TARGET)
    plan = planned(UNHURRIED, TARGET, (dcm[0] + push, dcm[1]), 0.05)
    assert math.copysign(1.0, plan.landing.x) == math.copysign(1.0, push)
    assert math.copysign(1.0, plan.zmp.x) == math.copysign(1.0, push)


USUAL = GAINS.foot_zmp.x
NARROW = {"firm_rear": 0.8 * USUAL, "firm_front": 1.5 * USUAL + GAINS.sole_margin}
WEAK = {"zmp_rear": -0.3 * USUAL, "zmp_front": 1.5 * USUAL + GAINS.sole_margin}
POINT = {"firm_rear": 0.9 * USUAL, "firm_front": 1.1 * USUAL}


@pytest.mark.parametrize(
    ("ends", "factor", "expected"),
    [
        (NARROW, 0.5, 0.8 * USUAL + GAINS.sole_margin),
        (NARROW, 1.4, 1.4 * USUAL),
        (NARROW, 2.0, 1.5 * USUAL),
        (WEAK, 3.0, 1.5 * USUAL),
        (POINT, 0.2, USUAL),
        (POINT, 2.0, USUAL),
    ],
)
def test_a_step_in_place_lands_in_place_at_any_factor(ends, factor, expected):
    """Its ZMP may be where the robot stood; else the step drifts away from there."""
    tapered = LEGS._replace(**ends)
    gains = derive_gains(tapered, {"foot_zmp": factor * USUAL / derived_x(tapered)})
    assert gains.foot_zmp.x == pytest.approx(expected)
    _, beside = steady_dcm(TARGET)
    landing = Foot(0.0, -TARGET.width)
    state = GaitState(SINGLE, landing=landing, first_zmp=NOT_YET)
    walk = walk_record(gains, TIMES, target=TARGET, state=state)
    plan = plan_single(tapered, walk, at_dcm((gains.foot_zmp.x, beside)))
    assert plan.zmp.x == pytest.approx(gains.foot_zmp.x)
    assert plan.landing.x == pytest.approx(0.0, abs=1e-9)


def derived_x(legs):
    """Where the ZMP is planned before it is kept within its ends."""
    scale = scale_of(legs)
    return min(scale.zmp_centre + 0.018 * scale.leg, 0.7 * scale.zmp_front)


STOP = TARGET._replace(stops=1.0)
_SINGLE_S = 0.5 * TIMES.single


def stopping(dcm_x, worst=0.0, usual=0.0):
    """Plan the rest of a stop whose ZMP stays where it was, a DCM away from there."""
    zmp = Planar(GAINS.foot_zmp.x, GAINS.foot_zmp.y)
    landing = Foot(0.0, -STOP.width)
    state = GaitState(
        SINGLE, time=_SINGLE_S, landing=landing, first_zmp=zmp, worst=worst
    )
    target = STOP._replace(usual_error=usual)
    walk = walk_record(UNHURRIED, TIMES, target=target, state=state)
    dcm = GAINS.foot_zmp.x + dcm_x, -0.05
    return plan_single(LEGS, walk, at_dcm(dcm)), dcm


@given(numbers(-0.006, 0.006))
def test_a_stop_ends_in_the_middle_between_feet_of_which_one_is_ahead(off):
    plan, dcm = stopping(off)
    end = end_of_step(UNHURRIED, STOP, dcm, plan, TIMES.single - _SINGLE_S)
    assert end[0] == pytest.approx(0.5 * plan.landing.x + GAINS.foot_zmp.x, abs=1e-6)


@pytest.mark.parametrize("off", [0.05, -0.05])
def test_a_pushed_robot_that_stops_keeps_its_reach(off):
    further = 0.5 * (GAINS.foot_zmp.x - LEGS.stand_rear)
    calm, _ = stopping(off, worst=GAINS.pushed + 0.01, usual=0.02)
    pushed, _ = stopping(off, worst=GAINS.pushed + 0.03, usual=0.02)
    assert abs(calm.landing.x - pushed.landing.x) == pytest.approx(further)
    assert abs(calm.landing.x) > abs(pushed.landing.x)


@settings(max_examples=40)
@given(TARGETS)
def test_the_end_of_a_turned_step_is_that_of_the_next_one(target):
    """Seen from the landed foot, which is mirrored, every end is the steady one."""
    (zmp_x, dcm_x), (zmp_y, dcm_y) = step_ends(target, GAINS, TIMES)
    c, s = math.cos(target.turn), math.sin(target.turn)

    def from_landed(x, y):
        # It is turned clockwise; its own frame has y to the other side.
        return c * x - s * y, -(s * x + c * y)

    np.testing.assert_allclose(from_landed(zmp_x, zmp_y), GAINS.foot_zmp, atol=1e-12)
    np.testing.assert_allclose(
        from_landed(dcm_x, dcm_y), steady_dcm(target), atol=1e-12
    )
    landing = Foot(target.length, -target.width, target.turn)
    aim = landing_zmp(GAINS, target, landing)
    np.testing.assert_allclose(aim, (landing.x + zmp_x, landing.y + zmp_y), atol=1e-12)


@given(numbers(-1.0, 1.0), numbers(0.0, 0.5))
def test_a_dead_zone_takes_its_part_of_an_error(error, zone):
    rest = beyond(error, zone)
    assert abs(rest) == pytest.approx(max(abs(error) - zone, 0.0))
    assert rest * error >= 0.0


@given(numbers(-0.3, 0.3), numbers(-0.3, 0.3))
def test_the_reference_follows_by_its_speed_and_never_overtakes(x, y):
    pelvis = Pelvis(0.01, -0.1, 0.2, -0.3)
    state = GaitState(SINGLE, pelvis=pelvis, error=Planar(x, y))
    moved = follow(walk_record(GAINS, TIMES, state=state))
    assert (moved.x, moved.y) == (pelvis.x, pelvis.y)
    taken = (moved.vx - pelvis.vx) / TIMES.omega, (moved.vy - pelvis.vy) / TIMES.omega
    for part, error, zone in zip(taken, (x, y), GAINS.dead_zone, strict=True):
        assert part * error >= 0.0
        assert abs(part) <= max(abs(error) - zone, 0.0) + 1e-12
    assert follow(walk_record(open_loop(GAINS), TIMES, state=state)) == pelvis


@given(
    numbers(-1, 1), numbers(-3, 3), numbers(-1, 1), numbers(-3, 3), numbers(0.2, 2.0)
)
def test_a_cubic_meets_both_ends(start, rate, end, end_rate, span):
    cubic = (start, rate, end, end_rate, span)
    assert hermite(*cubic, 0.0)[:2] == pytest.approx((start, rate), abs=1e-9)
    assert hermite(*cubic, span)[:2] == pytest.approx((end, end_rate), abs=1e-9)
    value, slope, bend = hermite(*cubic, 0.4 * span)
    (low, _, _), (high, _, _) = (hermite(*cubic, 0.4 * span + h) for h in (-1e-4, 1e-4))
    assert (high - low) / 2e-4 == pytest.approx(slope, abs=1e-4)
    assert (high - 2.0 * value + low) / 1e-8 == pytest.approx(bend, abs=1e-2)


def test_the_swing_foot_passes_the_chains_key_poses():
    target = TARGET._replace(length=0.3, turn=0.2, share=0.45, lift=0.05)
    state = GaitState(
        SINGLE, lift_off=Foot(-0.2, -0.22, 0.1), landing=Foot(0.3, -0.2, 0.2)
    )

    def foot(time_s):
        now = state._replace(time=time_s)
        return np.array(
            swing_foot(LEGS, walk_record(GAINS, TIMES, target=target, state=now))
        )

    np.testing.assert_allclose(foot(0.0), (-0.2, -0.22, 0.0, 0.1), atol=1e-12)
    np.testing.assert_allclose(
        foot(TIMES.rise), (0.025, -0.211, 0.05, 0.145), atol=1e-12
    )
    np.testing.assert_allclose(foot(TIMES.single), (0.3, -0.2, 0.0, 0.2), atol=1e-12)
    heights = [foot(t)[2] for t in np.linspace(0.0, TIMES.single, 60)]
    assert max(heights) == pytest.approx(target.lift, abs=1e-3)
    assert min(heights) >= -1e-12
    # Both cubics pass kp_2 at one speed.
    h = 1e-5
    one, two, three = foot(TIMES.rise - h), foot(TIMES.rise), foot(TIMES.rise + h)
    np.testing.assert_allclose((two - one) / h, (three - two) / h, atol=1e-2)


SOLE = LEGS.sole_front - LEGS.sole_rear
PLACES = st.builds(
    lambda x, part: Foot(x, -0.4 + part * (innermost(LEGS, GAINS, x) + 0.4)),
    numbers(-0.6, 0.6),
    numbers(0.0, 1.0),
)


@given(PLACES, PLACES)
def test_a_crossing_foot_goes_around_the_other_one(lift_off, landing):
    """Two soles of one size overlap where they are nearer than one both ways."""
    state = GaitState(SINGLE, lift_off=lift_off, landing=landing)
    for time_s in np.linspace(0.0, TIMES.single, 50):
        now = state._replace(time=float(time_s))
        walk = walk_record(GAINS, TIMES, target=TARGET, state=now)
        x, y, _, _ = swing_foot(LEGS, walk)
        assert abs(x) >= SOLE - 1e-9 or -y > 2.0 * LEGS.sole_half_width
    assert (x, y) == pytest.approx(landing[:2], abs=1e-9)


@pytest.mark.parametrize(("ahead", "crosses"), [(0.0, False), (0.3, True)])
def test_feet_cross_only_where_one_is_ahead_of_the_other(ahead, crosses):
    """A DCM over the outer edge asks for a landing beyond the support foot."""
    at_once = TIMES._replace(period=100.0)
    walk = walk_record(
        FREE._replace(narrowest=GAINS.narrowest, across=GAINS.across),
        at_once,
        target=TARGET,
        state=GaitState(SINGLE, time=0.2, landing=Foot(0.0, -0.2), first_zmp=NOT_YET),
    )
    plan = plan_single(LEGS, walk, at_dcm((ahead, 0.15)))
    assert (plan.landing.y > -GAINS.narrowest + 1e-9) == crosses
    assert plan.landing.y <= GAINS.across + 1e-9


@given(st.floats(allow_nan=False), numbers(-1, 0), numbers(0, 1))
def test_clip_holds_a_value_between_its_bounds(value, low, high):
    assert clip(value, low, high) == np.clip(value, low, high)


@pytest.mark.parametrize("lever", [0.03, 0.06, 1.0])
def test_a_weak_ankle_keeps_the_zmp_near_it(lever):
    """On one foot the ankle's torque is the robot's weight times the ZMP's distance."""
    full = RES.legs
    limits = full.torque_limit.copy()
    pitch = [i for i, name in enumerate(JOINT_NAMES) if "ankle_pitch" in name]
    limits[pitch] = lever * full.mass * GRAVITY
    weak = legs_of(with_legs(RES, replace(full, torque_limit=limits)))
    front, rear = min(LEGS.sole_front, lever), max(LEGS.sole_rear, -lever)
    assert weak.zmp_front == pytest.approx(front)
    assert weak.zmp_rear == pytest.approx(rear)
    assert weak.stand_front == pytest.approx(min(LEGS.sole_front, 2.0 * lever))
    assert weak.sole_front == LEGS.sole_front
    assert weak.zmp_half_width == LEGS.zmp_half_width
    assert derive_gains(weak).foot_zmp.x <= 0.7 * front + 1e-12
    walk = walk_record(
        derive_gains(weak),
        TIMES,
        target=TARGET,
        state=GaitState(SINGLE, time=0.0, landing=Foot(0.0, -0.2), first_zmp=NOT_YET),
    )
    for dcm in (0.5, -0.5):
        plan = plan_single(weak, walk, at_dcm((dcm, 0.0)))
        assert rear - 1e-9 <= plan.zmp.x <= front + 1e-9


def test_a_leg_without_an_ankle_roll_has_no_such_limit_across():
    axis = RES.legs.axis.copy()
    axis[:, -1] = (0.0, 0.0, 1.0)
    limits = np.full(12, 1e-3)
    legs = legs_of(with_legs(RES, replace(RES.legs, axis=axis, torque_limit=limits)))
    assert legs.zmp_half_width == LEGS.sole_half_width
    assert legs.zmp_front < 1e-4


def test_gains_scale_with_the_robot():
    """Twice the size in the same gravity: twice the lengths, root two the speeds."""
    sole = "sole_front", "sole_rear", "sole_half_width", "zmp_front", "zmp_rear"
    double = LEGS._replace(
        **{
            name: 2.0 * getattr(LEGS, name)
            for name in ("leg", "reach", "ankle_height", "hip_width", *sole)
        },
        mass=8.0 * LEGS.mass,
        stiffness=16.0 * LEGS.stiffness,
    )
    large, root = derive_gains(double), math.sqrt(2.0)
    for name in ("dead_zone", "far_zone", "landing_reach", "foot_zmp"):
        expected = 2.0 * np.array(getattr(GAINS, name))
        np.testing.assert_allclose(getattr(large, name), expected, err_msg=name)
    for name in ("sole_margin", "narrowest"):
        assert getattr(large, name) == pytest.approx(2.0 * getattr(GAINS, name))
    for name in ("fixed_s", "shortest_s"):
        assert getattr(large, name) == pytest.approx(root * getattr(GAINS, name))
    np.testing.assert_allclose(large.follow, np.array(GAINS.follow) / root)
    assert large.swing_speed == pytest.approx(root * GAINS.swing_speed)
    np.testing.assert_allclose(large.ankle, GAINS.ankle)


def test_a_gain_is_declared_in_one_place():
    """Each has a value for a robot; those of the feedback are off in an open loop."""
    blind = open_loop(GAINS)
    for name, declared in Gains._field_defaults.items():
        hint = type(getattr(GAINS, name))
        assert isinstance(getattr(blind, name), hint), name
        kept = getattr(blind, name) == getattr(GAINS, name)
        assert kept == (declared.open_loop is None), name
    factors = {"ankle": 2.0, "trunk": 0.5}
    more = derive_gains(LEGS, factors)
    np.testing.assert_allclose(more.ankle, 2.0 * np.array(GAINS.ankle))
    assert more == GAINS._replace(ankle=more.ankle, trunk=0.5 * GAINS.trunk)
    with pytest.raises(CommandError, match="hold is no gain; there are dead_zone"):
        derive_gains(LEGS, {"hold": 2.0})


@pytest.mark.parametrize("part", [0.2, 0.9])
def test_shortly_before_touch_down_the_landing_stays(part):
    """Pushed hard, in the last moments the foot goes where it was going."""
    before = Foot(0.05, -0.2, 0.0)
    time_s = TIMES.single - part * GAINS.fixed_s
    plan = planned(GAINS, TARGET, (0.3, -0.3), time_s, before)
    assert plan.landing == before
    assert plan.rate == 1.0
    earlier = planned(GAINS, TARGET, (0.3, -0.3), time_s - GAINS.fixed_s, before)
    assert earlier.landing != before


def test_the_exchange_of_feet_moves_nothing():
    """Pelvis, speed, ZMP, error and headings are the same, seen from the other foot."""
    before = GaitState(
        phase=DOUBLE,
        time=TIMES.step,
        pelvis=Pelvis(0.05, -0.08, 0.4, -0.2),
        pelvis_yaw=0.06,
        landing=Foot(0.14, -0.22, 0.13),
        zmp=Planar(0.02, -0.05),
        error=Planar(0.03, -0.01),
    )
    after = seen_from(before.landing, before)
    assert after.side == -before.side

    # The left foot supported: its frame is the world's, y to the left. The right one
    # stands at the landing, turned clockwise, its own y to the right.
    c, s = math.cos(before.landing.yaw), math.sin(before.landing.yaw)

    def way(x, y):
        return c * x - s * y, -(c * y + s * x)

    def place(x, y):
        dx, dy = way(x, y)
        return before.landing.x + dx, before.landing.y + dy

    close = {"abs": 1e-12}
    assert place(*after.pelvis[:2]) == pytest.approx(before.pelvis[:2], **close)
    assert place(*after.zmp) == pytest.approx(before.zmp, **close)
    assert way(*after.pelvis[2:]) == pytest.approx(before.pelvis[2:], **close)
    assert way(*after.error) == pytest.approx(before.error, **close)
    assert place(*after.lift_off[:2]) == pytest.approx((0.0, 0.0), **close)
    assert after.lift_off.yaw == pytest.approx(before.landing.yaw, **close)
    # Both measured outward: the two add up to the turn between the feet.
    turned = after.pelvis_yaw + before.pelvis_yaw
    assert turned == pytest.approx(before.landing.yaw, **close)


PARTS = (0.53, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1)


def least_moved(dcm, time, aim, end, span):
    """How far the landing must move at least, over a fine grid of ZMPs."""
    growth, old, new = double_support_map(TIMES.omega, DOUBLE_S)
    zmps = np.linspace(*span, 4001)
    touch_down = zmps + (dcm - zmps) * math.exp(TIMES.omega * time)
    # The end of double support, growth xi + old p + new (l + z), is at l + end.dcm.
    reached = growth * touch_down + old * zmps + new * end.zmp
    places = (reached - end.dcm) / (1.0 - new)
    return float(np.abs(places - aim).min())


@settings(max_examples=60)
@given(TARGETS, DCMS, numbers(0.0, 0.25))
def test_no_other_time_of_touch_down_would_cost_less(target, dcm, time_s):
    left = TIMES.single - time_s
    plan = planned(FREE, target, dcm, time_s)
    ends = step_ends(target, FREE, TIMES)
    aims = target.length, -target.width

    def cost(time):
        axes = zip(dcm, aims, ends, bounds(FREE), strict=True)
        moved = [least_moved(x, time, aim, end, span) for x, aim, end, span in axes]
        weight = FREE.later if time > left else FREE.sooner
        delay = (time - left) / TIMES.single
        return (math.hypot(*moved) / LEGS.leg) ** 2 + weight * delay**2

    times = [max(part * left, min(FREE.shortest_s, left)) for part in PARTS]
    assert cost(left / plan.rate) <= min(map(cost, times)) + 1e-4


@settings(max_examples=60)
@given(TARGETS, DCMS, numbers(0.05, 0.25))
def test_a_landing_is_within_the_swing_foots_reach_until_then(target, dcm, time_s):
    slow = GAINS._replace(swing_speed=0.4, landing_reach=FAR, fixed_s=-1.0)
    at_once = TIMES._replace(period=100.0)  # so far the landing moves each period
    state = GaitState(
        SINGLE,
        time=time_s,
        lift_off=Foot(-0.1, -0.2),
        landing=Foot(target.length, -target.width, target.turn),
        first_zmp=NOT_YET,
    )
    walk = walk_record(slow, at_once, target=target, state=state)
    x, y, _, _ = swing_foot(LEGS, walk)
    plan = plan_single(LEGS, walk, at_dcm(dcm))
    far = slow.swing_speed * (TIMES.single - time_s) / plan.rate + 1e-9
    assert abs(plan.landing.x - x) <= far
    assert abs(plan.landing.y - y) <= far
