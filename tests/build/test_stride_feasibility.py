"""Which pairs of strides the plan can carry out, by leg, sole and joint speed."""

import math
import re
from dataclasses import astuple, replace
from itertools import pairwise

import numpy as np
import pytest
from other_robots import resized

from gaitchain.balance.state import DOUBLE, SETTLE, SHIFT, SINGLE
from gaitchain.balance.walk_controller import rehearse
from gaitchain.build.stride_feasibility import (
    feasible_pairs,
    feasible_walk,
    first_fault,
    furthest_strides,
)
from gaitchain.gait.family import STAND
from gaitchain.gait.motion import Timing
from gaitchain.gait.stride.draw import draw_strides
from gaitchain.gait.stride.presets import Reach
from gaitchain.gait.stride.shape import StrideShape
from gaitchain.gait.stride.strides import StridePoses
from gaitchain.messages import GRAVITY, Sensors
from gaitchain.robot.box_robot import load_box_robot
from gaitchain.walker.stride_setup import make_walk

RES = load_box_robot("res")
LEG = RES.reduced.leg_length
SHAPE = StrideShape()
TIMING = SHAPE.timing(RES)
SHAPES = np.array([[0.5, 1.4, 0.066 * LEG]]), np.array([[0.0, 0.05]])
IN_PLACE = 1


def strided(*strides):
    """Standing, stepping in place, and some more."""
    rows = np.array([(0.0, 0.0, 0.0), (0.0, 0.0, 0.0), *strides])
    return StridePoses(RES, SHAPE.hip_height * LEG, (rows, *SHAPES, rows))


def test_a_stride_longer_than_the_leg_is_not_feasible():
    poses = strided((0.1 * LEG, 0.0, 0.0), (1.4 * LEG, 0.0, 0.0))
    allowed = feasible_pairs(poses, TIMING, math.inf)
    assert allowed.shape == (4, 4)
    assert not allowed[:, 3].any()
    assert allowed[:3, :3][~np.eye(3, dtype=bool)].all()
    assert allowed[IN_PLACE, IN_PLACE]
    assert allowed[2, 2]


def test_only_the_wanted_pairs_are_checked():
    poses = strided((0.1 * LEG, 0.0, 0.0), (0.2 * LEG, 0.1 * LEG, 0.0))
    every = feasible_pairs(poses, TIMING, math.inf)
    wanted = np.zeros((4, 4), dtype=bool)
    wanted[[0, 1, 2, 3], [1, 2, 0, 2]] = True
    some = feasible_pairs(poses, TIMING, math.inf, wanted)
    np.testing.assert_array_equal(some, every & wanted)
    assert some.any()


def test_other_ways_that_no_leg_goes():
    """Far back, far aside, and turned beyond a joint's range: none ends there."""
    poses = strided((-1.6 * LEG, 0.0, 0.0), (0.0, LEG, 0.0), (0.0, 0.0, 3.0))
    allowed = feasible_pairs(poses, TIMING, math.inf)
    assert not allowed[:, 2:].any()
    assert allowed[STAND, IN_PLACE]


def test_what_keeps_a_robot_from_its_shortest_step_is_named():
    poses = strided((0.1 * LEG, 0.0, 0.0))
    assert first_fault(poses, TIMING, math.inf) == ""
    slow = first_fault(poses, TIMING, math.radians(20.0))
    assert re.fullmatch(r"\w+ would have to move at \d.\d\d rad/s, .* is 0.35", slow)
    rows = np.array([(0.0, 0.0, 0.0), (1.4 * LEG, 0.0, 0.0)])
    far = StridePoses(RES, SHAPE.hip_height * LEG, (rows, *SHAPES, rows))
    assert re.search("straight|range|ZMP", first_fault(far, TIMING, math.inf))


@pytest.mark.parametrize(
    ("length", "limit", "held"),
    [
        (0.3, math.inf, True),
        (0.6, math.inf, True),
        (1.4, math.inf, False),
        (0.3, 2.6, True),
        (0.6, 2.6, False),
    ],
)
def test_a_walk_is_feasible_where_its_pairs_are(length, limit, held):
    poses = strided(*2 * [(length * LEG, 0.0, 0.0)], (0.5 * length * LEG, 0.0, 0.0))
    lasts = [4, 2, 3, 2, 3, 4, 0]
    gaits = np.array([(a, 0, 0, b) for a, b in pairwise([0, *lasts])])
    wanted = np.zeros((5, 5), dtype=bool)
    wanted[gaits[:, 0], gaits[:, 3]] = True
    pairs = feasible_pairs(poses, TIMING, limit, wanted)
    assert feasible_walk(poses, TIMING, gaits, limit) == held
    assert pairs[wanted].all() == held


def test_nobody_stands_from_standing():
    allowed = feasible_pairs(strided((0.1, 0.0, 0.0)), TIMING, math.inf)
    assert not allowed[STAND, STAND]
    assert allowed[STAND, 1:].all()
    assert allowed[1:, STAND].all()


MOST = Reach(ahead=0.7, back=0.3, outward=0.5, turn_out=0.8, turn_in=0.3)


@pytest.mark.slow
@pytest.mark.parametrize("limit", [math.inf, math.radians(150.0)])
def test_the_furthest_strides_are_the_last_that_repeat_themselves(limit):
    found = furthest_strides(RES, SHAPE, TIMING, limit, MOST)
    ways = {"ahead": (LEG, 0.0, 0.0), "back": (-LEG, 0.0, 0.0)}
    ways |= {"outward": (0.0, LEG, 0.0), "turn_out": (0.0, 0.0, 1.0)}
    for name, way in ways.items():
        held, most = getattr(found, name), getattr(MOST, name)
        assert held > 0.0
        for part in (held, held + most / 26):
            allowed = feasible_pairs(strided(part * np.array(way)), TIMING, limit)
            again = allowed[2, 2] if way[0] else allowed[IN_PLACE, 2]
            if part == held:
                assert again
            elif part <= most:
                assert not (again and (way[0] or allowed[2, IN_PLACE]))


@pytest.mark.slow
def test_a_step_aside_needs_no_wide_sole_where_it_is_expected():
    """The step before it lands so that the DCM is already on its way."""
    narrow = resized(RES, sole_width=0.03)
    timing = StrideShape(step_s=0.36).timing(narrow)
    found = furthest_strides(narrow, SHAPE, timing, math.inf, MOST)
    walk = make_walk(replace(strided(), robot=narrow), timing)
    growth = math.exp(walk.times.omega * timing.step)
    inside = 0.5 * narrow.reduced.sole_width - walk.gains.sole_margin
    unexpected = inside * (growth - 1.0)  # the ZMP at the edge of the sole
    assert found.outward * LEG > 2.5 * unexpected


@pytest.mark.slow
def test_feet_turn_until_their_soles_would_overlap():
    """Against the corners of both soles: heels outward, toes inward."""
    wide = resized(RES, sole_width=0.19)
    found = furthest_strides(wide, SHAPE, TIMING, math.inf, MOST)
    rear, front = wide.reduced.sole_x
    half = 0.5 * wide.reduced.sole_width
    corners = np.array([(x, y) for x in (rear, front) for y in (-half, half)])

    def gap(turn):
        """Between a left sole, turned to the left, and a right one that is not."""
        c, s = math.cos(turn), math.sin(turn)
        left = (corners @ np.array([[c, s], [-s, c]]))[:, 1].min()
        return wide.reduced.hip_width + left - half

    for turn, sign, most in (
        (found.turn_out, 1.0, MOST.turn_out),
        (found.turn_in, -1.0, MOST.turn_in),
    ):
        assert 0.0 < turn < most
        assert gap(sign * turn) >= 0.0
        # The next of the 26 turns up to the overlap would be beyond it.
        assert gap(sign * (turn + 0.02)) < 0.0


@pytest.mark.slow
def test_slower_joints_make_shorter_strides():
    ahead = [
        furthest_strides(RES, SHAPE, TIMING, math.radians(limit), MOST).ahead
        for limit in (60.0, 120.0, 240.0)
    ]
    assert ahead == sorted(ahead)
    assert ahead[0] < ahead[-1]


def test_who_can_make_no_stride_has_none():
    none = furthest_strides(RES, SHAPE, TIMING, 0.01, MOST)
    assert set(astuple(none)) == {0.0}


def test_narrow_soles_may_stop_with_the_feet_further_apart():
    """They cannot slow the DCM enough to bring it to rest between the feet."""
    narrow = resized(RES, sole_width=0.03)
    poses = replace(strided((0.05 * LEG, 0.0, 0.0)), robot=narrow)
    allowed = feasible_pairs(poses, StrideShape(step_s=0.36).timing(narrow), math.inf)
    assert allowed[IN_PLACE, STAND]
    assert allowed[2, STAND]


def test_short_soles_may_stop_with_one_foot_further_ahead():
    """What the ZMP cannot do, the landing does, twice: so the DCM ends in between."""
    short = resized(RES, sole_length=0.08)
    lengths = [0.122, 0.126, 0.128, 0.132]
    poses = strided(*((length * LEG, 0.0, 0.0) for length in lengths))
    allowed = feasible_pairs(replace(poses, robot=short), TIMING, math.inf)
    assert allowed[2:, STAND].tolist() == [True, True, True, False]
    ahead = [stop_ahead(short, length * LEG) for length in lengths]
    assert ahead == sorted(ahead)
    assert ahead[1] > 0.01 * LEG, "further than a step that goes on may be off"
    assert ahead[2] < 0.02 * LEG < ahead[3]


def stop_ahead(robot, length):
    """Walk some strides and stop; return how far the foot lands ahead of its place."""
    poses = replace(strided((length, 0.0, 0.0)), robot=robot)
    walk = make_walk(poses, TIMING, 0.01, feedback=False)
    walk.reset()
    walk.begin_shift(left_support=True)
    goals = poses.step_targets([(0, 0, 2)] * 4 + [(0, 0, STAND)])
    for _ in rehearse(walk, goals):
        if walk.phase == DOUBLE:
            landed = walk.state.landing.x
    return landed - goals[-1].length


@pytest.fixture(scope="module")
def small():
    return draw_strides(RES, "brisk", 9)


@pytest.mark.slow
def test_a_higher_speed_limit_forbids_nothing_more(small):
    limits = [math.radians(d) for d in (40.0, 80.0, 110.0, 150.0)]
    masks = [feasible_pairs(small, TIMING, limit) for limit in (*limits, math.inf)]
    for slow, fast in pairwise(masks):
        assert not (slow & ~fast).any()
    counts = [int(mask.sum()) for mask in masks]
    assert counts[0] == 0
    assert counts[0] < counts[-1]
    assert len(set(counts)) >= 3, counts


def test_a_slower_walk_asks_less_of_the_joints(small):
    limit = math.radians(100.0)
    slow = Timing(*(1.3 * t for t in (TIMING.step, TIMING.rise, TIMING.fall)))
    quick, calm = (feasible_pairs(small, t, limit) for t in (TIMING, slow))
    assert calm.sum() > quick.sum()


def test_the_verdicts_do_not_depend_on_the_order(small):
    """No state is carried from one pair to the next."""
    order = np.array([0, *np.random.default_rng(3).permutation(np.arange(1, 9))])
    shuffled = small.keep([order, np.array([0]), np.array([0]), order])
    limit = math.radians(120.0)
    np.testing.assert_array_equal(
        feasible_pairs(shuffled, TIMING, limit),
        feasible_pairs(small, TIMING, limit)[np.ix_(order, order)],
    )


def walked(poses, strides):
    """Walk strides without a robot; yield the walk, its joints, and the steps made."""
    walk, log = make_walk(poses, TIMING), []
    walk.begin_shift(left_support=True)
    targets = poses.step_targets([(0, 0, stride) for stride in strides])
    for joints in rehearse(walk, targets):
        if walk.step and (not log or log[-1][0] is not walk.step):
            log.append((walk.step, targets[len(log)]))
        yield walk, joints, log
    assert walk.phase == SETTLE
    still = np.zeros(3), np.array([0.0, 0.0, GRAVITY])
    while not walk.standing:
        joints = walk.reference
        walk.advance(Sensors(0.0, joints, np.zeros_like(joints), *still))
        yield walk, joints, log


def test_the_plan_alone_makes_the_strides_that_were_chosen():
    """Without disturbance every foot lands where the chain wanted it."""
    poses = strided((0.12, 0.0, 0.0), (0.0, 0.06, 0.0), (0.05, 0.0, 0.2))
    sides = 1.0
    for walk, _, steps in walked(poses, [2, 2, 3, IN_PLACE, 4, 2, 4, STAND]):
        log = steps
        if walk.state.phase in (SINGLE, DOUBLE):
            assert walk.state.landing[:2] == pytest.approx(
                (walk.target.length, -walk.target.width), abs=0.01
            )
    assert len(log) == 8
    for made, target in log:
        assert made.ahead == pytest.approx(target.length, abs=0.01)
        assert made.left == pytest.approx(-sides * target.width, abs=0.01)
        assert made.turn == pytest.approx(-sides * target.turn, abs=0.01)
        sides = -sides


def test_perfect_sensors_show_no_error():
    """The robot is where the reference is, but for what one period accelerates."""
    poses = strided((0.12, 0.0, 0.0), (0.0, 0.06, 0.0), (0.05, 0.0, 0.2))
    errors = [
        math.hypot(*walk.state.error)
        for walk, _, log in walked(poses, [2, 2, 3, IN_PLACE, 4, 2, 4, STAND])
        if log and walk.state.phase in (SINGLE, DOUBLE)  # from the second step on
    ]
    assert max(errors) < 0.025


def test_the_weight_shift_ends_at_the_speed_of_the_first_step():
    """The last period of the shift is a whole one: the joints go on as they went."""
    poses = strided((0.12, 0.0, 0.0))
    before, errors = None, []
    for walk, _, log in walked(poses, [2, STAND]):
        if not log and walk.state.phase == SINGLE:
            errors.append(math.hypot(*walk.state.error))
            if before == SHIFT:
                first = errors[-1]
        before = walk.state.phase
    assert first < 2.0 * np.median(errors) + 0.005


def test_the_reference_moves_without_a_jump():
    """From standing to standing, through every phase and exchange of feet."""
    poses = strided((0.12, 0.0, 0.0), (0.0, 0.06, 0.0), (0.05, 0.0, 0.2))
    before, fastest, phases = None, 0.0, set()
    for walk, _, _ in walked(poses, [2, 2, 3, IN_PLACE, 4, 2, 4, STAND]):
        phases.add(walk.state.phase)
        if before is not None:
            fastest = max(fastest, np.abs(walk.reference - before).max())
        before = walk.reference
    assert phases >= {SHIFT, SINGLE, DOUBLE, SETTLE}
    assert fastest / walk.times.period < 8.0  # rad/s
    np.testing.assert_allclose(walk.reference, walk.stand, atol=0.02)


def test_a_snapshot_takes_a_walk_up_again():
    poses = strided((0.12, 0.0, 0.0))
    steps = walked(poses, [2, 2, 2, STAND])
    for _ in range(150):
        walk, joints, _ = next(steps)
    moment = walk.snapshot()
    sensors = Sensors(0.0, joints, np.zeros(12), np.zeros(3), np.array([0.0, 0.0, 9.8]))
    first = [walk.advance(sensors) for _ in range(20)]
    walk.restore(moment)
    again = [walk.advance(sensors) for _ in range(20)]
    np.testing.assert_array_equal(first, again)
    walk.restore(moment)  # a snapshot is not used up
    np.testing.assert_array_equal(walk.advance(sensors), first[0])


def test_a_reset_walk_is_a_new_one():
    poses = strided((0.12, 0.0, 0.0))
    for walk, _, _ in walked(poses, [2, 2, STAND]):
        last = walk
    last.reset()
    new = make_walk(poses, TIMING)
    numbers = {"first_zmp": None, "heading": None}  # NaN is not equal to itself
    assert last.state._replace(**numbers) == new.state._replace(**numbers)
    np.testing.assert_array_equal(last.reference, new.reference)
    assert last.standing
    assert not last.wants_stride
