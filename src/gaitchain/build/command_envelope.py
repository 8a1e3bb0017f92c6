"""The range of commands that a library carries out for long: no fall, and as asked."""

import math
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import repeat
from statistics import fmean
from typing import Generic, TypeVar

from gaitchain.analysis.walk_metrics import RUN_IN_S
from gaitchain.build.families import build_of
from gaitchain.build.own_model import run_own_trials
from gaitchain.build.trial import Trial, TrialRun, run_trials
from gaitchain.build.workers import Crew, in_round
from gaitchain.gait.command_range import CommandRange
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.schedule import Segment
from gaitchain.messages import Command
from gaitchain.sim.world import World

_End = tuple[int, int]
"""Axis of the command, and 0 for its low end or 1 for its high one."""
PARTS = tuple(i / 20 for i in range(20, 2, -1))
"""Parts of an end of the range, tried in this order until one passes."""
_SECONDS = 20.0
# Walks of each command, each in a different world: of so many parts that are tried, one
# that falls in one walk of five passes twelve in 7 %, this many in 0.5 %.
_RUNS = 24
_AT_ONCE = 4  # of them are walked before it is asked whether one fell
_OWN_RUNS = 4  # the same in the robot's own model
HARD: Mapping[str, float] = {
    "payload": 0.2,
    "servo_gain": 0.8,
    "friction": 0.4,
    "delay_s": 0.04,
}
"""Disturbances beyond those of training; the range is to hold with each of them."""
_SCHEDULES = 10  # random ones with each of them
_HARD_RUNS = 4  # walks of each command with one that the schedules do not hold
# Above those of a user's trial and of the gate.
_SEED, _OWN_SEED, _HARD_SEED = 2**33, 2**35, 2**36
_SEEDS = 4096  # seeds reserved for each build
_AXES = ("vx", "vy", "yaw_rate")
_SHORT = 0.1  # of the command: what may be missing of the speed or of the turn
_LEAST_SLOW = 0.5  # of an end: who is slow there, too, is so at any speed
_Key = TypeVar("_Key", bound=Hashable)


@dataclass(frozen=True)
class _Test(Generic[_Key]):
    """Walks that tell whether a part of an end of the range holds."""

    stage: str
    """Name of the stage of the build."""
    runs: int
    """Number of walks of each part."""
    walk: Callable[[_Key, float, int], Iterator[TrialRun]]
    """Walks the part of a key's end in a round."""

    def held(
        self, keys: Sequence[_Key], parts: Iterable[float], crew: Crew
    ) -> dict[_Key, float]:
        """Return of each key the first part without a fall; of some there is none."""
        held: dict[_Key, float] = {}
        left = list(keys)
        for turn, part in enumerate(parts):
            if not left:
                break
            walks = ((k, run) for k in left for run in self.walk(k, part, turn))
            stage = in_round(self.stage, turn)
            tracked = crew.track(stage, walks, len(left) * self.runs)
            fell = {key for key, run in tracked if run.fell}
            held |= {key: part for key in left if key not in fell}
            left = [key for key in left if key in fell]
        return held


def hold_steady(library: GaitLibrary, crew: Crew) -> GaitLibrary:
    """Reduce the range of commands to speeds that are held for long.

    Random schedules rarely stay long at one end of the range. An end at which the robot
    falls, or goes a tenth slower than asked, is tried again at a lower speed. A robot
    that is too slow at half of it, too, is given the command at which it was fastest.
    The steps are kept: a speed that cannot be held may still be possible for a step or
    two.

    Args:
        library: a library with its verdicts on steps.
        crew: processes and worlds.

    Returns:
        The library with its `steady` range.
    """
    span = library.command_range
    left = build_of(library.poses).steady_ends(span)
    if not left:
        return library
    held = dict.fromkeys(left, 0.0)
    fastest = dict.fromkeys(left, (0.0, 0.0))
    for turn, part in enumerate(PARTS):
        if not left:
            break
        stage = in_round("walking on and on", turn)
        walks = _walk(library, left, part, crew, turn)
        tracked = crew.track(stage, walks, len(left) * _RUNS)
        for key, share in _mean_reached(tracked).items():
            if share:
                fastest[key] = max(fastest[key], (share * part, part))
            if share >= 1.0 - _SHORT:
                held[key] = part
            elif part <= _LEAST_SLOW:
                held[key] = fastest[key][1]
        left = [key for key in left if not held[key]]
    return replace(library, steady=_parts_of(span, held))


def hold_hard(library: GaitLibrary, crew: Crew) -> GaitLibrary:
    """Reduce the range further where random schedules fall with a disturbance.

    With each of these, each end is reduced to what is walked on and on. One that falls
    at half of it, too, stays as it is: slower would be no help.

    Args:
        library: with its `steady` range, and how it recovers.
        crew: processes and worlds.
    """
    span = library.command_range
    ends = build_of(library.poses).steady_ends(span)
    if not ends:
        return library

    def walk(key: tuple[_End, str], part: float, turn: int) -> Iterator[TrialRun]:
        end, kind = key
        trial, _ = _straight(library, end, part)
        seed = _HARD_SEED + _number(library, turn, end)
        return run_trials(_with(kind, trial, crew), _HARD_RUNS, seed, crew.workers)

    test = _Test("walking on with a disturbance", _HARD_RUNS, walk)
    parts = [part for part in PARTS if part >= _LEAST_SLOW]
    falls = _falling(library, crew)
    found = test.held([(end, kind) for end in ends for kind in falls], parts, crew)
    held = dict.fromkeys(ends, 1.0)
    for (end, _), part in found.items():
        held[end] = min(held[end], part)
    return replace(library, steady=_parts_of(span, held))


def _falling(library: GaitLibrary, crew: Crew) -> list[str]:
    """Return the disturbances with which random schedules fall."""
    trial = Trial(library, require_qualified=False, figures=False)

    def walk(kind: str, part: float, turn: int) -> Iterator[TrialRun]:
        seed = _HARD_SEED + _number(library, turn, (len(_AXES), 0))
        del part
        hard = _with(kind, trial, crew)
        return run_trials(hard, _SCHEDULES, seed, crew.workers)

    test = _Test("walking schedules with a disturbance", _SCHEDULES, walk)
    return [kind for kind in HARD if kind not in test.held(list(HARD), (1.0,), crew)]


def _with(kind: str, trial: Trial, crew: Crew) -> Trial:
    """Return a trial with one of the disturbances.

    Where the floor gives way most, a sway with late servos grows most.
    """
    worlds = crew.worlds.harder().but(push_ns=0.0, contact_s=World.contact_s)
    return replace(trial, worlds=worlds, fixed={kind: HARD[kind]})


def hold_own(library: GaitLibrary, file: str, crew: Crew) -> GaitLibrary:
    """Reduce the range further, to commands that do not fall in the robot's own model.

    Args:
        library: with its `steady` range.
        file: of the robot, see `own_model.run_own_trials`.
        crew: processes.
    """
    span = library.command_range
    ends = build_of(library.poses).steady_ends(span)
    if not ends:
        return library

    def walk(key: _End, part: float, turn: int) -> Iterator[TrialRun]:
        trial, _ = _straight(library, key, part)
        seed = _OWN_SEED + _number(library, turn, key)
        return run_own_trials(trial, file, _OWN_RUNS, seed, crew.workers)

    test = _Test("walking on in its own model", _OWN_RUNS, walk)
    held = test.held(ends, PARTS, crew)
    return replace(library, steady=_parts_of(span, held))


def _parts_of(span: CommandRange, held: Mapping[_End, float]) -> CommandRange:
    """Return a range with a part of each of its ends, 0 where none is given."""
    ends = [
        (held.get((axis, 0), 0.0) * low + 0.0, held.get((axis, 1), 0.0) * high + 0.0)
        for axis, (low, high) in enumerate(span.ends)
    ]
    return CommandRange(*ends)


def _mean_reached(walks: Iterable[tuple[_End, float]]) -> dict[_End, float]:
    """Return the mean part of the speed at each end; 0 where a walk fell."""
    reached: dict[_End, list[float]] = {}
    for key, share in walks:
        reached.setdefault(key, []).append(share)
    return {key: fmean(s) if all(s) else 0.0 for key, s in reached.items()}


def _walk(
    library: GaitLibrary,
    ends: list[_End],
    part: float,
    crew: Crew,
    turn: int,
) -> Iterator[tuple[_End, float]]:
    """Yield for each walk (axis, low or high end) and the part of the speed it had."""
    worlds = crew.worlds.harder().but(push_ns=0.0)
    for key in ends:
        trial, speed = _straight(library, key, part)
        seed = _SEED + _number(library, turn, key)
        shares = _shares(replace(trial, worlds=worlds), (key[0], speed), seed, crew)
        yield from ((key, share) for share in shares)


def _shares(
    trial: Trial, command: tuple[int, float], seed: int, crew: Crew
) -> Iterator[float]:
    """Yield the part of a command that each walk had; 0 for all after a fall."""
    fell = False
    for first in range(0, _RUNS, _AT_ONCE):
        runs = min(_AT_ONCE, _RUNS - first)
        if fell:  # one is enough: the others need not be walked
            yield from repeat(0.0, runs)
            continue
        for run in run_trials(trial, runs, seed, crew.workers, first):
            fell |= run.fell
            yield _reached(run, *command)


def _straight(library: GaitLibrary, key: _End, part: float) -> tuple[Trial, float]:
    """Return a trial of a part of one end of the range, and its speed."""
    axis, end = key
    speed = part * library.command_range.ends[axis][end]
    segment = Segment(Command(**{_AXES[axis]: speed}), _SECONDS)
    trial = Trial(library, schedule=(segment,), require_qualified=False, figures=False)
    return trial, speed


def _number(library: GaitLibrary, turn: int, key: _End) -> int:
    """Return a number of its own for each end, round and build."""
    return _SEEDS * library.config.seed + 64 * turn + 2 * key[0] + key[1]


def _reached(run: TrialRun, axis: int, speed: float) -> float:
    """Return the part of the commanded speed that a walk had; 0 where it fell."""
    if run.fell:
        return 0.0
    if _AXES[axis] != "yaw_rate":
        return max(run.speed_mps or 0.0, 0.0) / abs(speed)
    drift = math.radians(abs(run.yaw_drift_deg or 0.0)) / abs(speed)
    return 1.0 - max(drift - RUN_IN_S, 0.0) / _SECONDS
