"""The range of commands that a library carries out for long: no fall, and as asked."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from itertools import repeat
from statistics import fmean

from gaitchain.analysis.walk_metrics import RUN_IN_S
from gaitchain.build import seed_banks
from gaitchain.build.families import build_of
from gaitchain.build.own_trials import run_own_trials
from gaitchain.build.seed_banks import SeedBank
from gaitchain.build.trial import Trial, TrialRun, run_trials
from gaitchain.build.workers import Crew, in_round
from gaitchain.gait.command_range import CommandRange
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.schedule import Segment
from gaitchain.messages import Command
from gaitchain.sim.world import DISTURBANCES, World

_End = tuple[int, int]
"""Axis of the command, and 0 for its low end or 1 for its high one."""
PARTS = tuple(i / 20 for i in range(20, 2, -1))
"""Parts of an end of the range, tried in this order until one passes."""
_SECONDS = 20.0
_RUNS = 24  # walks of each command, each in a different world
_FEWER = 12  # of them: what an end has to hold that holds all at no speed
_AT_ONCE = 4  # of them are walked before it is asked whether one fell
_OWN_RUNS = 4  # the same in the robot's own model
HARD: Mapping[str, float] = {
    "payload": 0.2,
    "servo_gain": 0.8,
    "friction": 0.4,
    "delay_s": 0.04,
}
"""Disturbances beyond those of training; the range is to hold with each of them."""
_SCHEDULES = 10  # random ones with one of them
_HARD_RUNS = 4  # walks of each end with one that these do not hold
_HARD_TURNS, _LESS = 6, 0.9  # how often an end is reduced, and to which part
_AXES = ("vx", "vy", "yaw_rate")
_SHORT = 0.1  # of the command: what may be missing of the speed or of the turn
_LEAST_SLOW = 0.5  # of an end: a robot that is slow there, too, is so at any speed


def hold_steady(library: GaitLibrary, crew: Crew) -> GaitLibrary:
    """Reduce the range of commands to speeds that are held for long.

    Random schedules rarely stay long at one end of the range. An end at which the robot
    falls, or goes a tenth slower than asked, is tried again at a lower speed. Walks are
    so many that an end at which one in five falls rarely passes: twelve hold with a
    chance of 7 %, all with 0.5 %. A robot that falls now and then at every speed gains
    nothing from losing that direction, so such an end is the largest command that held
    twelve. A robot that is too slow at half of it, too, is given the command at which
    it was fastest.
    The steps are kept: a speed that cannot be held may still be possible for a step or
    two.

    Args:
        library: a library with its verdicts on steps.
        crew: processes and worlds.

    Returns:
        The library with its `steady` range.
    """
    span = library.command_range
    tried = {end: _Tried() for end in build_of(library.poses).steady_ends(span)}
    if not tried:
        return library
    for turn, part in enumerate(PARTS):
        left = [end for end, one in tried.items() if not one.held]
        if not left:
            break
        stage = in_round("walking on and on", turn)
        walks = _walk(library, left, part, crew, turn)
        tracked = crew.track(stage, walks, len(left) * _RUNS)
        for end, shares in _by_end(tracked).items():
            tried[end].note(part, shares)
    found = {end: one.held or one.fewer for end, one in tried.items()}
    return replace(library, steady=_parts_of(span, found))


@dataclass
class _Tried:
    """What was tried of one end of the range; 0 where nothing held."""

    held: float = 0.0
    """Part of the end that all walks held."""
    fewer: float = 0.0
    """The largest part that `_FEWER` held."""
    fastest: tuple[float, float] = 0.0, 0.0
    """Largest part of the end's speed that was walked, and for which command."""

    def note(self, part: float, shares: list[float]) -> None:
        """Take note of walks, by the parts of a command that they had."""
        share = _mean(shares)
        if share:
            self.fastest = max(self.fastest, (share * part, part))
        if share >= 1.0 - _SHORT:
            self.held = part
        elif part <= _LEAST_SLOW:
            self.held = self.fastest[1]
        if _mean(shares[:_FEWER]) >= 1.0 - _SHORT:
            self.fewer = self.fewer or part


def hold_hard(library: GaitLibrary, crew: Crew) -> GaitLibrary:
    """Reduce the range further until random schedules hold with a disturbance, too.

    Args:
        library: with its `steady` range, and how it recovers.
        crew: processes and worlds.
    """
    if not build_of(library.poses).steady_ends(library.command_range):
        return library
    for kind in HARD:
        library = _hold_with(kind, library, crew)
    return library


def _hold_with(kind: str, library: GaitLibrary, crew: Crew) -> GaitLibrary:
    """Reduce the end that falls most by a tenth until random schedules hold.

    Where no end falls, or much less is no help, the robot would fall at any speed.
    """
    left = library
    for turn in range(_HARD_TURNS):
        if not _schedules_fall(kind, left, crew, turn):
            return left
        change = partial(_with, kind, crew)
        stage = in_round(f"walking on with {DISTURBANCES[kind].label}", turn)
        falls = _falls_at_ends(stage, change, left, crew, turn)
        weakest = max(falls, key=lambda end: falls[end])
        if not falls[weakest]:
            return left
        parts = dict.fromkeys(falls, 1.0) | {weakest: _LESS}
        left = replace(left, steady=_parts_of(left.command_range, parts))
    return library


def _schedules_fall(kind: str, library: GaitLibrary, crew: Crew, turn: int) -> bool:
    trial = Trial(library, require_qualified=False, figures=False)
    seed = _seed(seed_banks.HARD, library, turn, (len(_AXES), 0))
    walks = run_trials(_with(kind, crew, trial), _SCHEDULES, seed, crew.workers)
    stage = in_round(f"walking schedules with {DISTURBANCES[kind].label}", turn)
    fell = [run.fell for run in crew.track(stage, walks, _SCHEDULES)]
    return any(fell)


def slow_weakest(
    library: GaitLibrary, turn: int, part: float, crew: Crew
) -> GaitLibrary:
    """Reduce the ends of the range that fall most to a part; all, if they fall alike.

    A robot that falls when turning gains nothing from a slower speed ahead.

    Args:
        library: with its `steady` range.
        turn: number of such a reduction, which counts from 0.
        part: what is left of these ends.
        crew: processes and worlds.
    """
    change, stage = partial(_in_worlds, crew), in_round("walking at the ends", turn)
    falls = _falls_at_ends(stage, change, library, crew, _HARD_TURNS + turn)
    most = max(falls.values(), default=0)
    parts = {end: part if fell == most else 1.0 for end, fell in falls.items()}
    return replace(library, steady=_parts_of(library.command_range, parts))


def _falls_at_ends(
    stage: str,
    change: Callable[[Trial], Trial],
    library: GaitLibrary,
    crew: Crew,
    turn: int,
) -> dict[_End, int]:
    """Return how many walks of each end fall in other worlds."""
    ends = build_of(library.poses).steady_ends(library.command_range)

    def walk() -> Iterator[tuple[_End, TrialRun]]:
        for end in ends:
            trial = change(_straight(library, end, 1.0)[0])
            seed = _seed(seed_banks.HARD, library, turn, end)
            for run in run_trials(trial, _HARD_RUNS, seed, crew.workers):
                yield end, run

    falls = dict.fromkeys(ends, 0)
    for end, run in crew.track(stage, walk(), len(ends) * _HARD_RUNS):
        falls[end] += run.fell
    return falls


def _in_worlds(crew: Crew, trial: Trial) -> Trial:
    """Return a trial in the worlds of the crew."""
    return replace(trial, worlds=crew.worlds)


def _with(kind: str, crew: Crew, trial: Trial) -> Trial:
    """Return a trial with one of the disturbances.

    Where the floor gives way most, a sway with late servos grows most.
    """
    worlds = crew.worlds.harder().but(push_ns=0.0, contact_s=World.contact_s)
    return replace(trial, worlds=worlds, fixed={kind: HARD[kind]})


def hold_own(library: GaitLibrary, file: str, crew: Crew) -> GaitLibrary:
    """Reduce the range further, to commands that do not fall in the robot's own model.

    Args:
        library: with its `steady` range.
        file: of the robot, see `own_trials.run_own_trials`.
        crew: processes.
    """
    span = library.command_range
    left = build_of(library.poses).steady_ends(span)
    if not left:
        return library
    held = dict.fromkeys(left, 0.0)
    for turn, part in enumerate(PARTS):
        if not left:
            break
        stage = in_round("walking on in its own model", turn)
        walks = _walk_own(library, left, part, (file, crew.workers), turn)
        tracked = crew.track(stage, walks, len(left) * _OWN_RUNS)
        fell = {key for key, run in tracked if run.fell}
        held |= {key: part for key in left if key not in fell}
        left = [key for key in left if key in fell]
    return replace(library, steady=_parts_of(span, held))


def _parts_of(span: CommandRange, held: Mapping[_End, float]) -> CommandRange:
    """Return a range with a part of each of its ends, 0 where none is given."""
    ends = [
        (held.get((axis, 0), 0.0) * low + 0.0, held.get((axis, 1), 0.0) * high + 0.0)
        for axis, (low, high) in enumerate(span.ends)
    ]
    return CommandRange(*ends)


def _by_end(walks: Iterable[tuple[_End, float]]) -> dict[_End, list[float]]:
    """Return the parts of the speed that the walks at each end had."""
    reached: dict[_End, list[float]] = {}
    for key, share in walks:
        reached.setdefault(key, []).append(share)
    return reached


def _mean(shares: list[float]) -> float:
    """Return the mean part of the speed; 0 where a walk fell."""
    return fmean(shares) if all(shares) else 0.0


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
        seed = _seed(seed_banks.STEADY, library, turn, key)
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


def _walk_own(
    library: GaitLibrary,
    ends: list[_End],
    part: float,
    own: tuple[str, int],
    turn: int,
) -> Iterator[tuple[_End, TrialRun]]:
    """Yield the walks at each end in the robot's own model, its file and workers."""
    file, workers = own
    for key in ends:
        trial, _ = _straight(library, key, part)
        seed = _seed(seed_banks.OWN_STEADY, library, turn, key)
        for run in run_own_trials(trial, file, _OWN_RUNS, seed, workers):
            yield key, run


def _straight(library: GaitLibrary, key: _End, part: float) -> tuple[Trial, float]:
    """Return a trial of a part of one end of the range, and its speed."""
    axis, end = key
    speed = part * library.command_range.ends[axis][end]
    segment = Segment(Command(**{_AXES[axis]: speed}), _SECONDS)
    trial = Trial(library, schedule=(segment,), require_qualified=False, figures=False)
    return trial, speed


def _seed(bank: SeedBank, library: GaitLibrary, turn: int, key: _End) -> int:
    """Return a seed of its own for each end, round and build."""
    return bank.first(library.config.seed) + 64 * turn + 2 * key[0] + key[1]


def _reached(run: TrialRun, axis: int, speed: float) -> float:
    """Return the part of the commanded speed that a walk had; 0 where it fell."""
    if run.fell:
        return 0.0
    if _AXES[axis] != "yaw_rate":
        return max(run.speed_mps or 0.0, 0.0) / abs(speed)
    drift = math.radians(abs(run.yaw_drift_deg or 0.0)) / abs(speed)
    return 1.0 - max(drift - RUN_IN_S, 0.0) / _SECONDS
