"""The stride generator: commands in range, stops, motion carried over, mirrored."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from verdicts import PASSED

from gaitchain.chain.layered_chain import LayeredChain
from gaitchain.errors import CommandError, LibraryError
from gaitchain.gait.build_config import BuildConfig
from gaitchain.gait.family import STAND
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.step_target import Landing, Step
from gaitchain.gait.stride.draw import draw_strides
from gaitchain.gait.stride.presets import STRIDE_PRESETS
from gaitchain.gait.stride.shape import StrideShape
from gaitchain.gait.stride.strides import StridePoses
from gaitchain.messages import Command
from gaitchain.robot.box_robot import load_box_robot
from gaitchain.walker.generator import ChainState
from gaitchain.walker.policy_table import pair_costs, safe_pairs, steps_to_stand
from gaitchain.walker.stride_generator import StrideGenerator, _hasty_stops

RES = load_box_robot("res")
WIDTH = RES.reduced.hip_width
TIMING = StrideShape().timing(RES)
STEP_S = TIMING.step
COMMANDS = st.builds(
    Command, st.floats(-2, 2), st.floats(-1, 1), st.floats(-3, 3)
) | st.just(Command())


def invented(passes, poses, seed=0):
    """A library over given strides: random costs, verdicts as given."""
    rng = np.random.default_rng(seed)
    costs = tuple(rng.random(size) for size in pairwise(poses.counts))
    return GaitLibrary(
        poses=poses,
        timing=TIMING,
        chain=LayeredChain.uniform(poses.counts),
        edge_costs=costs,
        path_costs=costs,
        pair_advance=np.zeros(passes.shape),
        pair_error=np.zeros(passes.shape),
        pair_slip=np.zeros(passes.shape),
        pair_runs=np.ones(passes.shape, dtype=np.int64),
        pair_passes=passes.astype(np.int64),
        config=BuildConfig(),
        qualification=PASSED,
    )


def drawn(strides):
    return draw_strides(RES, "brisk", strides)


def all_pairs(count):
    passes = np.ones((count, count), dtype=bool)
    passes[STAND, STAND] = False
    return passes


@pytest.fixture(scope="module")
def full():
    """Every stride of the preset, each after each."""
    poses = drawn(STRIDE_PRESETS["brisk"].most)
    return StrideGenerator(invented(all_pairs(poses.counts[0]), poses))


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_first_foot_is_that_of_the_side_to_which_the_feet_go(full, side):
    """A turn carries the outer foot by the stance, of whatever robot."""
    half = 0.5 * side
    for part, left in ((1.1, side < 0.0), (0.9, side > 0.0)):
        command = Command(0.0, -part * half * full.stance, half)
        assert full.first_support(command) != left


def one_step(generator, state, command, made=None):
    """Advance through a whole step; return the state after it and where it landed."""
    state, _ = generator.advance(state, command, made=made)
    landing, side = generator.landing(state), 1.0 if state.left_support else -1.0
    target = state.target
    while state.layer:
        state, decision = generator.advance(state, command)
    assert decision.pose == target
    made = Step(landing.length, -side * (landing.outward + WIDTH), -side * landing.turn)
    return state, made


class Feet:
    """Both feet on the ground, stepping exactly."""

    def __init__(self):
        self.feet = {True: (0.0, 0.5 * WIDTH, 0.0), False: (0.0, -0.5 * WIDTH, 0.0)}

    def make(self, step, left_support):
        x, y, yaw = self.feet[left_support]
        c, s = math.cos(yaw), math.sin(yaw)
        self.feet[not left_support] = (
            x + c * step.ahead - s * step.left,
            y + s * step.ahead + c * step.left,
            yaw + step.turn,
        )

    @property
    def middle(self):
        return np.mean([self.feet[True], self.feet[False]], axis=0)


def part(value, low, high):
    most = high if value > 0.0 else low
    return value / most if value else 0.0


def share(generator, command):
    """Part of the most that a command asks for, all axes together."""
    span = generator.library.command_range
    return (
        part(command.vx, *span.vx)
        + part(command.vy, *span.vy)
        + part(command.yaw_rate, *span.yaw_rate)
    )


@settings(max_examples=100)
@given(COMMANDS)
def test_clamping_is_a_projection(full, command):
    done, note = full.clamp(command)
    assert share(full, done) <= 1.0 + 1e-8
    again, second = full.clamp(done)
    assert (again, second) == (done, "")
    if share(full, command) <= 1.0:
        assert done == command
        assert note == ""
        return
    assert note
    # Of the same direction, and as much of it as there is.
    asked, given_ = (np.array([c.vx, c.vy, c.yaw_rate]) for c in (command, done))
    ratio = share(full, command)
    np.testing.assert_allclose(given_ * ratio, asked, rtol=1e-9, atol=1e-12)
    assert share(full, done) == pytest.approx(1.0)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("place", range(3))
def test_what_is_no_number_stops(full, bad, place):
    numbers = [0.1, 0.01, 0.1]
    numbers[place] = bad
    done, note = full.clamp(Command(*numbers))
    assert done == Command()
    assert "is no command: stop" in note


def test_a_way_that_the_library_has_not_stops():
    """Strides ahead alone: neither back nor sideways."""
    poses = drawn(12)
    ahead = np.flatnonzero((poses.strides >= 0.0).all(axis=1))
    ahead = ahead[(poses.strides[ahead, 1:] == 0.0).all(axis=1)]
    forward = poses.keep([ahead, np.arange(1), np.arange(1), ahead])
    generator = StrideGenerator(invented(all_pairs(len(ahead)), forward))
    for command in (Command(-0.1), Command(0.1, 0.01), Command(0.1, 0.0, -0.1)):
        done, note = generator.clamp(command)
        assert done == Command()
        assert "no such way" in note
    assert generator.clamp(Command(0.1)) == (Command(0.1), "")


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1), st.lists(COMMANDS, min_size=1, max_size=8))
def test_a_stop_reaches_the_stand_as_soon_as_it_can(seed, commands):
    """From any state that commands lead to, over any verdicts of physics."""
    rng = np.random.default_rng(seed)
    poses = drawn(12)
    passes = rng.random((12, 12)) < 0.3
    passes[STAND, 2] = passes[2, 2] = True
    passes[2, 1:] |= rng.random(11) < 0.5
    library = invented(passes, poses, seed)
    allowed, _ = safe_pairs(library)
    assume(allowed[STAND].any() and library.command_range.vx[1] > 0.0)
    without_haste = allowed.copy()
    without_haste[_hasty_stops(poses.strides, allowed), STAND] = False
    distance = steps_to_stand(without_haste)
    generator = StrideGenerator(library)
    state, made = ChainState(), None
    for command in commands:
        before = state.pose
        state, made = one_step(generator, state, generator.clamp(command)[0], made)
        assert allowed[before, state.pose], "physics never passed this step"
        if state.pose == STAND:
            state, made = ChainState(left_support=state.left_support), None
    steps, needed = 0, int(distance[state.pose])
    assert needed <= 12
    while state.pose != STAND:
        state, made = one_step(generator, state, Command(), made)
        steps += 1
        assert steps <= needed
    assert steps == needed


@settings(max_examples=30)
@given(st.tuples(*[st.floats(-1.0, 1.0)] * 3), st.booleans())
def test_the_step_expected_next_is_the_one_that_follows(full, parts, left):
    command = full.clamp(Command(*parts))[0]
    state, made = ChainState(left_support=left), None
    for _ in range(6):
        inside, _ = full.advance(state, command, made=made)
        expected = full.expected_next(inside, command)
        state, made = one_step(full, state, command, made)
        following, _ = full.advance(state, command, made=made)
        assert full.landing(following) == pytest.approx(expected, abs=1e-9)


def walk(generator, command, steps):
    """Perfect steps from a stand; motion of the feet's middle in its own heading."""
    state = ChainState(left_support=generator.first_support(command))
    feet, made, owed, middles = Feet(), None, [], []
    for _ in range(steps):
        left_support = state.left_support
        state, made = one_step(generator, state, command, made)
        owed.append(state.owed)
        feet.make(made, left_support)
        middles.append(feet.middle)
    middles = np.array(middles)
    moved = np.diff(middles, axis=0)
    facing = 0.5 * (middles[1:, 2] + middles[:-1, 2])
    c, s = np.cos(facing), np.sin(facing)
    ahead = c * moved[:, 0] + s * moved[:, 1]
    left = c * moved[:, 1] - s * moved[:, 0]
    return np.column_stack([ahead, left, moved[:, 2]]), np.array(owed)


def biased_walk(generator, command, steps, **bias):
    """Residual of steps that are off what was meant in the same way each time."""
    state, made, owed = ChainState(), None, []
    for _ in range(steps):
        state, made = one_step(generator, state, command, made)
        made = made._replace(**{k: getattr(made, k) + b for k, b in bias.items()})
        owed.append(state.owed)
    return np.array(owed), state


@pytest.mark.parametrize(
    ("axis", "bias", "most"), [(0, {"ahead": 0.01}, 0.02), (2, {"turn": 0.03}, 0.05)]
)
def test_what_each_stride_misses_is_learned(full, axis, bias, most):
    """The part that one step corrects would leave five times that for good."""
    command = Command(0.8 * full.library.command_range.vx[1])
    owed, state = biased_walk(full, command, 80, **bias)
    assert np.abs(owed[:, axis]).max() > most
    assert np.abs(owed[60:, axis]).mean() < 0.4 * most
    assert state.missed[axis] < 0.0


def test_steps_in_place_teach_nothing_about_strides(full):
    _, state = biased_walk(full, Command(yaw_rate=0.3), 20, turn=0.03)
    assert state.missed == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("lasted", [0.8, 1.3])
def test_a_step_that_lasts_longer_is_to_go_further(full, lasted):
    """A command is a speed: 30 % more time asks for 30 % more way."""
    command = Command(0.5 * full.library.command_range.vx[1])
    state, made = one_step(full, ChainState(), command)
    state, made = one_step(full, state, command, made)
    on_time, _ = full.advance(state, command, made=made)
    late, _ = full.advance(state, command, made=made._replace(lasted=lasted))
    more = late.owed[0] - on_time.owed[0]
    assert more == pytest.approx((lasted - 1.0) * state.asked[0])


def inner(generator, shares, signs):
    """A command that asks for given parts of the most, in given directions."""
    span = generator.library.command_range
    ends = (span.vx, span.vy, span.yaw_rate)
    return Command(
        *(
            p * end[1 if sign else 0]
            for p, end, sign in zip(shares, ends, signs, strict=True)
        )
    )


SHARES = (
    st.tuples(*[st.integers(0, 20)] * 3)
    .map(np.array)
    .filter(lambda a: a.sum() > 0)
    .map(lambda a: 0.8 * a / max(a.sum(), 20))
)
SIGNS = st.tuples(*[st.booleans()] * 3)


@settings(max_examples=40)
@given(SHARES, SIGNS)
def test_perfect_steps_walk_what_was_asked_on_average(full, shares, signs):
    """What one step cannot make, the next ones do: what is owed stays bounded."""
    command = inner(full, shares, signs)
    motion, owed = walk(full, command, 80)
    asked = np.array([command.vx, command.vy, command.yaw_rate]) * STEP_S
    leg = RES.reduced.leg_length
    assert (np.abs(owed) <= np.array([0.5 * leg, 0.5 * leg, 0.5]) + 1e-9).all()
    # A cycle of two steps is one motion; the first ones leave the stand.
    mean = motion[9:].mean(axis=0)
    off = np.abs(mean - asked) / np.array([leg, leg, 1.0])
    assert off.max() < 0.01, (command, mean / STEP_S)


@settings(max_examples=25)
@given(SHARES, SIGNS)
def test_the_mirrored_command_walks_the_mirrored_way(full, shares, signs):
    command = inner(full, shares, signs)
    mirrored = Command(command.vx, -command.vy, -command.yaw_rate)
    state = ChainState(left_support=True)
    image = ChainState(left_support=False)
    made = made_too = None
    for _ in range(12):
        state, made = one_step(full, state, command, made)
        image, made_too = one_step(full, image, mirrored, made_too)
        assert (image.target, image.pose) == (state.target, state.pose)
        assert image.left_support is not state.left_support
        np.testing.assert_allclose(
            made_too[:3], np.array(made[:3]) * [1.0, -1.0, -1.0], atol=1e-12
        )


def test_the_foot_on_the_way_goes_first(full):
    """Side steps: the left foot first to the left, so that the right one supports."""
    assert full.first_support(Command(0.0, 0.1)) is False
    assert full.first_support(Command(0.0, -0.1)) is True
    assert full.first_support(Command(0.0, 0.0, 0.5)) is False
    assert full.first_support(Command(0.2)) is True


def test_what_a_step_fell_short_of_is_made_up(full):
    """A foot that landed 3 cm behind: a fifth of that is asked of the next one.

    A little more, as one step already teaches what strides miss.
    """
    command = inner(full, (0.3, 0.0, 0.0), (True, True, True))
    state, made = one_step(full, ChainState(), command)
    for _ in range(4):
        state, made = one_step(full, state, command, made)
    exact, _ = full.advance(state, command, made=made)
    short, _ = full.advance(state, command, made=made._replace(ahead=made.ahead - 0.03))
    assert short.owed[0] - exact.owed[0] == pytest.approx(0.03)
    more = short.landing.length - exact.landing.length
    assert 0.2 * 0.03 < more < 0.23 * 0.03


def test_a_turn_that_was_not_made_is_made_up(full):
    command = inner(full, (0.2, 0.0, 0.0), (True, True, True))
    state, made = one_step(full, ChainState(), command)
    state, made = one_step(full, state, command, made)
    side = 1.0 if state.left_support else -1.0
    exact, _ = full.advance(state, command, made=made)
    off, _ = full.advance(state, command, made=made._replace(turn=made.turn + 0.05))
    assert off.owed[2] - exact.owed[2] == pytest.approx(-0.05)
    more = off.landing.turn - exact.landing.turn
    assert more == pytest.approx(0.2 * side * 0.05, abs=1e-3)


@pytest.mark.parametrize("steps", [4, 5])
def test_a_wide_landing_is_answered_by_a_fifth_as_wide_a_one(full, steps):
    """Answered by as wide a one, a sway that began would never end."""
    command = inner(full, (0.2, 0.0, 0.0), (True, True, True))
    state, made = ChainState(), None
    for _ in range(steps):
        state, made = one_step(full, state, command, made)
    out = math.copysign(0.03, made.left)
    exact, _ = full.advance(state, command, made=made)
    wide, _ = full.advance(state, command, made=made._replace(left=made.left + out))
    assert wide.owed[1] - exact.owed[1] == pytest.approx(-out)
    assert wide.landing.outward - exact.landing.outward == pytest.approx(0.2 * 0.03)


@settings(max_examples=40)
@given(COMMANDS, st.integers(0, 39))
def test_a_landing_is_trimmed_within_its_cell(full, command, pose):
    """Never beyond the strides themselves, nor nearer to the next one."""
    strides = full.library.poses.strides
    state = ChainState(pose=pose if pose < len(strides) else STAND)
    state, _ = full.advance(state, full.clamp(command)[0])
    landing = np.array(full.landing(state))
    stride = strides[state.target]
    assert (landing >= strides.min(axis=0) - 1e-12).all()
    assert (landing <= strides.max(axis=0) + 1e-12).all()
    for axis in range(3):
        values = np.unique(strides[:, axis])
        nearest = values[
            np.abs(values - landing[axis])
            <= 1e-9 + np.abs(values - landing[axis]).min()
        ]
        assert np.isclose(nearest, stride[axis]).any()
    if state.target == STAND:
        np.testing.assert_array_equal(landing, stride)


@pytest.mark.parametrize("seed", range(5))
def test_places_for_steps_are_met_by_the_nearest_strides_in_turn(full, seed):
    """By the definition, stride by stride: a tenth of the tolerance costs 1."""
    t, rng = full.tables, np.random.default_rng(seed)
    places = t.strides[rng.integers(len(t.strides), size=6)]
    places = places + rng.normal(size=places.shape) * t.tolerance
    pose = STAND
    for number, made in enumerate(full.nearest_in_turn([Landing(*p) for p in places])):
        best, wanted = (math.inf, STAND, ()), places[number]
        for stride, (low, high) in enumerate(zip(*t.cell, strict=True)):
            ends = np.isfinite(t.path_cost[stride, STAND]) or number < len(places) - 1
            lands = t.strides[STAND] if stride == STAND else np.clip(wanted, low, high)
            miss = float((((lands - wanted) / (0.1 * t.tolerance)) ** 2).sum())
            cost = t.path_cost[pose, stride] + miss
            if ends and cost < best[0]:
                best = cost, stride, tuple(lands.tolist())
        assert made == pytest.approx(best[2])
        pose = best[1]


@settings(max_examples=50)
@given(st.tuples(*[st.floats(-1.0, 1.0)] * 3))
def test_the_strides_that_a_step_may_end_in_are_told(full, parts):
    """The chosen one first, then by cost; the others are further from the command."""
    command = full.clamp(Command(*parts))[0]
    assume(not command.stops)
    state, decision = full.advance(ChainState(), command)
    (chosen, least), *others = decision.ends
    assert chosen == decision.target == state.target
    assert len(others) == 4
    costs = [least, *(cost for _, cost in others)]
    assert costs == sorted(costs)
    ways = pair_costs(full.library)
    leg = RES.reduced.leg_length
    for end, cost in decision.ends:
        off = (full.library.poses.strides[end] - state.landing) / (leg, leg, 1.0)
        distance = np.sum((off / (0.05, 0.05, 0.1)) ** 2)
        assert cost == pytest.approx(ways[STAND, end] + distance)
    later, decision = full.advance(state, command)
    assert decision.ends == later.ends == state.ends, "it holds for the whole step"


@pytest.mark.parametrize("pose", [1, 3, 7])
def test_a_stop_is_the_commands_alone(full, pose):
    """From any stride, one step or several before the stand."""
    state = ChainState(pose=pose)
    assert full.advance(state, Command(0.2))[1].ends
    assert full.advance(state, Command())[1].ends == ()


def test_the_same_state_and_command_give_the_same_choice(full):
    state = ChainState(pose=3, owed=(0.02, 0.0, 0.1), asked=(0.1, 0.0, 0.0))
    made = Step(0.08, 0.21, 0.01)
    first = full.advance(state, Command(0.2, 0.01), made=made)
    again = full.advance(state, Command(0.2, 0.01), made=made)
    assert first == again
    assert state == ChainState(pose=3, owed=(0.02, 0.0, 0.1), asked=(0.1, 0.0, 0.0))


def test_libraries_without_a_walk_are_refused(library):
    poses = drawn(6)
    nothing = np.zeros((6, 6), dtype=bool)
    with pytest.raises(LibraryError, match="holds no walk"):
        StrideGenerator(invented(nothing, poses))
    no_end = nothing.copy()
    no_end[STAND, 2] = no_end[2, 2] = True
    with pytest.raises(LibraryError, match="holds no walk"):
        StrideGenerator(invented(no_end, poses))
    with pytest.raises(LibraryError, match="needs strides"):
        StrideGenerator(library)


def test_where_no_way_leads_on_it_says_so():
    one = drawn(6)
    strides, passing, landing, _ = one.parameters
    two = strides, np.repeat(passing, 2, axis=0), landing, strides
    poses = replace(one, parameters=two)
    costs = invented(all_pairs(6), poses).path_costs
    closed = tuple(np.array(c) for c in costs)
    closed[1][0] = np.inf  # no landing after the first passing
    library = invented(all_pairs(6), poses)
    generator = StrideGenerator(replace(library, path_costs=closed))
    state, _ = generator.advance(ChainState(), Command(0.2))
    with pytest.raises(CommandError, match="no way leads from pose 0 of layer 2"):
        generator.advance(replace(state, pose=0), Command(0.2))


def test_poses_are_checked_and_frozen():
    poses = drawn(6)
    with pytest.raises(ValueError, match="read-only"):
        poses.strides[0, 0] = 1.0
    with pytest.raises(ValueError, match="a layer has shape"):
        StridePoses(RES, 0.5, (*poses.parameters[:3], np.zeros((6, 2))))
    kept = poses.keep(
        [np.array([0, 2]), np.array([0]), np.array([0]), np.array([0, 2])]
    )
    assert kept.counts == (2, 1, 1, 2)
    goal = kept.step_target(0, 0, 1)
    assert goal.length == poses.strides[2, 0] == kept.step_lengths[1]
    assert goal.width == WIDTH + poses.strides[2, 1]
    assert (goal.share, goal.share_rate, goal.lift) == tuple(poses.parameters[1][0])
    assert goal.stops == 0.0
    assert kept.step_target(0, 0, STAND).stops == 1.0


def test_strides_lie_inside_the_polytope_of_their_mosts():
    """Standing first, in place second, and every corner among them."""
    strides = drawn(STRIDE_PRESETS["brisk"].most).strides
    np.testing.assert_array_equal(strides[:2], 0.0)
    most, least = strides.max(axis=0), strides.min(axis=0)
    scale = np.where(strides > 0.0, most, np.where(least < 0.0, -least, 1.0))
    assert (np.abs(strides / scale).sum(axis=1) <= 1.011).all()
    assert len(np.unique(strides[1:], axis=0)) == len(strides) - 1
    assert (strides[:, 1] >= 0.0).all()  # the feet never cross


def test_a_stop_from_a_long_stride_takes_a_shorter_one_first():
    lengths = np.array([0.0, 0.0, 0.1, 0.3, -0.25])
    strides = lengths[:, None] * np.array([1.0, 0.0, 0.0])
    every = np.ones((5, 5), dtype=bool)
    every[STAND, STAND] = False
    np.testing.assert_array_equal(_hasty_stops(strides, every), [0, 0, 0, 1, 1])
    alone = every.copy()
    alone[3, :3] = [True, False, False]  # it stops at once, or not at all
    np.testing.assert_array_equal(_hasty_stops(strides, alone), [0, 0, 0, 0, 1])
