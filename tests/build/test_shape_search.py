"""The search for a step's shape: what it returns, tells and keeps to."""

import math
from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from other_robots import resized

from gaitchain.balance.gains import Gains
from gaitchain.build import search_walks, shape_search
from gaitchain.build.shape_search import search_shape
from gaitchain.build.shape_start import Plan, narrowest, stances
from gaitchain.build.stride import _rhythm
from gaitchain.build.workers import Crew
from gaitchain.gait.build_config import BuildConfig
from gaitchain.gait.stride.shape import BOX_SHAPE, LEG, MODEL_SHAPE, StrideShape
from gaitchain.messages import GRAVITY
from gaitchain.robot.box_robot import load_box_robot
from gaitchain.sim.world_range import WorldRange

RES = load_box_robot("res")
BIPED = RES.reduced
DEFAULT = StrideShape()
STEP_S = DEFAULT.timing(RES).step
ROUGH = WorldRange(model_error=0.1, push_ns=15.0)
DRAWN, HEATS = shape_search._DRAWN, shape_search._HEATS
WALKS = search_walks.WALKS
ROUND = sum(shapes * len(walks) for shapes, walks in HEATS)  # walks of a generation
FIRST = shape_search._FIRST  # walks before it, of a start without gains of its own
FINAL = 2 * len(WALKS)  # walks of a round once the search has ended
LAST = shape_search._FINALS * FINAL  # the most of them
HIPS = 0.82, 0.94


def as_given(robot, usual, rhythm, limit, workers):
    """Return what a plan says of legs that can do everything."""
    del robot, rhythm, limit, workers
    shapes = [replace(usual, hip_height=hip) for hip in HIPS]
    return Plan(usual, (usual, *shapes), (0.3, 0.3, 0.3))


def draw(seed=0):
    return np.random.default_rng(seed)


class Judge:
    """Stands in for physics: the part of its steps that a shape holds, by a rule."""

    def __init__(self, monkeypatch, rule):
        self.rule, self.seen, self.told, self.rhythms = rule, [], [], []
        monkeypatch.setattr(shape_search, "steps_held", self)
        monkeypatch.setattr(shape_search, "fits", lambda *task: True)
        monkeypatch.setattr(shape_search, "plan_of", as_given)
        monkeypatch.setattr(shape_search, "stances", lambda robot, usual: [usual])

    def __call__(self, robot, shape, timing, walk, pace, world):
        assert robot is RES
        self.rhythms.append(timing)
        self.seen.append((shape, walk, pace, world))
        return self.rule(shape, world)

    def search(self, generations, seed=0, **kwargs):
        def tell(stage, done, total):
            self.told.append((stage, done, total))

        self.generations = generations
        kwargs = {"start": DEFAULT} | kwargs
        crew = Crew(1, tell, ROUGH)
        found = search_shape(RES, draw(seed), crew, generations=generations, **kwargs)
        self.pace, self.others = found.pace, found.others
        return found.shape

    @property
    def shapes(self):
        """The shape of each walk, but for those that tell whose gains are better."""
        return [shape for shape, *_ in self.seen[FIRST:]]

    @property
    def rounds(self):
        """What was walked in each generation and each round of the finals."""
        ends = [FIRST + ROUND * i for i in range(self.generations + 1)]
        ends += range(ends[-1] + FINAL, len(self.seen) + 1, FINAL)
        return [self.seen[begin:end] for begin, end in pairwise(ends)]


def numbers(shape):
    names = "step_s", "hip_height", "lift", "share", "share_rate"
    own = {name: getattr(shape, name) for name in names}
    return own | dict(shape.balance)


def nearness(shape, world):
    """Best at a shape that is not the default, in any world."""
    del world
    off = abs(shape.step_s - 0.4) / 0.1 + abs(shape.hip_height - 0.9) / 0.05
    return 1.0 - 0.1 * off


def test_no_generations_keep_the_shape(monkeypatch):
    judge = Judge(monkeypatch, nearness)
    assert judge.search(0) == DEFAULT
    assert not judge.seen
    assert not judge.told


def test_it_finds_what_physics_prefers(monkeypatch):
    judge = Judge(monkeypatch, nearness)
    found = judge.search(5)
    assert nearness(found, None) > 0.95 > nearness(DEFAULT, None)


def test_it_searches_in_the_rhythm_that_is_built(monkeypatch):
    """A step time that is given is walked in the search, and not searched."""
    judge = Judge(monkeypatch, nearness)
    slow = partial(_rhythm, BuildConfig(preset="brisk", step_s=0.8), RES)
    found = judge.search(1, rhythm=slow)
    assert {timing.step for timing in judge.rhythms} == {0.8}
    assert {shape.step_s for shape in judge.shapes} == {DEFAULT.step_s}
    assert found.step_s == DEFAULT.step_s
    assert len({shape.hip_height for shape in judge.shapes}) > DRAWN / 2
    judge = Judge(monkeypatch, nearness)
    judge.search(1)
    assert judge.rhythms[FIRST:] == [shape.timing(RES) for shape in judge.shapes]
    assert len({shape.step_s for shape in judge.shapes}) > DRAWN / 2


def test_where_all_others_fall_the_shape_is_kept(monkeypatch):
    rule = Judge(monkeypatch, lambda shape, world: float(shape == DEFAULT))
    assert rule.search(2) == DEFAULT


def test_where_nothing_is_better_the_shape_is_kept(monkeypatch):
    assert Judge(monkeypatch, lambda shape, world: 1.0).search(2) == DEFAULT


def test_what_is_not_taken_is_left_to_try(monkeypatch):
    judge = Judge(monkeypatch, nearness)
    assert judge.search(2) != DEFAULT
    assert judge.others == (DEFAULT,)
    kept = Judge(monkeypatch, lambda shape, world: float(shape == DEFAULT))
    assert kept.search(2) == DEFAULT
    (found,) = kept.others
    assert found != DEFAULT


def test_the_best_other_stance_is_left_to_try(monkeypatch):
    """After what is in the stance that was searched."""
    parts = {1.0: 0.5, 0.9: 0.4, 0.8: 0.45}
    judge = Judge(monkeypatch, lambda shape, world: parts.get(shape.stance, 0.2))
    wide = [replace(DEFAULT, stance=stance) for stance in parts]
    monkeypatch.setattr(shape_search, "stances", lambda robot, usual: wide)
    assert judge.search(2).stance == 1.0
    assert [shape.stance for shape in judge.others] == [1.0, 0.8]


def test_worlds_of_its_own_decide(monkeypatch):
    """A shape that is better only where it was searched for is not taken."""
    judge = Judge(monkeypatch, nearness)
    judge.search(2)
    searched = judge.seen[: FIRST + 2 * ROUND]
    known = {world.seed for *_, world in searched}

    def only_there(shape, world):
        new = world.seed not in known
        return float(shape == DEFAULT) if new else nearness(shape, world)

    assert Judge(monkeypatch, only_there).search(2) == DEFAULT

    def only_elsewhere(shape, world):
        return nearness(shape, world) - 9.0 * (world.seed in known)

    assert Judge(monkeypatch, only_elsewhere).search(2) != DEFAULT


def test_shapes_of_a_generation_walk_in_the_same_worlds(monkeypatch):
    judge = Judge(monkeypatch, nearness)
    judge.search(2)
    assert len(judge.rounds) == 2 + 1
    seeds = set()
    for round_ in judge.rounds:
        worlds = {}
        for _, walk, _, world in round_:
            worlds.setdefault(id(walk), set()).add(world.seed)
        own = set().union(*worlds.values())
        assert len(own) == len(WALKS)
        assert not own & seeds, "and in new ones each time"
        seeds |= own


def test_from_heat_to_heat_the_better_shapes_go_on(monkeypatch):
    judge = Judge(monkeypatch, nearness)
    judge.search(1)
    (first, *finals), begin = judge.rounds, 0
    shapes = [shape for shape, *_ in first[: DRAWN * len(HEATS[0][1]) : 4]]
    ranked = sorted({nearness(shape, None) for shape in shapes}, reverse=True)
    for left, walks in HEATS:
        heat = first[begin : begin + left * len(walks)]
        begin += len(heat)
        assert [walk for _, walk, *_ in heat] == [WALKS[i] for i in walks] * left
        assert {nearness(s, None) for s, *_ in heat} == set(ranked[:left])
    assert sorted({i for _, walks in HEATS for i in walks}) == list(range(len(WALKS)))
    for final in finals:
        assert [walk for _, walk, *_ in final] == list(WALKS) * 2
        assert final[-1][0] == DEFAULT
    start = numbers(shapes[0])
    gains = {n: 1.0 for n in shape_search._RANGES if n in Gains._fields}
    assert start == gains | numbers(DEFAULT), "the first is the one begun with"


@pytest.mark.parametrize(("held", "factor"), [(1.0, 1.12), (0.6, 1.0)])
def test_the_pace_follows_what_the_shapes_hold(monkeypatch, held, factor):
    judge = Judge(monkeypatch, lambda shape, world: held)
    judge.search(3)
    paces = [round_[0][2] for round_ in judge.rounds]
    expected = [0.3 * factor**i for i in range(3 + 1)]
    assert paces == pytest.approx(expected)
    assert judge.pace == pytest.approx(expected[-1]), "what it just held"


@pytest.mark.parametrize(("held", "factor"), [(1.0, 1.12), (0.6, 1.0), (0.4, 0.87)])
def test_hard_pushes_follow_what_the_shapes_hold(monkeypatch, held, factor):
    """What all hold, or none, would not tell shapes apart."""
    monkeypatch.setattr(shape_search, "_HELD", 0.0)  # none begins slower
    judge = Judge(monkeypatch, lambda shape, world: held)
    judge.search(3)
    scale = BIPED.mass * math.sqrt(GRAVITY * LEG)
    pushes = [
        {
            world.push[0].impulse_ns / scale
            for _, walk, _, world in round_
            if walk.pushed
        }
        for round_ in judge.rounds
    ]
    expected = [[search_walks.PUSH * factor**i] for i in range(3 + 1)]
    assert [sorted(values) for values in pushes] == [
        pytest.approx(values) for values in expected
    ]


@pytest.mark.parametrize(("held", "factor"), [(0.59, 1.0), (0.49, 0.87), (0.2, 0.7)])
def test_a_robot_that_holds_little_begins_slower(monkeypatch, held, factor):
    judge = Judge(monkeypatch, lambda shape, world: held)
    judge.search(1)
    paces = [pace for _, _, pace, _ in judge.seen]
    begun = [0.3 * 0.7**i for i in range(4)]
    assert paces[: 4 * FIRST : FIRST] == pytest.approx(begun)
    assert paces[4 * FIRST] == pytest.approx(begun[-1])
    assert paces[-1] == pytest.approx(begun[-1] * factor)


def test_gains_as_they_are_derived_are_begun_with_where_they_hold_more(monkeypatch):
    start = StrideShape(balance={"trunk": 1.4})
    judge = Judge(monkeypatch, lambda shape, world: 0.5 + 0.3 * (not shape.balance))
    judge.search(1, start=start)
    walked = [dict(shape.balance) for shape, *_ in judge.seen[: 2 * FIRST]]
    assert walked == FIRST * [{"trunk": 1.4}] + FIRST * [{}]
    begun, *_ = judge.seen[2 * FIRST]
    assert begun.balance["trunk"] == 1.0


def test_feet_closer_together_are_begun_with_where_they_hold_clearly_more(monkeypatch):
    judge = Judge(monkeypatch, lambda shape, world: 0.3 + 0.5 * (shape.stance < 1.0))
    monkeypatch.setattr(shape_search, "stances", stances)
    judge.search(1)
    tried = [shape.stance for shape, *_ in judge.seen[: 2 * FIRST]]
    assert tried == FIRST * [1.0] + FIRST * [0.85], "soles of RES would touch at 0.7"
    searched = {shape.stance for shape, *_ in judge.seen[2 * FIRST :]}
    assert narrowest(RES) <= min(searched) < 0.85 < max(searched) <= 1.0


@pytest.mark.parametrize("gain", [-0.1, 0.9 * shape_search._CLEAR])
def test_a_stance_that_holds_about_as_much_is_not_searched(monkeypatch, gain):
    judge = Judge(monkeypatch, lambda shape, world: 0.7 + gain * (shape.stance < 1.0))
    monkeypatch.setattr(shape_search, "stances", stances)
    judge.search(1)
    assert {shape.stance for shape, *_ in judge.seen[2 * FIRST :]} == {1.0}


def test_without_time_no_generation_begins(monkeypatch):
    judge = Judge(monkeypatch, nearness)
    found = judge.search(3, seconds=-1.0)
    assert len(judge.seen) == FIRST + FINAL
    assert not judge.others
    for name, number in numbers(DEFAULT).items():
        assert numbers(found)[name] == number
    assert all(factor == 1.0 for factor in found.balance.values())
    stage, done, total = judge.told[-1]
    assert stage
    assert done == total


@settings(max_examples=15)
@given(st.integers(0, 2**32 - 1), st.integers(0, 2**32 - 1))
def test_ranges_are_respected_whatever_is_best(seed, luck):
    rng = np.random.default_rng(luck)
    with pytest.MonkeyPatch.context() as patch:
        judge = Judge(patch, lambda shape, world: rng.random())
        found = judge.search(3, seed)
    for shape in [*judge.shapes, found]:
        values = numbers(shape)
        for name, (low, high) in shape_search._RANGES.items():
            assert low <= values.get(name, 1.0) <= high
        assert set(shape.balance) <= set(Gains._fields)


@pytest.mark.parametrize("shape", [DEFAULT, BOX_SHAPE, MODEL_SHAPE])
def test_the_shape_begun_with_is_in_the_ranges(shape):
    for name, (low, high) in shape_search._RANGES.items():
        assert low < getattr(shape, name, 1.0) < high


def test_gains_are_searched_around_those_begun_with(monkeypatch):
    start = StrideShape(balance={"trunk": 2.0, "touch": 0.7})
    judge = Judge(monkeypatch, lambda shape, world: shape.balance.get("trunk", 0.0))
    found = judge.search(3, start=start)
    low, high = shape_search._RANGES["trunk"]
    for shape in judge.shapes[FIRST:]:
        assert 2.0 * low <= shape.balance["trunk"] <= 2.0 * high
        assert shape.balance["touch"] == 0.7
    assert found.balance["trunk"] > 2.5


def test_finals_go_on_until_the_difference_is_sure(monkeypatch):
    """A gain that is hardly larger than its error is walked in all rounds."""
    rng = np.random.default_rng(5)

    def unsure(shape, world):
        return 0.5 + 0.015 * (shape != DEFAULT) + 0.1 * rng.normal()

    judge = Judge(monkeypatch, unsure)
    judge.search(1)
    assert len(judge.rounds) == 1 + shape_search._FINALS


def test_a_shape_that_is_hardly_better_is_not_taken(monkeypatch):
    def hardly(shape, world):
        del world
        return 0.5 + 0.9 * shape_search._BETTER * (shape != DEFAULT)

    assert Judge(monkeypatch, hardly).search(2) == DEFAULT


def test_some_walks_are_pushed_hard(monkeypatch):
    judge = Judge(monkeypatch, lambda shape, world: 0.6)  # neither harder nor softer
    judge.search(1)
    hard = search_walks.PUSH * BIPED.mass * math.sqrt(GRAVITY * LEG)
    for _, walk, _, world in judge.seen:
        pushes = [push.impulse_ns for push in world.push]
        if walk.pushed:
            assert pushes == pytest.approx([hard])
        else:
            assert len(pushes) <= 1
            assert max(pushes, default=0.0) <= ROUGH.push_ns


def test_some_floors_are_slippery(monkeypatch):
    judge = Judge(monkeypatch, nearness)
    judge.search(1)
    assert any(walk.slippery for walk in WALKS[:FIRST])
    for _, walk, _, world in judge.seen:
        assert (world.friction == 0.4) == walk.slippery
        assert walk.steps == 40 or not walk.slippery


def test_some_servos_get_their_targets_late(monkeypatch):
    judge = Judge(monkeypatch, nearness)
    judge.search(1)
    assert any(walk.delayed for walk in WALKS)
    for _, walk, _, world in judge.seen:
        assert (world.delay_s == 0.04) == walk.delayed


def test_some_waists_give_way(monkeypatch):
    judge = Judge(monkeypatch, nearness)
    judge.search(1)
    assert any(walk.loose for walk in WALKS[:FIRST])
    for _, walk, _, world in judge.seen:
        assert world.waist == (4.0 if walk.loose else math.inf)
        assert walk.steps == 40 or not walk.loose


def test_shapes_whose_steps_no_plan_can_make_are_not_walked(monkeypatch):
    judge = Judge(monkeypatch, nearness)

    def fits(robot, shape, timing, walk, pace, limit):
        assert timing == shape.timing(robot)
        assert (walk, pace, limit) == (WALKS[0], 0.3, None)
        return shape.hip_height < 0.86

    monkeypatch.setattr(shape_search, "fits", fits)
    judge.search(1)
    walked = {shape.hip_height for shape in judge.shapes[: DRAWN * len(HEATS[0][1])]}
    assert len(walked) > DRAWN / 2
    assert max(walked) < 0.86


def test_where_no_plan_can_make_them_all_the_same_they_are_walked(monkeypatch):
    judge = Judge(monkeypatch, nearness)
    monkeypatch.setattr(shape_search, "fits", lambda *task: False)
    judge.search(2)
    assert len(judge.shapes) == 2 * ROUND + FINAL


def test_progress_is_told_up_to_its_total(monkeypatch):
    judge = Judge(monkeypatch, nearness)
    judge.search(2)
    stages, done, total = zip(*judge.told, strict=True)
    assert len(set(stages)) == 1
    most = FIRST + 2 * ROUND + LAST
    assert set(total) == {most}
    walked = FIRST + 2 * ROUND + FINAL
    assert list(done) == [*range(1, walked + 1), most]


def test_the_same_seed_searches_the_same(monkeypatch):
    found, again, other = (
        Judge(monkeypatch, nearness).search(2, seed) for seed in (1, 1, 2)
    )
    assert found == again
    assert found != other


@pytest.fixture
def quick(monkeypatch):
    """Few shapes, two walks; what a worker process does is left as it is."""
    few = {"_DRAWN": 2, "_KEPT": 1, "_FIRST": 1, "_FINALS": 1}
    few["_HEATS"] = ((2, range(1)), (1, range(1, 2)))
    few["WALKS"] = (search_walks.Walk(0.9), search_walks.Walk(0.6, pushed=True))
    for name, value in few.items():
        monkeypatch.setattr(shape_search, name, value)


@pytest.mark.slow
def test_the_number_of_workers_changes_nothing(quick, monkeypatch):
    """In physics, among pushes that bring some of the shapes down."""
    del quick
    held, found, parts = shape_search._Search._held, [], []

    def noted(*args):
        parts[-1].append(held(*args))
        return parts[-1][-1]

    monkeypatch.setattr(shape_search._Search, "_held", noted)
    worlds = WorldRange(model_error=0.1, push_ns=120.0)
    for workers in (1, 2):
        parts.append([])
        found.append(
            search_shape(
                RES,
                draw(3),
                Crew(workers, lambda *news: None, worlds),
                start=DEFAULT,
                generations=1,
            )
        )
    assert found[0] == found[1]
    one, two = ([part.tolist() for part in each] for each in parts)
    assert one == two
    assert len({p for rows in one for row in rows for p in row}) > 1, "not all alike"


def scaled(factor):
    """RES, larger."""
    lengths = {"crus_length", "femur_length"}
    return resized(
        RES, **{name: factor * getattr(RES.reduced, name) for name in lengths}
    )


@given(st.floats(0.2, 3.0), st.floats(0.3, 0.8), st.sampled_from([0.002, 0.005, 0.01]))
def test_step_times_scale_with_the_pendulum(factor, step_s, period_s):
    """To half a control period; rise and fall share what is not in both feet's time."""
    timing = StrideShape(step_s=step_s).timing(scaled(factor), period_s)
    expected = step_s * math.sqrt(factor * BIPED.leg_length / LEG)
    single = timing.rise + timing.fall
    assert timing.step == pytest.approx(expected, abs=0.5 * period_s + 1e-9)
    assert single == pytest.approx(expected * 0.415 / 0.46, abs=0.5 * period_s + 1e-9)
    for time_s in (timing.step, single):
        assert time_s / period_s == pytest.approx(round(time_s / period_s), abs=1e-6)
    assert timing.rise == pytest.approx(single * 0.215 / 0.415)
    assert single <= timing.step


def test_res_steps_as_it_was_found_to():
    timing = DEFAULT.timing(RES)
    assert BIPED.leg_length == pytest.approx(LEG)
    assert timing.step == pytest.approx(0.46)
    assert timing.rise + timing.fall == pytest.approx(0.42)  # 0.415 s in whole periods
