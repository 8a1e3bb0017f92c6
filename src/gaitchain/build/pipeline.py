"""Build a gait library: the order of its stages, from candidates to the gates."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np

from gaitchain.build.command_envelope import hold_hard, hold_steady
from gaitchain.build.families import build_of, build_of_family
from gaitchain.build.gait_build import Candidates, Draw, Drawing
from gaitchain.build.gate import gate, gate_own
from gaitchain.build.no_walk import NoWalkError, check_walks
from gaitchain.build.progress import Progress
from gaitchain.build.qualify import qualify_steps
from gaitchain.build.recovery_walks import recover
from gaitchain.build.training_walks import Samples, walk_gaits
from gaitchain.build.usual_errors import StepErrors, learn_usual, learn_usual_off
from gaitchain.build.workers import Crew
from gaitchain.chain.choice_gain import ChoiceGain, choice_gain
from gaitchain.chain.expectation import expected_costs, path_costs, pose_costs
from gaitchain.chain.layered_chain import FloatArray, IntArray, LayeredChain
from gaitchain.chain.policy import Regret, forbid
from gaitchain.chain.pruning import independent_gaits, pose_distances, prune
from gaitchain.chain.sampling import Mask
from gaitchain.chain.training import train_batch, train_by_cost, train_sequential
from gaitchain.discover.loaded_robot import load_robot
from gaitchain.errors import ChainError, CommandError, LibraryError
from gaitchain.gait.build_config import BuildConfig
from gaitchain.gait.command_range import CommandRange
from gaitchain.gait.family import GaitPoses
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.qualification import GateReport
from gaitchain.robot.robot import Robot, given_robot

_AHEAD = 1  # among the ends of a range
_HELD = 0.6  # part of the speeds of single steps that walks are to hold


@dataclass(frozen=True)
class BuildReport:
    """Figures of a build, for information; a walk does not need them."""

    candidates: tuple[int, ...]
    """Poses per layer before pruning."""
    kept: tuple[int, ...]
    """Poses per layer after pruning."""
    mean_cost: float
    """Mean training cost of a step."""
    falls: int
    """Number of training walks that fell."""
    independent_gaits: int
    """Size of the zeta independent gait group, zeta = epsilon."""
    regret: Regret | None
    """Regret of both policies on the planned cost, against all gaits; None for strides,
    which have no planned cost, and where there are too many gaits."""
    pairs: int
    """Number of steps that were walked in physics and never fell."""
    gate: GateReport
    """What the gate found."""
    choice: ChoiceGain
    """Effect of pruning and of looking ahead on the expected cost."""


def build_library(
    config: BuildConfig,
    progress: Progress | None = None,
    workers: int = 1,
    robot: Robot | None = None,
) -> tuple[GaitLibrary, BuildReport]:
    """Draw candidates, train, prune and qualify.

    The result depends on the config only, not on the number of workers. It depends on
    the time needed only if `search_s` limits the search. A robot that holds no walk
    with its servos as stiff as in its file is built for once more with other ones, if
    walks say that these help, unless the config says how stiff.

    Args:
        config: configuration of the build.
        progress: called with (stage, done, total) as the work proceeds.
        workers: number of processes for the physics.
        robot: the robot, if it is loaded already.

    Returns:
        The library, qualified or not, and the report.

    Raises:
        NoWalkError: physics passes no walk ahead.
        LibraryError: nor can it be built with the other servos.
        GaitchainError: the robot, the preset or a number is not usable.
    """
    _check_config(config)
    crew = Crew(workers, progress or (lambda stage, done, total: None))
    if robot is None:
        robot = load_robot(config.robot, config.profile)
    robot = given_robot(robot, CommandError)
    if config.servo_gain is not None:
        return _build(config, robot.with_servo_gain(config.servo_gain), crew)
    try:
        return _build(config, robot, crew)
    except NoWalkError as none:
        if none.servo_gain is None:
            raise
        first, gain = none, none.servo_gain * robot.servo_gain
    return _build_again(config, robot.with_servo_gain(gain), crew, first)


def _check_config(config: object) -> None:
    if not isinstance(config, BuildConfig):
        raise CommandError(
            f"{config!r:.80} is no configuration of a build; give "
            "BuildConfig(robot='res')"
        )


def _build_again(
    config: BuildConfig, robot: Robot, crew: Crew, first: NoWalkError
) -> tuple[GaitLibrary, BuildReport]:
    """Build for a robot with other servo gains than those that held no walk.

    Args:
        config: configuration of the build.
        robot: with the other gains.
        crew: processes and progress.
        first: why it is built again.
    """
    gain = robot.servo_gain
    try:
        return _build(config, robot, crew.on(f"servos {gain:g} times"))
    except NoWalkError:
        raise  # it says with which servos
    except (ChainError, LibraryError) as error:
        why = f"{first}. Built with servos {gain:g} times as stiff: {error}"
        raise LibraryError(why) from None


def _build(
    config: BuildConfig, robot: Robot, crew: Crew
) -> tuple[GaitLibrary, BuildReport]:
    seeds = np.random.SeedSequence(config.seed).spawn(5)
    draws, walks, tests, searches, recoveries = map(np.random.default_rng, seeds)
    drawings = build_of_family(config.family).drawings(
        Draw(config, robot, draws, searches, crew)
    )
    trained = _steadiest(_train_all(config, drawings, crew, (walks, tests)))
    found, library = _first_qualified(
        trained, partial(_qualify, config, rngs=(tests, recoveries))
    )
    return library, _report(config, found, library)


class _Trained(NamedTuple):
    """What one set of candidates became."""

    drawn: Candidates
    samples: Samples
    draft: GaitLibrary
    """Before physics passed its steps."""
    held: GaitLibrary
    """With the range of commands that holds for long."""
    errors: StepErrors
    crew: Crew
    """With the worlds of training."""

    @property
    def sound(self) -> Crew:
        """The same without faults of servos and sensors."""
        return replace(self.crew, worlds=self.crew.worlds.sound())

    @property
    def steps(self) -> CommandRange:
        """The speeds that single steps reach."""
        return replace(self.held, steady=None).command_range

    def part_of(self, most: CommandRange) -> float:
        """Return which part of a range holds for long.

        Ahead counts as much as all other ends together. It is 0 where nothing ahead
        holds: such a library is refused.
        """
        ends = np.ravel(most.ends)
        parts = np.ravel(self.held.command_range.ends) / np.where(ends, ends, np.inf)
        ahead, others = parts[_AHEAD], np.delete(parts, _AHEAD)
        if ahead <= 0.0:
            return 0.0
        others = others[np.delete(ends, _AHEAD) != 0.0]
        return float(ahead + (others.mean() if others.size else ahead)) / 2.0


def _train_all(
    config: BuildConfig,
    drawings: Iterable[Drawing],
    crew: Crew,
    rngs: tuple[np.random.Generator, np.random.Generator],
) -> Iterator[_Trained]:
    """Train on each set of candidates that can be walked with.

    Raises:
        ChainError, LibraryError: why the first cannot, if no other one can.
    """
    first: ChainError | LibraryError | None = None
    able = False
    for number, drawing in enumerate(drawings, start=1):
        own = crew.on(f"shape {number}") if number > 1 else crew
        try:
            trained = _train(config, drawing(), own, rngs)
        except (ChainError, LibraryError) as fault:
            first = first or fault
        else:
            able = True
            yield trained
    if first and not able:
        raise first


def _train(
    config: BuildConfig,
    drawn: Candidates,
    crew: Crew,
    rngs: tuple[np.random.Generator, np.random.Generator],
) -> _Trained:
    """Train on candidates, and find what holds for long.

    Args:
        config: of the build.
        drawn: the candidates.
        crew: processes.
        rngs: sources of randomness for training and for tests.
    """
    walks, tests = rngs
    own = build_of(drawn.poses)
    worlds = own.training_worlds(drawn.poses, config.speed_limit_deg_s)
    crew = replace(crew, worlds=worlds)
    sound = replace(crew, worlds=worlds.sound())
    samples = walk_gaits(config, drawn, walks, crew, directed=config.family.directed)
    draft = _learn(config, drawn, samples)
    size = config.cover_walks, config.steps_per_walk
    tested, errors = qualify_steps(draft, size, tests, sound, drawn.pairs)
    return _Trained(drawn, samples, draft, hold_steady(tested, crew), errors, crew)


def _steadiest(trained: Iterator[_Trained]) -> Iterator[_Trained]:
    """Yield trained libraries, the steadiest first.

    A search compares shapes by short walks at a high pace, so that what it finds may
    not walk for long.
    """
    tried = [next(trained)]
    steps = tried[0].steps
    while tried[0].part_of(tried[0].steps) < _HELD:
        other = next(trained, None)
        if other is None:
            break
        tried = sorted([*tried, other], key=lambda one: -one.part_of(steps))
    yield from tried
    yield from trained


def _qualify(
    config: BuildConfig,
    found: _Trained,
    rngs: tuple[np.random.Generator, np.random.Generator],
) -> GaitLibrary:
    """Learn what is usual and how to recover, and walk the gates.

    Args:
        config: of the build.
        found: what was trained.
        rngs: sources of randomness for tests and for recoveries.

    Raises:
        NoWalkError: it holds no speed ahead.
        ChainError, LibraryError: its steps form no walk.
    """
    tests, recoveries = rngs
    held, crew = found.held, found.crew
    check_walks(held, crew)
    usual = learn_usual(held, found.errors, tests, found.sound)
    steady = learn_usual_off(usual, tests, crew)
    able = recover(steady, config.disturbed_walks, recoveries, crew)
    firm = hold_hard(able, crew)
    passed = gate(firm, config.gate_runs, config.gate_share, config.seed, crew)
    return gate_own(passed, config, crew)


def _first_qualified(
    trained: Iterator[_Trained], qualify: Callable[[_Trained], GaitLibrary]
) -> tuple[_Trained, GaitLibrary]:
    """Return the first that is qualified, with its library; if none is, the first.

    Raises:
        ChainError, LibraryError: why the first cannot walk, if no other one can.
    """
    refused: tuple[_Trained, GaitLibrary] | None = None
    first: ChainError | LibraryError | None = None
    for found in trained:
        try:
            library = qualify(found)
        except (ChainError, LibraryError) as fault:
            first = first or fault
            continue
        if library.qualified:
            return found, library
        refused = refused or (found, library)
    if refused:
        return refused
    assert first is not None  # something was trained
    raise first


def _report(config: BuildConfig, found: _Trained, library: GaitLibrary) -> BuildReport:
    drawn, samples, draft = found[:3]
    poses = drawn.poses
    tested = library.qualification.gate
    assert tested is not None  # `gate` has just made it
    full = path_costs(poses.counts, samples.gaits, samples.costs, _shrink(config))
    gain = choice_gain(
        forbid(full, drawn.edges),
        draft.path_costs,
        draft.edge_costs,
        library.allowed_pairs,
    )
    return BuildReport(
        candidates=poses.counts,
        kept=library.poses.counts,
        mean_cost=float(samples.costs.mean()),
        falls=samples.falls,
        independent_gaits=_gait_group_size(draft, config.least_distance),
        regret=build_of(poses).planned_regret(
            poses, draft.timing, drawn.edges, config.seed
        ),
        pairs=int(library.allowed_pairs.sum()),
        gate=tested,
        choice=gain,
    )


def _learn(
    config: BuildConfig,
    drawn: Candidates,
    samples: Samples,
) -> GaitLibrary:
    """Train the chain, prune it, and compute the expected costs of the kept edges."""
    (gaits, costs, _), poses, allowed = samples, drawn.poses, drawn.edges
    shrink = _shrink(config)
    learned = expected_costs(poses.counts, gaits, costs, shrink)
    ahead = path_costs(poses.counts, gaits, costs, shrink)
    if config.training == "sequential":
        chain = train_sequential(LayeredChain.uniform(poses.counts), gaits, costs)
    elif config.family.directed:
        chain = train_by_cost(learned.cost)
    else:
        chain = train_batch(poses.counts, gaits, costs)
    pruned = prune(
        chain,
        pose_costs(learned),
        config.least_distance,
        layers=[1, 2],
        classes=_landing_classes(poses, allowed),
    )
    kept = pruned.kept
    edge_costs = _keep_edges(forbid(learned.cost, allowed), kept)
    path = _keep_edges(forbid(ahead, allowed), kept)
    left = poses.keep(kept)
    return GaitLibrary.untested(
        left, drawn.timing, pruned.chain, (edge_costs, path), config
    )


def _shrink(config: BuildConfig) -> float | None:
    """Return the strength of shrinking costs; None where it is estimated."""
    return None if config.family.directed else 1.0


def _landing_classes(poses: GaitPoses, allowed: tuple[Mask, ...]) -> list[IntArray]:
    """Label the poses of kp_3 by their landings, as each landing has its own speeds."""
    classes = [np.zeros(n, dtype=np.int64) for n in poses.counts]
    classes[2] = np.unique(allowed[2], axis=0, return_inverse=True)[1].reshape(-1)
    return classes


def _keep_edges(
    costs: tuple[FloatArray, ...], kept: tuple[IntArray, ...]
) -> tuple[FloatArray, ...]:
    return tuple(c[np.ix_(kept[i], kept[i + 1])] for i, c in enumerate(costs))


def _gait_group_size(draft: GaitLibrary, zeta: float) -> int:
    gaits = draft.gait_of.reshape(-1, 4)
    gaits = gaits[gaits[:, 0] >= 0]
    costs = sum(c[gaits[:, i], gaits[:, i + 1]] for i, c in enumerate(draft.path_costs))
    distances = pose_distances(draft.chain)
    return len(independent_gaits(gaits, distances, np.asarray(costs), zeta))
