"""Walk on and on at the ends of what a dynamic library can be asked for."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from gaitchain.library import GaitLibrary
from gaitchain.messages import Command
from gaitchain.qualify import Crew
from gaitchain.timed_schedule import TimedSegment
from gaitchain.trial import run_trials

_SECONDS = 15.0
_RUNS = 6  # of each command, each in a world of its own
_ROUNDS = 8
_SEED = 2**33  # not one that a user's trial has


def hold_steady(library: GaitLibrary, crew: Crew) -> GaitLibrary:
    """Forbid the strides of steady walks that fall, and try what is left.

    Random walks rarely stay long at one end of the range. A command that fell loses
    the steps between the two strides that it was walking; a new round tries the end of
    the range that is left.

    Args:
        library: with its verdicts on steps.
        crew: who does the physics.

    Returns:
        The library whose steady walks hold.
    """
    for turn in range(_ROUNDS if library.dynamic else 0):
        commands = list(_ends(library))
        stage = "walking on and on" + (f", round {turn + 1}" * (turn > 0))
        total = len(commands) * _RUNS
        steps = [
            s
            for s in crew.told(stage, _fallen(library, commands, crew, turn), total)
            if s
        ]
        if not steps:
            break
        runs = np.array(library.pair_runs)
        for first, last in steps:
            runs[first, last] += 1
            runs[last, first] += 1
        library = replace(library, pair_runs=runs)
    return library


def _ends(library: GaitLibrary) -> Iterator[Command]:
    span = library.command_range
    for vx in span.vx:
        yield Command(vx)
    for vy in span.vy:
        yield Command(0.0, vy)
    for yaw_rate in span.yaw_rate:
        yield Command(0.0, 0.0, yaw_rate)


def _fallen(
    library: GaitLibrary, commands: list[Command], crew: Crew, turn: int
) -> Iterator[tuple[int, int] | None]:
    """Yield for each walk the step on which it fell, None where it stood."""
    for i, command in enumerate(commands):
        trials = run_trials(
            library,
            _RUNS,
            _SEED + _ROUNDS * i + turn,
            workers=crew.workers,
            worlds=crew.worlds,
            schedule=(TimedSegment(command, _SECONDS),),
            require_qualified=False,
        )
        for trial in trials:
            yield trial.last_step if trial.fell else None
