"""The online choice of key poses, against brute force over all ways on."""

from dataclasses import replace
from itertools import pairwise, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from verdicts import PASSED

from gaitchain.chain.layered_chain import LayeredChain
from gaitchain.errors import CommandError, LibraryError
from gaitchain.gait.build_config import BuildConfig
from gaitchain.gait.command_range import ends_text
from gaitchain.gait.family import STAND
from gaitchain.gait.keypose.presets import draw_candidates
from gaitchain.gait.keypose.primitives import PARAMETERS, compose
from gaitchain.gait.library import GaitLibrary, best_gaits
from gaitchain.gait.motion import Timing
from gaitchain.gait.schedule import random_steps, step_commands
from gaitchain.messages import Command
from gaitchain.robot.box_robot import JOINT_NAMES, load_box_robot
from gaitchain.robot.joint_angles import joint_angles
from gaitchain.robot.kinematics import exchange_roles
from gaitchain.walker import keypose_generator as generator_module
from gaitchain.walker.generator import LATE_STOP, ChainState
from gaitchain.walker.keypose_gait import panel_message
from gaitchain.walker.keypose_generator import KeyposeGenerator

FRONTAL_JOINTS = {n for n in JOINT_NAMES if n.endswith(("_roll", "_yaw"))}
SEEDS = st.integers(0, 2**32 - 1)
RES = load_box_robot("res")
CANDIDATES = draw_candidates(
    RES, "default", np.random.default_rng(0), counts=(4, 4, 5, 4)
)


@pytest.fixture(scope="module")
def generator(library):
    return KeyposeGenerator(library)


def invented(seed, can_stop=True):
    """A library of random costs and verdicts over real poses.

    Path costs and edge costs forbid the same edges and have else nothing in common.
    Without `can_stop`, physics may have passed steps that lead to a pose from which
    it has passed none.
    """
    rng = np.random.default_rng(seed)
    sizes = CANDIDATES.counts
    while True:
        costs = []
        for shape in pairwise(sizes):
            costs.append(np.where(rng.random(shape) < 0.7, rng.random(shape), np.inf))
        near = [np.where(np.isinf(c), c, rng.random(c.shape)) for c in costs]
        joined = best_gaits(tuple(costs))[..., 0] >= 0
        joined[STAND, STAND] = False
        if joined[STAND].any() and joined[1:, STAND].all() and joined[1:, 1:].all():
            break
    runs = 2 * joined.astype(np.int64)
    share = 0.6 if can_stop else 0.35
    passes = np.where(rng.random(runs.shape) < share, runs, 0)
    if can_stop:
        passes[1:, STAND] = 2
    # At least one way to start, and one steady walk.
    start = np.argmax(joined[STAND])
    passes[STAND, start] = passes[start, start] = 2
    lengths = CANDIDATES.step_lengths
    advance = 0.5 * (lengths[:, None] + lengths) + rng.uniform(-0.02, 0.02, runs.shape)
    return GaitLibrary(
        poses=CANDIDATES,
        timing=Timing(),
        chain=LayeredChain.uniform(sizes),
        edge_costs=tuple(near),
        path_costs=tuple(costs),
        pair_advance=advance,
        pair_error=np.zeros_like(advance),
        pair_slip=np.zeros_like(advance),
        pair_runs=runs,
        pair_passes=passes,
        config=BuildConfig(),
        qualification=PASSED,
    )


def moves(generator, commands, state=None):
    """Yield (state before, command, decision, state after), segment by segment.

    Each command counts for one step, or for one period of standing.
    """
    state = state or ChainState()
    for command in commands:
        while True:
            after, decision = generator.advance(state, command)
            yield state, command, decision, after
            state = after
            if state.layer == 0:
                break


def follow(generator, commands):
    """Final states of each step when all commands are known beforehand."""
    state, ends = ChainState(), []
    for i, command in enumerate(commands):
        while True:
            state, _ = generator.advance(state, command, commands[i + 1 :])
            if state.layer == 0:
                break
        ends.append(state)
    return ends


def ways_on(library, layer, pose, target):
    """Every path of allowed edges from a pose to the step's end, with its cost."""
    sizes = library.chain.layer_sizes
    found = []
    for inner in product(*(range(n) for n in sizes[layer + 1 : 3])):
        nodes = (pose, *inner, target)
        cost = sum(
            library.path_costs[layer + i][nodes[i], nodes[i + 1]]
            for i in range(len(nodes) - 1)
        )
        if np.isfinite(cost):
            found.append((nodes[1:], float(cost)))
    return found


def best_by_next(library, layer, pose, target):
    best = {}
    for nodes, cost in ways_on(library, layer, pose, target):
        best[nodes[0]] = min(cost, best.get(nodes[0], np.inf))
    return best


def assert_obeys_the_library(library, before, command, decision, after):
    if decision.layer == 0:
        assert before.layer == 0
        assert before.pose == after.pose == decision.pose == STAND
        assert command.vx == 0.0
        assert after.left_support == before.left_support
        return
    assert decision.layer == before.layer + 1
    assert np.isfinite(library.edge_costs[before.layer][before.pose, decision.pose])
    assert np.isfinite(decision.cost)
    assert library.allowed_pairs[after.first, decision.target]
    if before.layer == 0:
        assert after.first == before.pose
    if decision.layer == 3:
        assert decision.pose == decision.target
        assert after.layer == 0
        assert after.left_support != before.left_support
    else:
        assert after.layer == decision.layer
        assert after.left_support == before.left_support
    assert after.pose == decision.pose


def test_standing_stays_without_a_command(generator):
    state = ChainState()
    for _ in range(3):
        state, decision = generator.advance(state, Command(0.0))
        assert decision.layer == 0
        assert decision.pose == STAND
        assert decision.speed == 0.0
        assert state.layer == 0
        assert state.pose == STAND
        assert state.left_support


def test_a_speed_makes_steps_through_the_key_moments(generator, library):
    speed = library.speed_range[1]
    walked = list(moves(generator, [Command(speed)] * 4))
    assert [decision.layer for _, _, decision, _ in walked] == [1, 2, 3] * 4
    assert [after.layer for *_, after in walked] == [1, 2, 0] * 4
    supports = [before.left_support for before, *_ in walked]
    assert supports == ([True] * 3 + [False] * 3) * 2
    for move in walked:
        assert_obeys_the_library(library, *move)
    assert all(after.pose != STAND for *_, after in walked if after.layer == 0)


def test_the_end_of_a_step_is_the_start_of_the_next(generator, library):
    poses, speed = library.poses, library.speed_range[1]
    ends = 0
    for before, _, decision, after in moves(generator, [Command(speed)] * 3):
        if decision.layer == 3:
            ends += 1
            end, start = poses.q[3][decision.pose], poses.q[0][after.pose]
            np.testing.assert_allclose(exchange_roles(end), start, atol=1e-12)
            np.testing.assert_allclose(
                joint_angles(end, before.left_support),
                joint_angles(start, after.left_support),
                atol=1e-12,
            )
    assert ends == 3


COMMANDS = st.lists(st.floats(0.0, 2.0), min_size=1, max_size=12)


@settings(max_examples=60)
@given(COMMANDS, st.sampled_from(["look_ahead", "greedy"]))
def test_any_commands_keep_to_the_library(library, parts, policy):
    """Commands up to twice the fastest speed, in any order."""
    generator = KeyposeGenerator(library, policy)
    commands = [Command(part * library.speed_range[1]) for part in parts]
    for move in moves(generator, commands):
        assert_obeys_the_library(library, *move)


@settings(max_examples=40)
@given(SEEDS, COMMANDS, st.sampled_from(["look_ahead", "greedy"]))
def test_any_commands_keep_to_an_invented_library(seed, parts, policy):
    library = invented(seed)
    commands = [Command(0.1 * part) for part in parts]
    for move in moves(KeyposeGenerator(library, policy), commands):
        assert_obeys_the_library(library, *move)


def steps_to_stand(library):
    """Least number of allowed steps from each pose to standing, by walking back."""
    steps = {STAND: 0}
    while True:
        farther = {
            int(first): steps[last] + 1
            for last in list(steps)
            for first in np.flatnonzero(library.allowed_pairs[:, last])
            if int(first) not in steps and steps[last] == max(steps.values())
        }
        if not farther:
            return steps
        steps |= farther


def holds_a_walk(library):
    """A steady walk, and a step from standing after which standing comes again."""
    steady = np.flatnonzero(np.diagonal(library.allowed_pairs))
    starts = set(np.flatnonzero(library.allowed_pairs[STAND]).tolist())
    fast = library.speed_range[1] > 0.0
    return fast and set(steady) - {STAND} and starts & set(steps_to_stand(library))


def generator_of(library):
    """The generator, or None where the library holds no walk, which it must say."""
    if holds_a_walk(library):
        return KeyposeGenerator(library)
    with pytest.raises(LibraryError, match="the library holds no walk: physics passed"):
        KeyposeGenerator(library)
    return None


@settings(max_examples=60)
@given(SEEDS, COMMANDS, st.sampled_from(["look_ahead", "greedy"]))
def test_no_dead_end_is_entered(seed, parts, policy):
    """Physics may pass a step to a pose from which it passes none."""
    library = invented(seed, can_stop=False)
    if generator_of(library) is None:
        return
    home = steps_to_stand(library)
    commands = [Command(0.1 * part) for part in parts]
    for move in moves(KeyposeGenerator(library, policy), commands):
        assert_obeys_the_library(library, *move)
        _, _, decision, _ = move
        assert decision.target in home


@settings(max_examples=60)
@given(SEEDS, st.floats(0.01, 0.2), st.integers(1, 5))
def test_a_stop_is_reached_from_wherever_the_walk_got(seed, speed, steps):
    """And in as few steps as there are."""
    library = invented(seed, can_stop=False)
    generator = generator_of(library)
    if generator is None:
        return
    *_, (*_, state) = moves(generator, [Command(speed)] * steps)
    needed = steps_to_stand(library)[state.pose]
    taken = 0
    while state.pose != STAND:
        *_, (*_, state) = moves(generator, [Command(0.0)], state)
        taken += 1
        assert taken <= needed
    assert state.layer == 0
    assert taken == needed


@settings(max_examples=30)
@given(SEEDS, COMMANDS)
def test_the_decision_is_the_cheapest_way_to_the_target(seed, parts):
    library = invented(seed)
    commands = [Command(0.1 * part) for part in parts[:4]]
    for before, _, decision, _ in moves(KeyposeGenerator(library), commands):
        if decision.layer == 0:
            continue
        best = best_by_next(library, before.layer, before.pose, decision.target)
        assert decision.cost == pytest.approx(min(best.values()))
        assert best[decision.pose] == pytest.approx(min(best.values()))


@pytest.mark.parametrize("policy", ["look_ahead", "greedy"])
def test_runners_up_are_sorted_and_complete(library, policy):
    high = library.speed_range[1]
    commands = [Command(high), Command(0.5 * high), Command(0.0)]
    for before, _, decision, _ in moves(KeyposeGenerator(library, policy), commands):
        if decision.layer == 0:
            assert decision.runners_up == ()
            continue
        best = best_by_next(library, before.layer, before.pose, decision.target)
        if policy == "greedy":
            row = library.edge_costs[before.layer][before.pose]
            best = {pose: row[pose] for pose in best}
        ranked = [(decision.pose, decision.cost), *decision.runners_up]
        assert {pose for pose, _ in ranked} == set(best)
        assert len(ranked) == len(best)
        costs = [cost for _, cost in ranked]
        assert costs == sorted(costs)
        np.testing.assert_allclose(costs, [best[pose] for pose, _ in ranked])


@settings(max_examples=30)
@given(SEEDS, COMMANDS)
def test_greedy_takes_the_cheapest_edge_with_a_way_on(seed, parts):
    library = invented(seed)
    commands = [Command(0.1 * part) for part in parts[:4]]
    for before, _, decision, _ in moves(KeyposeGenerator(library, "greedy"), commands):
        if decision.layer == 0:
            continue
        edges = library.edge_costs[before.layer][before.pose]
        open_ = best_by_next(library, before.layer, before.pose, decision.target)
        assert decision.pose in open_
        assert edges[decision.pose] == min(edges[pose] for pose in open_)


def step_cost(library, first, target, vx, *, stops_next=False, behind=0.0):
    """One step's part of the objective, as `Generator` documents it."""
    period, stop = library.timing.step, vx == 0.0
    ways = ways_on(library, 0, first, target)
    if not library.allowed_pairs[first, target]:
        return np.inf
    if target == STAND and not (stop or stops_next):
        return np.inf
    slowest = library.speed_range[0]
    scale = generator_module._SPEED_TOLERANCE * max(vx, slowest) * period
    off = (library.pair_advance[first, target] - vx * period - behind) / scale
    late = LATE_STOP * steps_to_stand(library)[target] if stop else 0
    return min(cost for _, cost in ways) + off**2 + late


def objective(library, start, commands):
    """Least total cost over all ways to carry out the commands, by first target."""
    late = LATE_STOP
    cache = {}

    def step(first, target, i, behind):
        vx = commands[i]
        stops_next = i + 1 < len(commands) and commands[i + 1] == 0.0
        key = first, target, vx, stops_next, behind
        if key not in cache:
            cache[key] = step_cost(
                library, first, target, vx, stops_next=stops_next, behind=behind
            )
        return cache[key]

    def rest(pose, i):
        if i == len(commands):
            return 0.0
        if commands[i] == 0.0 and pose == STAND:
            return rest(STAND, i + 1)
        extra = late if commands[i] == 0.0 else 0.0
        ends = range(len(library.pair_advance))
        return extra + min(step(pose, n, i, 0.0) + rest(n, i + 1) for n in ends)

    ends = range(len(library.pair_advance))
    same = commands[0] * library.timing.step == start.asked[0]
    behind = start.owed[0] if same else 0.0
    return [step(start.pose, n, 0, behind) + rest(n, 1) for n in ends]


@settings(max_examples=25)
@given(SEEDS, st.lists(st.sampled_from([0.0, 0.02, 0.05, 0.11]), max_size=3))
def test_the_target_minimises_the_objective(seed, upcoming):
    library = invented(seed)
    generator = KeyposeGenerator(library)
    state = ChainState()
    for vx in (0.05, 0.05, 0.09, 0.0):
        ahead = [Command(v) for v in upcoming]
        totals = objective(library, state, [vx, *upcoming])
        after, decision = generator.advance(state, Command(vx), ahead)
        if decision.layer == 0:
            assert state.pose == STAND
            assert vx == 0.0
            continue
        assert totals[decision.target] == pytest.approx(min(totals))
        while after.layer:
            after, _ = generator.advance(after, Command(vx), ahead)
        state = after


def test_what_one_step_lacks_the_next_makes_up(generator, library):
    """The mean speed comes nearer to the command than any single step."""
    low, high = library.speed_range
    speed, period = 0.5 * (low + high), library.timing.step
    ends = [after for *_, after in moves(generator, [Command(speed)] * 12)]
    starts = [state for state in ends if state.layer == 0]
    walked = library.pair_advance[[s.first for s in starts], [s.target for s in starts]]
    expected = 12 * speed * period - walked.sum()
    assert starts[-1].owed[0] == pytest.approx(expected)
    fresh, _ = generator.advance(starts[-1], Command(low))
    step = library.pair_advance[fresh.first, fresh.target]
    assert fresh.owed[0] == pytest.approx(low * period - step)


NO_WALK = "the library holds no walk: physics passed no step from standing, or no"


@pytest.mark.parametrize("policy", ["look_ahead", "greedy"])
def test_a_library_without_a_steady_walk_is_refused(library, policy):
    """Physics may pass half steps only; then the slowest speed is 0."""
    passes = library.pair_passes.copy()
    passes[1:, 1:] = 0
    with pytest.raises(LibraryError, match=NO_WALK):
        KeyposeGenerator(replace(library, pair_passes=passes), policy)


def test_a_library_that_never_stops_is_refused(library):
    """Each step from standing would lead on for ever."""
    passes = library.pair_passes.copy()
    passes[:, STAND] = 0
    with pytest.raises(LibraryError, match=NO_WALK):
        KeyposeGenerator(replace(library, pair_passes=passes))


def stops_on_time(library, steps):
    """Whether allowed pairs lead from standing to standing in so many steps."""
    walking = library.allowed_pairs.copy()
    walking[:, STAND] = False
    reached = np.zeros(len(walking), dtype=bool)
    reached[STAND] = True
    for _ in range(steps - 1):
        reached = (reached[:, None] & walking).any(axis=0)
    return bool((reached & library.allowed_pairs[:, STAND]).any())


@settings(max_examples=30)
@given(SEEDS)
def test_a_known_stop_is_kept_on_time(library, seed):
    schedule = random_steps(np.random.default_rng(seed), *library.speed_range)
    generator = KeyposeGenerator(library)
    commands = [generator.clamp(c)[0] for c in step_commands(schedule)]
    ends = follow(generator, commands)
    walks, length = [], 0
    for command in commands:  # lengths of the walks between stops
        if command.vx > 0.0:
            length += 1
        elif length:
            walks, length = [*walks, length], 0
    assert all(stops_on_time(library, steps) for steps in walks)
    for command, state, before in zip(
        commands, ends, [ChainState(), *ends], strict=False
    ):
        if command.vx == 0.0:
            assert before.pose == state.pose == STAND
    assert ends[-1].pose == STAND


def test_clamp_keeps_what_is_in_range(generator, library):
    low, high = library.speed_range
    assert low < high
    for vx in (0.0, low, 0.5 * (low + high), high):
        assert generator.clamp(Command(vx)) == (Command(vx), "")


def test_clamp_says_so(generator, library):
    low, high = library.speed_range
    for asked, done in ((0.5 * low, low), (2.0 * high, high), (np.inf, high)):
        command, note = generator.clamp(Command(asked))
        assert command.vx == done
        assert f"outside {ends_text(low, high, 'm/s')}: " in note
        assert abs(float(note.rpartition(" ")[2]) - done) < 1e-3
        assert f"{asked:g} m/s" in note
    command, note = generator.clamp(Command(-0.1))
    assert command.vx == 0.0
    assert note == "-0.1 m/s is no way on: stop"


@pytest.mark.parametrize("vx", [float("nan"), -np.inf, -1e-9])
def test_clamp_stops_on_what_is_no_way_on(generator, vx):
    command, note = generator.clamp(Command(vx))
    assert command == Command(0.0)
    assert note == f"{vx:g} m/s is no way on: stop"


def test_deciding_is_pure(generator, library):
    speed = library.speed_range[1]
    state, _ = generator.advance(ChainState(), Command(speed))
    copy = replace(state)
    first = generator.advance(state, Command(0.0), [Command(speed)])
    generator.advance(first[0], Command(speed))
    again = generator.advance(state, Command(0.0), [Command(speed)])
    assert first == again
    assert state == copy
    assert (
        KeyposeGenerator(library).advance(state, Command(0.0), [Command(speed)])
        == first
    )


def test_a_library_without_a_first_step_is_refused(library):
    fallen = library.pair_passes.copy()
    fallen[STAND] = 0
    with pytest.raises(LibraryError, match=NO_WALK):
        KeyposeGenerator(replace(library, pair_passes=fallen))


def test_the_panel_shows_the_pose_that_comes_next(generator, library):
    poses, timing = library.poses, library.timing
    high = library.speed_range[1]
    layers = set()
    for before, _, decision, _ in moves(generator, [Command(high), Command(0.0)]):
        panel = panel_message(poses, timing, before, decision)
        layers.add(decision.layer)
        pose = poses.q[decision.layer][decision.pose]
        assert panel.key_moment == f"kp_{decision.layer + 1}"
        assert panel.left_support == before.left_support
        assert panel.duration_s == timing.segments[decision.layer - 1]
        # Every joint is in one group, and has the pose's angle.
        assert set(panel.frontal) == FRONTAL_JOINTS
        assert set(panel.sagittal) == set(JOINT_NAMES) - FRONTAL_JOINTS
        assert not set(panel.frontal) & set(panel.sagittal)
        joints = {**panel.frontal, **panel.sagittal}
        np.testing.assert_allclose(
            [joints[name] for name in JOINT_NAMES],
            joint_angles(pose, before.left_support),
            atol=1e-15,
        )
        values = {**panel.swing, **panel.lift, **panel.move}
        assert set(values) == set(PARAMETERS)
        composed = compose(library.robot, np.array([values[n] for n in PARAMETERS]))
        np.testing.assert_allclose(composed, pose, atol=1e-12)
    assert layers == {1, 2, 3}


@pytest.mark.parametrize(
    "where", [{"layer": 7}, {"pose": 99}, {"layer": 1, "pose": -1}]
)
def test_a_state_outside_the_library_is_refused(library, where):
    with pytest.raises(CommandError, match="layers 1 to 4 have"):
        KeyposeGenerator(library).advance(replace(ChainState(), **where), Command(0.05))
