"""The gate of a build: random schedules, in the skeleton and in the robot's own model.

A round that does not pass forbids the steps on which its schedules fell, and a new one,
with other schedules and worlds, tests the remaining steps. Where that does not help, or
leaves none to walk with, the robot is tested as its file has it, without faults of
servos and sensors; then the range of commands is reduced. The verdict says so: a walk
that needs sound servos, or is slow, is worth more than none.
"""

import json
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from gaitchain.build.command_envelope import hold_own, slow_weakest
from gaitchain.build.own_trials import describe_own_model, run_own_trials
from gaitchain.build.qualify import can_walk
from gaitchain.build.seed_banks import GATE, OWN_GATE
from gaitchain.build.trial import Trial, TrialRun, run_trials
from gaitchain.build.workers import Crew, in_round
from gaitchain.errors import CommandError
from gaitchain.gait.build_config import BuildConfig
from gaitchain.gait.command_range import CommandRange
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.qualification import GateReport, OwnReport, Qualification
from gaitchain.sim.world_range import WorldRange

_ROUNDED = 1e-9  # of schedules: more than the error of a part of a million
_ROUNDS = 5  # in which steps are forbidden
_SLOW_ROUNDS, _SLOWER = 4, 0.8  # more of them, and the part of the range left each time

_Walks = Callable[[GaitLibrary, int, int], Iterator[TrialRun]]
"""Walks a library's schedules with a seed, in a round that counts from 0."""
_Slow = Callable[[GaitLibrary, int], GaitLibrary]
"""Reduces a library's range of commands; how often it was before counts from 0."""


class _Rounds(NamedTuple):
    """What the rounds of a gate left."""

    library: GaitLibrary
    rounds: int
    survived: int
    """In the last round."""


def gate(
    library: GaitLibrary, runs: int, share: float, seed: int, crew: Crew
) -> GaitLibrary:
    """Walk random schedules in rounds until the library passes one.

    Args:
        library: a library with its verdicts on steps.
        runs: schedules per round.
        share: part of a round that must not fall.
        seed: the build's seed.
        crew: processes and worlds.

    Returns:
        The library with its qualification.
    """
    own, sound = crew.worlds, crew.worlds.sound()
    seed, need = GATE.first(seed), _needed(share, runs)
    faulty = own.facts() != sound.facts()
    slow = 0 if faulty else _SLOW_ROUNDS
    walks = _in_worlds(own, runs, crew)
    found = _pass(library, walks, need, seed, slow, _weakest(own, crew))
    worlds, with_faults = own, None
    if faulty and found.survived < need:
        worlds, with_faults = sound, found.survived
        as_in_file = crew.on("servos and sensors as in the file")
        walks = _in_worlds(sound, runs, as_in_file)
        found = _pass(library, walks, need, seed, slow=_weakest(sound, as_in_file))
    report = GateReport(
        passed=found.survived > 0 and found.survived >= need,
        rounds=found.rounds,
        schedules=runs,
        survived=found.survived,
        feedback=True,
        worlds=json.loads(json.dumps(worlds.facts())),  # tuples to lists
        with_faults=with_faults,
    )
    return replace(found.library, qualification=Qualification(report))


def _needed(share: float, runs: int) -> int:
    """Return how many schedules are a part of a round: 0.28 of 25 are 7."""
    return math.ceil(share * runs - _ROUNDED)  # the product is 7.000000000000001


def _in_worlds(worlds: WorldRange, runs: int, crew: Crew) -> _Walks:
    """Return what walks random schedules in worlds of a range."""

    def walks(left: GaitLibrary, seed: int, turn: int) -> Iterator[TrialRun]:
        trial = Trial(left, worlds=worlds, require_qualified=False, figures=False)
        trials = run_trials(trial, runs, seed, crew.workers)
        return crew.track(in_round("walking random schedules", turn), trials, runs)

    return walks


def _weakest(worlds: WorldRange, crew: Crew) -> _Slow:
    """Return what slows down where the robot falls most in worlds of a range."""
    return partial(slow_weakest, part=_SLOWER, crew=replace(crew, worlds=worlds))


def _everywhere(library: GaitLibrary, _: int) -> GaitLibrary:
    """Slow down at all ends of the range."""
    ends = [(_SLOWER * low, _SLOWER * high) for low, high in library.command_range.ends]
    return replace(library, steady=CommandRange(*ends))


def _in_own_model(file: str, runs: int, crew: Crew) -> _Walks:
    """Return what walks random schedules in the robot's own model."""

    def walks(left: GaitLibrary, seed: int, turn: int) -> Iterator[TrialRun]:
        trial = Trial(left, require_qualified=False)
        trials = run_own_trials(trial, file, runs, seed, crew.workers)
        stage = in_round("walking in the robot's own model", turn)
        return crew.track(stage, trials, runs)

    return walks


def gate_own(library: GaitLibrary, config: BuildConfig, crew: Crew) -> GaitLibrary:
    """Walk the same in the robot's own model, if it has one that can be simulated.

    First the range of commands is reduced to what holds there for long.

    Args:
        library: a library that passed the gate; any other is returned as it is.
        config: of the build.
        crew: processes.

    Returns:
        The library, with what was walked in its qualification.
    """
    runs, file = config.own_runs, config.robot
    tests = library.qualification
    robot = library.robot
    # The file's model is not the robot that was identified.
    if not (runs and tests.passed) or robot.boxes or robot.identified is not None:
        return library
    try:
        facts = describe_own_model(file, library)
    except CommandError as error:
        report = OwnReport(passed=False, fault=str(error))
        return replace(library, qualification=replace(tests, own=report))

    library = hold_own(library, file, crew)
    need, seed = _needed(config.gate_share, runs), OWN_GATE.first(config.seed)
    found = _pass(library, _in_own_model(file, runs, crew), need, seed)
    report = OwnReport(
        passed=found.survived > 0 and found.survived >= need,
        rounds=found.rounds,
        schedules=runs,
        survived=found.survived,
        model=facts,
    )
    return replace(found.library, qualification=replace(tests, own=report))


def _pass(
    library: GaitLibrary,
    walks: _Walks,
    need: int,
    seed: int,
    slow_rounds: int = _SLOW_ROUNDS,
    slow: _Slow = _everywhere,
) -> _Rounds:
    """Walk rounds until enough schedules of one do not fall."""
    survived, rounds, slowed = 0, 0, 0
    most = _ROUNDS + slow_rounds * (library.steady is not None)
    while rounds < most and can_walk(library):
        results = list(walks(library, seed + rounds, rounds))
        fallen = [result.last_step for result in results if result.fell]
        survived, rounds = len(results) - len(fallen), rounds + 1
        if survived >= need:
            break  # forbidding more would leave an untested library
        left = _forbid_steps(library, fallen)
        slower = library.steady and (rounds >= _ROUNDS or not can_walk(left))
        if slower and slowed < slow_rounds:
            library, slowed = slow(library, slowed), slowed + 1
        else:
            library = left
    return _Rounds(library, rounds, survived)


def _forbid_steps(
    library: GaitLibrary, steps: Sequence[tuple[int, int]]
) -> GaitLibrary:
    """Forbid steps by adding a run without a pass to each."""
    runs = np.array(library.pair_runs)
    for first, last in steps:
        runs[first, last] += 1
    return replace(library, pair_runs=runs)
