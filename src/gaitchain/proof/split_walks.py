"""Walks for splitting: pushes and commands that are drawn anew in each slice. Ours.

The level of a walk is how far its DCM is from the nearer foot, in leg lengths, or how
far it has tilted or sunk on the way to a fall, whichever is most.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, NamedTuple

import mujoco
import numpy as np

from gaitchain.analysis.simulated_walk import WatchedLoop
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.build.grid import Cell, GridJob, grid_world
from gaitchain.build.jobs import run_jobs
from gaitchain.build.push import impulse_unit_ns
from gaitchain.build.workers import Crew
from gaitchain.gait.library import GaitLibrary
from gaitchain.messages import CONTROL_PERIOD_S, GRAVITY, Array, Command
from gaitchain.proof.proof_walks import CONES, mild_cells, seed_of
from gaitchain.proof.splitting import (
    EVENT,
    Chance,
    Seeds,
    SplitRun,
    brute_force,
    count_events,
    mean_chance,
    overlap,
    split,
)
from gaitchain.sim.push import Push
from gaitchain.sim.truth import FALL_HEIGHT, FALL_TILT
from gaitchain.sim.world import World
from gaitchain.walker.walker import Walker

SLICE_S = 1.0
_BANK, _ALONE = 4, 5  # of seeds, with splitting and without: the proof's is 3
_CHANGE = 0.25  # chance of another command in a slice
_BELOW = 0.999  # level of a robot that is nearly down but has not fallen
_ROBOT = 1  # body with all of the robot in its tree


@dataclass(frozen=True)
class Disturbed:
    """What is walked, and how hard it is disturbed."""

    library: GaitLibrary
    """Without a proof."""
    hardest: float
    """Impulse of a push is uniform up to this part of m sqrt(g h), one each second."""
    slices: int = 10
    """Seconds of a walk."""


@dataclass(frozen=True)
class SplitSize:
    """How much is walked."""

    paths: int = 48
    """In a repetition at a time."""
    repetitions: int = 8
    """Independent of each other."""
    alone: int = 384
    """Without splitting, beside them."""


@dataclass(frozen=True)
class SplitReport:
    """How seldom a library falls by splitting."""

    hardest: float
    """Pushes up to this part of m sqrt(g h), one each second."""
    seconds: float
    """Of a walk."""
    confidence: float
    """Of the intervals."""
    walks: int
    """All that were walked for splitting."""
    per_walk: Chance
    """Chance that a walk ends in a fall."""
    per_step: Chance
    """The same over the mean steps of a walk, those that fall included."""
    alone: tuple[int, int]
    """Walks without splitting, with seeds of their own, and falls in these."""
    brute: Chance
    """Chance that a walk ends in a fall by these alone."""
    agrees: bool
    """Whether some chance is in both intervals, splitting's and this one."""


class SliceWalk(NamedTuple):
    """What came of one walk."""

    levels: list[float]
    """Highest level in each slice, up to a fall."""
    steps: int


def split_falls(
    disturbed: Disturbed, size: SplitSize, confidence: float, crew: Crew
) -> SplitReport:
    """Estimate how seldom a library falls by splitting, and by other walks without.

    Args:
        disturbed: what is walked.
        size: how much.
        confidence: of the intervals.
        crew: processes and progress.
    """
    entropy, runs, steps = seed_of(disturbed.library), list[SplitRun](), list[int]()
    course, slices = _Course(disturbed, entropy, crew.workers), disturbed.slices
    stage = "splitting"
    crew.progress(stage, 0, size.repetitions)
    for number in range(size.repetitions):
        rng, first = np.random.default_rng((entropy, _BANK, number)), len(course.steps)
        runs.append(split(course.walk_all, slices, size.paths, rng))
        steps += course.steps[first]
        crew.progress(stage, number + 1, size.repetitions)
    stage = "walking without splitting"
    crew.progress(stage, 0, 1)
    alone = np.random.default_rng((entropy, _ALONE))
    met = count_events(course.walk_all, slices, size.alone, alone)
    steps += course.steps[-1]
    crew.progress(stage, 1, 1)
    return _report(disturbed, confidence, runs, (size.alone, met), steps)


def _report(
    disturbed: Disturbed,
    confidence: float,
    runs: Sequence[SplitRun],
    alone: tuple[int, int],
    steps: Sequence[int],
) -> SplitReport:
    """Combine repetitions with brute force; steps are those of unsplit walks.

    Walks that splitting has chosen are no sample of them: they fall more often, or
    have to wait longer for it.
    """
    each, long = mean_chance(runs, confidence), float(np.mean(steps))
    count, met = alone
    brute = Chance(*brute_force(met, count, confidence))
    return SplitReport(
        disturbed.hardest,
        disturbed.slices * SLICE_S,
        confidence,
        sum(run.paths for run in runs),
        each,
        Chance(**{name: part / long for name, part in asdict(each).items()}),
        alone,
        brute,
        overlap(each, brute),
    )


class _Course:
    """Walks paths in processes, and counts their steps."""

    def __init__(self, disturbed: Disturbed, entropy: int, workers: int) -> None:
        self._disturbed, self._entropy, self._workers = disturbed, entropy, workers
        self._scale_ns = impulse_unit_ns(disturbed.library)
        self._cells: Sequence[Cell] = mild_cells(disturbed.library)
        self.steps: list[list[int]] = []
        """Of the walks of each call; the first call of a repetition splits nothing."""

    def walk_all(self, seeds: Sequence[Seeds]) -> Iterator[list[float]]:
        fixed: tuple[Any, ...] = self._disturbed, self._cells, self._scale_ns
        jobs = [(*fixed, self._entropy, own) for own in seeds]
        steps = list[int]()
        self.steps.append(steps)
        for walk in run_jobs(walk_slices, jobs, SliceWalk, self._workers):
            steps.append(max(walk.steps, 1))
            yield walk.levels


def walk_slices(
    disturbed: Disturbed,
    cells: Sequence[Cell],
    scale_ns: float,
    entropy: int,
    seeds: Seeds,
) -> SliceWalk:
    """Walk a path; the world is that of its first seed.

    Args:
        disturbed: what is walked.
        cells: the mild worlds.
        scale_ns: m sqrt(g h) [N s].
        entropy: of the library.
        seeds: of the slices.
    """
    library = disturbed.library
    world = _draw_world(library, cells, entropy, seeds[0])
    hardest_ns, commands, pushes = disturbed.hardest * scale_ns, [], []
    command = Command()
    for number, seed in enumerate(seeds):
        rng = np.random.default_rng((entropy, _BANK, seed, number))
        if rng.random() < _CHANGE or number == 0:
            command = library.command_range.draw(rng)
        commands.append(command)
        at_s = number * SLICE_S + float(rng.uniform(0.0, SLICE_S - Push.duration_s))
        impulse_ns, side = float(rng.uniform(0.0, hardest_ns)), rng.uniform(-180, 180)
        pushes.append(Push(impulse_ns, float(side), at_s))
    backend = MujocoBackend(library.robot, replace(world, push=tuple(pushes)))
    loop = _LevelLoop(Walker(library), backend)
    return loop.walk(commands)


def _draw_world(
    library: GaitLibrary, cells: Sequence[Cell], entropy: int, seed: int
) -> World:
    rng = np.random.default_rng((entropy, _BANK, seed, 0, 1))
    cell = cells[int(rng.integers(len(cells)))]
    world = grid_world(library, GridJob((_BANK, seed), cell, "", ()), entropy, 0.0)
    return replace(world, cone=CONES[int(rng.integers(len(CONES)))])


class _LevelLoop(WatchedLoop):
    """A loop that notes how near the robot is to a fall."""

    def __init__(self, walker: Walker, backend: MujocoBackend) -> None:
        self._data, self._model = backend.data, backend.model
        self._leg = walker.library.robot.reduced.leg_length
        self._feet, self._truth = backend.feet, backend
        super().__init__(walker, backend)
        self._stands_m = float(self._data.qpos[2])
        com_m = float(self._data.subtree_com[_ROBOT, 2])
        self._fall_s = math.sqrt(com_m / GRAVITY)
        self._highest = 0.0

    def walk(self, commands: Sequence[Command]) -> SliceWalk:
        levels = list[float]()
        each = round(SLICE_S / CONTROL_PERIOD_S)
        for command in commands:
            self._highest = 0.0
            self.walker.command(command)
            held = self.run_until(self.ticks + each)
            levels.append(self._highest if held else EVENT)
            if not held:
                break
        return SliceWalk(levels, len(self.steps))

    def note(self, time_s: float, target: Array) -> None:
        self._highest = max(self._highest, min(self._level(), _BELOW))
        super().note(time_s, target)

    def _level(self) -> float:
        data = self._data
        mujoco.mj_subtreeVel(self._model, data)
        speed = data.subtree_linvel[_ROBOT, :2]
        dcm = data.subtree_com[_ROBOT, :2] + self._fall_s * speed
        away = np.linalg.norm(data.xpos[self._feet, :2] - dcm, axis=1).min()
        sunk = (1.0 - data.qpos[2] / self._stands_m) / (1.0 - FALL_HEIGHT)
        tilted = math.hypot(*self._truth.tilt) / FALL_TILT
        return float(max(away / self._leg, sunk, tilted))
