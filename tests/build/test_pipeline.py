"""Building a library: what comes out, what is refused, what is told on the way."""

import math
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pytest
from small_build import SMALLEST, TINY, few_steady_walks

from gaitchain.build import command_envelope, pipeline
from gaitchain.build.gate import gate
from gaitchain.build.keypose import KEY_POSE_BUILD
from gaitchain.build.no_walk import NoWalkError
from gaitchain.build.pipeline import build_library
from gaitchain.build.rollout import WorldRange
from gaitchain.build.shape_search import Found
from gaitchain.build.stride import StrideBuild
from gaitchain.build.trial import TrialRun
from gaitchain.build.workers import Crew
from gaitchain.errors import ChainError, CommandError, GaitchainError, LibraryError
from gaitchain.gait.command_range import CommandRange
from gaitchain.gait.family import STAND
from gaitchain.gait.keypose.feasibility import feasible_edges
from gaitchain.gait.keypose.presets import draw_candidates
from gaitchain.gait.keypose.primitives import PARAMETERS
from gaitchain.gait.motion import StepMotion, Timing
from gaitchain.gait.qualification import Qualification
from gaitchain.gait.stride.presets import STRIDE_PRESETS
from gaitchain.gait.stride.shape import BOX_SHAPE
from gaitchain.messages import Command
from gaitchain.robot.joint_angles import joint_angles
from gaitchain.sim.world_range import trained
from gaitchain.walker.generator import ChainState
from gaitchain.walker.keypose_generator import KeyposeGenerator

HIP_X = PARAMETERS.index("hip_x")


@pytest.fixture(scope="module")
def pruned_hard():
    """So large an epsilon that each class keeps a single pose."""
    hard = replace(TINY, epsilon=100.0, training="sequential")
    library, report = build_library(hard)
    return library, report, library.config


@pytest.mark.slow
def test_other_servo_gains_are_tried_where_no_walk_holds(monkeypatch):
    """Not where the config says how stiff, and not twice."""
    stages = []

    def fell(library, crew):
        if library.robot.servo_gain > least:
            raise NoWalkError("none", servo_gain=0.5)

    def build(**changes):
        config = replace(TINY, **changes)
        return build_library(config, lambda stage, *news: stages.append(stage))[0]

    monkeypatch.setattr("gaitchain.build.pipeline.check_walks", fell)
    least = 0.5
    library = build()
    assert library.robot.servo_gain == 0.5
    assert library.config.servo_gain is None
    assert any(stage.startswith("servos 0.5 times: ") for stage in stages)
    assert build(servo_gain=0.4).robot.servo_gain == 0.4
    with pytest.raises(NoWalkError):
        build(servo_gain=1.0)
    least = 0.25
    with pytest.raises(NoWalkError):
        build()


@pytest.mark.slow
def test_a_second_build_that_finds_no_steps_says_of_which_servos(monkeypatch):
    def fell(library, crew):
        if library.robot.servo_gain == 1.0:
            raise NoWalkError("no walk", servo_gain=0.5)
        raise ChainError("no steps")

    monkeypatch.setattr("gaitchain.build.pipeline.check_walks", fell)
    said = r"no walk. Built with servos 0\.5 times as stiff: no steps"
    with pytest.raises(LibraryError, match=said):
        build_library(TINY)


@pytest.mark.parametrize(
    ("shapes", "order", "left"),
    [
        ([(0.7, 1.0), (0.9, 1.0)], [0.7], 1),
        ([(0.5, 1.0), (0.7, 1.0), (0.9, 1.0)], [0.7, 0.5], 1),
        ([(0.3, 1.0), (0.5, 1.0), (0.4, 1.0)], [0.5, 0.4, 0.3], 0),
        ([(0.4, 1.0), (0.21, 0.3), (0.9, 1.0)], [0.9, 0.4, 0.21], 0),
        ([(0.4, 1.0), (0.5, 0.8), (0.9, 1.0)], [0.5, 0.4], 1),
    ],
)
def test_shapes_are_tried_until_the_steadiest_holds_enough(shapes, order, left):
    """By the speeds that they hold for long, and that their single steps reach."""
    trained = iter([Holds(*shape) for shape in shapes])
    found = pipeline._steadiest(trained)
    assert [next(found).held for _ in order] == order
    assert len(list(found)) == left, "these only if they are asked for"


class Holds(NamedTuple):
    """Stands in for what training makes of one set of candidates."""

    held: float
    steps: float

    def part_of(self, most):
        return self.held / most


@pytest.mark.parametrize(
    ("ahead", "others", "part"),
    [(1.0, 1.0, 1.0), (0.5, 1.0, 0.75), (1.0, 0.5, 0.75), (0.0, 1.0, 0.0)],
)
def test_ahead_counts_as_much_as_all_other_ways(ahead, others, part, brisk):
    """Who holds nothing ahead holds no part."""
    steps = replace(brisk, steady=None).command_range
    (back, forth), *rest = steps.ends
    ends = [(others * low, others * high) for low, high in rest]
    steady = CommandRange((others * back, ahead * forth), *ends)
    held = replace(brisk, steady=steady)
    one = pipeline._Trained(None, None, None, held, None, None)
    assert one.part_of(steps) == pytest.approx(part)


@pytest.mark.parametrize(
    ("passed", "taken"),
    [
        ((True, True), 0),
        ((False, True), 1),
        ((None, True), 1),
        ((False, None, True, True), 2),
        ((False, False), 0),
        ((None, False, False), 1),
    ],
)
def test_a_shape_that_is_not_qualified_gives_way_to_one_that_is(passed, taken):
    """None: it holds no walk."""
    numbers = iter(range(len(passed)))
    found, library = pipeline._first_qualified(numbers, partial(verdict, passed))
    assert (found, library.qualified) == (taken, bool(passed[taken]))
    left = len(passed) - 1 - taken if library.qualified else 0
    assert len(list(numbers)) == left


def test_where_no_shape_walks_the_first_says_why():
    with pytest.raises(NoWalkError, match="no walk with 0"):
        pipeline._first_qualified(iter(range(2)), partial(verdict, (None, None)))


def verdict(passed, number):
    if passed[number] is None:
        raise NoWalkError(f"no walk with {number}")
    return Verdict(passed[number])


class Verdict(NamedTuple):
    """Stands in for a library."""

    qualified: bool


def test_shapes_with_which_there_is_no_step_are_passed_over(monkeypatch):
    def train(config, drawn, crew, rngs):
        crew.progress("training", 0, 1)
        if drawn == 1:
            raise ChainError("no step is allowed")
        return drawn

    def draw(number):
        if number == 0:
            raise LibraryError("no step from a stand")
        return number

    monkeypatch.setattr(pipeline, "_train", train)
    stages = []
    crew = Crew(1, lambda stage, *news: stages.append(stage))
    drawings = [partial(draw, number) for number in range(4)]
    assert list(pipeline._train_all(TINY, drawings, crew, None)) == [2, 3]
    assert stages == [f"shape {number}: training" for number in (2, 3, 4)]
    with pytest.raises(LibraryError, match="no step from a stand"):
        list(pipeline._train_all(TINY, drawings[:2], crew, None))


@pytest.mark.slow
def test_a_shape_that_walks_badly_gives_way_to_a_steadier_one(monkeypatch):
    found = replace(BOX_SHAPE, **STRIDE_PRESETS["brisk"].shape)
    other = replace(found, hip_height=found.hip_height + 0.005)
    stages, parts = [], [0.4, 0.8]  # of what single steps reach

    def hold(library, crew):
        crew.progress("walking on and on", 0, 1)
        part, most = parts.pop(0), library.command_range
        ends = [(part * low, part * high) for low, high in most.ends]
        return replace(library, steady=CommandRange(*ends))

    searched = Found(found, math.inf, (other,))
    monkeypatch.setattr(StrideBuild, "_shape", lambda *args: searched)
    monkeypatch.setattr(pipeline, "hold_steady", hold)
    with few_steady_walks():
        library, _ = build_library(SMALLEST, lambda stage, *news: stages.append(stage))
    leg = library.robot.reduced.leg_length
    assert library.poses.hip_height == pytest.approx(other.hip_height * leg)
    assert not parts
    assert "shape 2: training in physics" in stages


def test_report(built):
    library, report, _ = built
    config = library.config
    assert report.candidates == config.poses_per_layer
    assert report.kept == library.poses.counts == library.chain.layer_sizes
    assert all(k <= n for k, n in zip(report.kept, report.candidates, strict=True))
    assert 0.0 < report.mean_cost < 1.0
    assert 0 <= report.falls <= config.walks
    assert report.pairs == library.allowed_pairs.sum() > 0
    assert 0 <= report.gate.survived <= report.gate.schedules == config.gate_runs
    gaits = (library.gait_of[..., 0] >= 0).sum()
    assert 1 <= report.independent_gaits <= gaits
    assert report.regret.greedy >= -1e-9
    assert report.regret.look_ahead >= -1e-9


def test_library(built):
    library, report, _ = built
    config = library.config
    assert library.timing == config.scaled_timing(Timing()) == Timing(3.0, 0.6, 1.8)
    assert library.poses.closed
    assert library.chain.is_stochastic()
    verdict = library.qualification.gate
    assert verdict.schedules == config.gate_runs
    assert verdict == report.gate
    assert verdict.feedback
    assert tuple(verdict.worlds["friction"]) == WorldRange().numbers["friction"]
    steps = config.qualification_walks * config.steps_per_walk
    assert 0 < library.pair_runs.sum() <= steps
    assert np.all(library.pair_passes <= library.pair_runs)


def test_costs_are_known_where_an_edge_may_be_taken(built):
    library = built[0]
    masks = feasible_edges(library.poses, library.timing)
    for costs, mask in zip(library.edge_costs, masks, strict=True):
        np.testing.assert_array_equal(np.isfinite(costs), mask)
        assert np.all((costs[mask] >= 0.0) & (costs[mask] <= 1.0))
    for costs, mask in zip(library.path_costs, masks, strict=True):
        np.testing.assert_array_equal(np.isfinite(costs), mask)
        np.testing.assert_array_equal(costs[~mask], np.inf)


def test_path_costs_add_up_to_a_steps_cost(built):
    """Along the best gaits, to the mean training cost rather than to three of them."""
    library, report, _ = built
    gaits = library.gait_of[library.allowed_pairs]
    added = sum(
        c[gaits[:, i], gaits[:, i + 1]] for i, c in enumerate(library.path_costs)
    )
    assert np.abs(added - report.mean_cost).mean() < 0.5 * report.mean_cost
    edges = sum(
        c[gaits[:, i], gaits[:, i + 1]] for i, c in enumerate(library.edge_costs)
    )
    assert edges.mean() > 2.0 * report.mean_cost


def test_progress_runs_to_the_total_in_each_stage(built):
    library, _, progress = built
    stages = {}
    for stage, done, total in progress:
        stages.setdefault(stage, []).append((done, total))
    config = library.config
    *training, covered, gated = (news[-1][1] for news in stages.values())
    assert sum(training) == config.walks
    assert (covered, gated) == (config.qualification_walks, config.gate_runs)
    for news in stages.values():
        total = news[-1][1]
        assert news == [(done, total) for done in range(total + 1)]


def test_measured_advance_is_near_the_plans(built):
    """Over the support foot, the hip goes from its place at kp_1 to that at kp_4."""
    library = built[0]
    start, end = (library.poses.parameters[i][:, HIP_X] for i in (0, 3))
    planned = end - start[:, None]
    walked = library.allowed_pairs
    measured = library.pair_advance[walked]
    assert np.corrcoef(planned[walked], measured)[0, 1] > 0.8
    assert np.abs(planned[walked] - measured).mean() < 0.04


def test_stored_edges_keep_the_joint_limits(built):
    """Row 20, on every edge that any gait of the library may take."""
    library = built[0]
    robot, poses, timing = library.robot, library.poses, library.timing
    for layer, costs in enumerate(library.edge_costs):
        times = timing.key_times[layer : layer + 2]
        moments = np.linspace(*times, 181)
        edges = np.argwhere(np.isfinite(costs))
        assert len(edges)
        ends = (
            np.stack([v[layer][edges[:, 0]], v[layer + 1][edges[:, 1]]], axis=1)
            for v in (poses.q, poses.dq)
        )
        path = StepMotion(times, *ends).at(moments).q
        for left_support in (True, False):
            angles = joint_angles(path, left_support)
            speeds = np.abs(np.diff(angles, axis=1)) / (moments[1] - moments[0])
            assert np.abs(angles).max() <= robot.reduced.joint_angle_limit
            assert speeds.max() <= robot.reduced.joint_speed_limit


@pytest.mark.slow
def test_planned_cost_and_sequential_training(pruned_hard):
    library, report, config = pruned_hard
    assert library.config.cost == "planned"
    assert report.falls == 0  # no physics while training
    assert 0.0 < report.mean_cost < 1.0
    assert library.chain.is_stochastic()
    assert library.pair_runs.sum() > 0  # physics still has the last word
    assert library.qualified
    batch = build_library(replace(config, training="batch"))[0]
    assert any(
        a.shape != b.shape or not np.allclose(a, b)
        for a, b in zip(batch.chain.transitions, library.chain.transitions, strict=True)
    )


@pytest.mark.slow
def test_pruning_keeps_a_landing_for_every_step_length(pruned_hard):
    library, report, config = pruned_hard
    first, second, third, last = report.kept
    assert (first, last) == (4, 4)
    assert second == 1
    assert third < config.poses_per_layer[2]
    # Which of the candidates could land where, before anything was cut.
    seeds = np.random.SeedSequence(config.seed).spawn(4)
    candidates = draw_candidates(
        library.robot,
        "default",
        np.random.default_rng(seeds[0]),
        config.scaled_timing(Timing()),
        config.poses_per_layer,
    )
    landings = feasible_edges(candidates, config.scaled_timing(Timing()))[2].any(axis=0)
    kept = np.isfinite(library.edge_costs[2]).any(axis=0)
    np.testing.assert_array_equal(kept, landings)
    assert landings.sum() >= 2


@pytest.mark.slow
def test_epsilon_0_keeps_every_pose():
    library, report = build_library(replace(TINY, epsilon=0.0))
    assert report.kept == report.candidates
    for sizes, matrix in zip(
        pairwise(report.kept), library.chain.transitions, strict=True
    ):
        assert matrix.shape == sizes


def test_a_preset_that_is_not_closed_is_refused():
    config = replace(TINY, preset="table1", poses_per_layer=None)
    with pytest.raises(LibraryError, match=r"'table1' is not closed.*use 'default'"):
        build_library(config)


@pytest.mark.parametrize(
    "changes",
    [
        {"robot": "no_such_robot"},
        {"preset": "table2"},
        {"poses_per_layer": (4, 6, 8, 3)},
        {"steps_per_walk": 1},
        {"epsilon": -1.0},
        {"step_s": 0.3},
    ],
)
def test_unusable_configs_are_refused(changes):
    with pytest.raises(GaitchainError):
        build_library(replace(TINY, **changes))


def test_what_is_no_config_or_no_robot_is_not_built():
    for odd in ("res", None):
        with pytest.raises(CommandError, match=r"give BuildConfig\(robot='res'\)"):
            build_library(odd)
    with pytest.raises(CommandError, match="'res' is no robot; give a Robot"):
        build_library(TINY, robot="res")


@pytest.mark.parametrize("workers", [0, -3, 1.5, None])
def test_a_build_without_processes_is_refused(workers):
    with pytest.raises(CommandError, match=f"workers is {workers}, must be 1 or more"):
        build_library(TINY, workers=workers)


@pytest.fixture
def few_walks(monkeypatch):
    """Who slows down asks in physics where it falls: by few short walks here."""
    monkeypatch.setattr(command_envelope, "_HARD_RUNS", 1)
    monkeypatch.setattr(command_envelope, "_SECONDS", 1.0)


STANDING = (0, 0)  # a step that no library allows, so forbidding it changes nothing
CREW = Crew(1, lambda stage, done, total: None)


@pytest.mark.parametrize(
    ("falls", "share", "passed"),
    [
        ((0, 0, 0, 0), 1.0, True),
        ((0, 0, 0, 1), 0.75, True),
        ((1, 0, 0, 0), 0.76, False),
        ((1, 1, 1, 0), 0.0, True),
        ((1, 1, 1, 1), 0.0, False),  # not one walk: no share is small enough
    ],
)
def test_the_gate_counts_falls(built, monkeypatch, falls, share, passed):
    asked = []

    def trials(trial, runs, seed, workers):
        asked.append((trial.library, runs, seed, trial.require_qualified))
        for i, fell in enumerate(falls):
            yield TrialRun((seed, i), "", bool(fell), None, 0.0, 0.0, STANDING)

    monkeypatch.setattr("gaitchain.build.gate.run_trials", trials)
    draft = replace(built[0], qualification=Qualification())
    library = gate(draft, 4, share, 7, CREW)
    verdict = library.qualification.gate
    assert library.qualified is verdict.passed is passed
    assert (verdict.schedules, verdict.survived) == (4, 4 - sum(falls))
    assert asked[0][0] is draft
    assert {(runs, required) for _, runs, _, required in asked} == {(4, False)}
    seeds = [seed for _, _, seed, _ in asked]
    assert min(seeds) > 2**31  # none that a user's trial would repeat
    # A round that passes, or in which nobody stood, is the last one.
    assert len(set(seeds)) == verdict.rounds == (1 if passed or share == 0.0 else 5)
    # A fall takes its step out, and what is left is walked again: what passes is what
    # was walked.
    forbidden = library.pair_runs - draft.pair_runs
    held = passed or share == 0.0
    expected = 0 if held else sum(falls) * verdict.rounds
    assert forbidden[STANDING] == expected == forbidden.sum()


def test_where_forbidding_does_not_help_the_commands_get_slower(
    brisk, few_walks, monkeypatch
):
    """Schedules fall as long as more than 0.6 of the range is commanded."""
    most = brisk.command_range.vx[1]

    def trials(trial, runs, seed, workers):
        fell = trial.library.command_range.vx[1] > 0.6 * most
        for i in range(runs):
            yield TrialRun((seed, i), "", fell, None, 0.0, 0.0, STANDING)

    monkeypatch.setattr("gaitchain.build.gate.run_trials", trials)
    held = brisk if brisk.steady else replace(brisk, steady=brisk.command_range)
    gated = gate(held, 4, 1.0, 7, CREW)
    verdict = gated.qualification.gate
    assert (verdict.passed, verdict.rounds, verdict.survived) == (True, 8, 4)
    for now, before in zip(
        gated.command_range.ends, brisk.command_range.ends, strict=True
    ):
        assert now == pytest.approx(tuple(0.8**3 * end for end in before))


def test_where_every_first_step_fell_the_commands_get_slower(
    brisk, few_walks, monkeypatch
):
    """Forbidding them all would leave nothing to walk with."""
    most, steps = brisk.command_range.vx[1], brisk.poses.counts[-1]

    def trials(trial, runs, seed, workers):
        fell = trial.library.command_range.vx[1] > 0.9 * most
        for i in range(runs):
            yield TrialRun((seed, i), "", fell, None, 0.0, 0.0, (STAND, i))

    monkeypatch.setattr("gaitchain.build.gate.run_trials", trials)
    held = brisk if brisk.steady else replace(brisk, steady=brisk.command_range)
    gated = gate(held, steps, 1.0, 7, CREW)
    verdict = gated.qualification.gate
    assert (verdict.passed, verdict.rounds) == (True, 2)
    np.testing.assert_array_equal(gated.pair_runs, brisk.pair_runs)
    assert gated.command_range.vx[1] == pytest.approx(0.8 * most)


def test_commands_get_slower_four_times_at_most(brisk, few_walks, monkeypatch):
    """However early forbidding would leave nothing to walk with."""
    asked, steps = [], brisk.poses.counts[-1]

    def trials(trial, runs, seed, workers):
        asked.append(trial.library.command_range.vx[1] / brisk.command_range.vx[1])
        for i in range(runs):
            yield TrialRun((seed, i), "", True, None, None, 0.0, (STAND, i))

    monkeypatch.setattr("gaitchain.build.gate.run_trials", trials)
    held = brisk if brisk.steady else replace(brisk, steady=brisk.command_range)
    gated = gate(held, steps, 1.0, 7, CREW)
    assert not gated.qualified
    assert asked == pytest.approx([0.8**slowed for slowed in range(5)])


@pytest.mark.parametrize(("sound_hold", "passed"), [(True, True), (False, False)])
def test_who_falls_with_faults_is_tested_without(
    brisk, few_walks, monkeypatch, sound_hold, passed
):
    """Three of four schedules hold with faults of servos, at any speed."""
    asked = []

    def trials(trial, runs, seed, workers):
        faulty = trial.worlds.numbers["backlash_deg"] != 0.0
        asked.append(trial.library.command_range)
        for i in range(runs):
            fell = i == 0 if faulty else not sound_hold
            yield TrialRun((seed, i), "", fell, None, 0.0, 0.0, STANDING)

    monkeypatch.setattr("gaitchain.build.gate.run_trials", trials)
    worlds = WorldRange(**trained(balanced=True))
    gated = gate(brisk, 4, 1.0, 7, replace(CREW, worlds=worlds))
    verdict = gated.qualification.gate
    assert (verdict.passed, verdict.with_faults) == (passed, 3)
    assert verdict.worlds["backlash_deg"] == 0.0
    # As fast as before: nothing shows that a slower robot would hold its faults.
    assert (gated.command_range == brisk.command_range) == passed
    assert set(asked[:6]) == {brisk.command_range}
    assert "as in the file; with mild faults of them 3 held" in verdict.describe()
    again = Qualification.from_json(gated.qualification.to_json())
    assert again == gated.qualification


def test_who_falls_on_every_first_step_with_faults_is_tested_without(
    brisk, few_walks, monkeypatch
):
    """In one round; what holds without faults is as fast, with all of its steps."""
    steps, rounds = brisk.poses.counts[-1], []

    def trials(trial, runs, seed, workers):
        faulty = trial.worlds.numbers["backlash_deg"] != 0.0
        rounds.append(faulty)
        for i in range(runs):
            yield TrialRun((seed, i), "", faulty, None, 0.0, 0.0, (STAND, i))

    monkeypatch.setattr("gaitchain.build.gate.run_trials", trials)
    worlds = WorldRange(**trained(balanced=True))
    gated = gate(brisk, steps, 1.0, 7, replace(CREW, worlds=worlds))
    verdict = gated.qualification.gate
    assert (verdict.passed, verdict.with_faults) == (True, 0)
    assert rounds == [True, False]
    np.testing.assert_array_equal(gated.pair_runs, brisk.pair_runs)


def test_the_gate_walks_in_physics(built):
    """The same schedules in the same worlds by the same seed."""
    library = built[0]
    config = library.config
    again = gate(library, config.gate_runs, 0.0, config.seed, CREW)
    assert again.qualification == library.qualification


def test_a_library_that_cannot_walk_does_not_pass(built, monkeypatch):
    """Half steps from and to standing, but none to go on with."""

    def nothing_to_walk(*words, **options):
        raise AssertionError("there is no speed to walk")

    monkeypatch.setattr("gaitchain.build.gate.run_trials", nothing_to_walk)
    library = built[0]
    passes = library.pair_passes.copy()
    passes[1:, 1:] = 0
    half_steps = replace(library, pair_passes=passes)
    for share in (0.95, 0.0):
        verdict = gate(half_steps, 4, share, 0, CREW)
        assert not verdict.qualified
        assert verdict.qualification.gate.survived == 0
        assert verdict.qualification.gate.schedules == 4


@pytest.mark.parametrize("seed", [0, 1])
def test_looking_ahead_regrets_little(res, seed):
    """On the planned cost, against the best of all gaits."""
    rng = np.random.default_rng(seed)
    timing = Timing()
    poses = draw_candidates(res, "default", rng, timing, counts=(6, 10, 12, 6))
    edges = feasible_edges(poses, timing)
    found = KEY_POSE_BUILD.planned_regret(poses, timing, edges, seed)
    assert 0.0 <= found.look_ahead <= 0.05


def test_a_build_of_too_many_gaits_to_compare_has_no_regret(res):
    """It ended in an error after everything else was done."""
    counts, timing = (40, 40, 40, 40), Timing()
    rng = np.random.default_rng(0)
    poses = draw_candidates(res, "default", rng, timing, counts=counts)
    edges = tuple(np.ones(pair, dtype=bool) for pair in pairwise(counts))
    assert KEY_POSE_BUILD.planned_regret(poses, timing, edges, 0) is None


def test_a_built_library_walks(built):
    """Chain, costs and verdicts fit each other: every allowed step can be made."""
    library = built[0]
    for first, last in np.argwhere(library.allowed_pairs):
        assert tuple(library.gait_of[first, last, [0, 3]]) == (first, last)
    _, decision = KeyposeGenerator(library).advance(ChainState(), Command(0.05))
    assert decision.layer == 1
