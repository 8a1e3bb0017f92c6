"""The grid: worlds in which every step and every command of a library is walked.

One disturbance is off at a time, so that a fall says what it came from, and two corners
have all mild levels at once. The full product of the levels is some 10^7 worlds, nearly
all of them too hard for any robot, and would say no more about a single cause.
"""

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from gaitchain.chain.layered_chain import IntArray
from gaitchain.chain.sampling import cover_once
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.schedule import Schedule
from gaitchain.sim.world import DISTURBANCES, Push, World
from gaitchain.walker.policy_table import safe_pairs

EVERY_STEP = "every step"
"""Group of the walks that visit every step, whatever the command."""
_COVER_STEPS = 22
_FIRST_PUSH_S, _PUSH_EVERY_S = 1.0, 2.0


@dataclass(frozen=True)
class Levels:
    """Levels of one disturbance."""

    kind: str
    """A number of `World`, or "push": parts of m sqrt(g h), every two seconds."""
    required: tuple[float, ...] = ()
    """Mild: a library that falls here does not pass, a step that does is taken out."""
    beyond: tuple[float, ...] = ()
    """Harder: walked to know where the limits are; nothing is forbidden for it."""


@dataclass(frozen=True)
class Cell:
    """One world of the grid."""

    name: str
    kind: str
    """That of its level, or "nominal" or "corner"."""
    required: bool
    numbers: tuple[tuple[str, float], ...] = ()
    """Kinds and levels where they are not nominal."""


@dataclass(frozen=True)
class Grid:
    """What is tested, and what counts as passed."""

    levels: tuple[Levels, ...]
    corners: bool = True
    """Two more cells: the first, and the last, required level of each at once."""
    seeds: int = 1
    """Walks of each command, and visits of all steps, in each cell."""
    share: float = 0.9
    """Part of the walks, and of the visits to a step, that must not fall."""

    def quick(self) -> "Grid":
        """Return only the last required level of each disturbance, and the corners."""
        levels = tuple(Levels(lv.kind, lv.required[-1:]) for lv in self.levels)
        return replace(self, levels=levels)

    def cells(self) -> tuple[Cell, ...]:
        """Return all worlds, the nominal one first."""
        found = [Cell("nominal", "nominal", True)]
        for levels in self.levels:
            kind, required = levels.kind, levels.required
            found += (
                Cell(
                    DISTURBANCES[kind].show(level),
                    kind,
                    level in required,
                    ((kind, level),),
                )
                for level in sorted({*required, *levels.beyond})
            )
        ends = [(lv.kind, lv.required) for lv in self.levels if lv.required]
        for name, end in (("first", 0), ("last", -1)) if self.corners else ():
            numbers = tuple((kind, required[end]) for kind, required in ends)
            found.append(Cell(f"all mild, {name} levels", "corner", False, numbers))
        return tuple(found)


class GridJob(NamedTuple):
    """One walk on the grid."""

    key: tuple[int, int]
    """Round, and number in it."""
    cell: Cell
    group: str
    walk: Schedule | IntArray
    """Commands, or (S, 4) gaits that visit steps."""


class GridRun(NamedTuple):
    """What came of it."""

    key: tuple[int, int]
    """Of the job."""
    steps: list[tuple[int, int]]
    """First and last pose of each step that was begun."""
    fell: bool
    """In the last of them."""


def _levels(balanced: bool) -> tuple[Levels, ...]:
    """Return the levels of each disturbance as `World` declares them."""
    met = {kind: d.exposure(balanced) for kind, d in DISTURBANCES.items()}
    return tuple(
        Levels(kind, exposure.required, exposure.beyond)
        for kind, exposure in met.items()
        if exposure.required or exposure.beyond
    )


DYNAMIC_GRID = Grid(_levels(balanced=True))
"""For strides."""
PAPER_GRID = Grid(_levels(balanced=False))
"""For key poses, trained open loop: what they were built in is required."""


def plan_jobs(
    library: GaitLibrary, grid: Grid, entropy: int, number: int
) -> list[GridJob]:
    """List each command and, in round 0, each step in each world."""
    rng, jobs = np.random.default_rng((entropy, number)), list[GridJob]()
    pairs = safe_pairs(library)[0]
    for cell in [c for c in grid.cells() for _ in range(grid.seeds)]:
        courses = library.family.courses(library.command_range)
        walks: list[tuple[str, Any]] = list(courses)
        if number == 0:
            cover = cover_once(library.gait_of, pairs, _COVER_STEPS, rng)
            walks += ((EVERY_STEP, walk) for walk in cover)
        done = len(jobs)
        jobs += (GridJob((number, done + i), cell, *w) for i, w in enumerate(walks))
    return jobs


def grid_world(
    library: GaitLibrary, job: GridJob, entropy: int, scale_ns: float
) -> World:
    """Draw a job's world; m sqrt(g h) is `scale_ns`. Pushes come from any side."""
    rng = np.random.default_rng((entropy, *job.key))
    numbers: dict[str, Any] = dict(job.cell.numbers)
    impulse_ns, step_s = numbers.pop("push", 0.0) * scale_ns, library.timing.step
    every_s, seconds = max(_PUSH_EVERY_S, 2.0 * step_s), _duration_s(job.walk, step_s)
    times = [at + rng.random() for at in np.arange(_FIRST_PUSH_S, seconds, every_s)]
    pushes = [(float(rng.uniform(-180.0, 180.0)), float(at)) for at in times]
    return World(
        **numbers,
        seed=int(rng.integers(2**31)),
        speed_limit_deg_s=library.config.speed_limit_deg_s,
        push=tuple(Push(impulse_ns, *p) for p in pushes if impulse_ns > 0.0),
    )


def _duration_s(walk: Schedule | IntArray, step_s: float) -> float:
    if isinstance(walk, np.ndarray):
        return len(walk) * step_s
    return sum(segment.duration_s or segment.steps * step_s for segment in walk)
