"""The grid: worlds in which every step and every command of a library is walked.

One disturbance at a time is not nominal, so that a fall has one cause, and two corners
have all mild levels at once. The full product of the levels would be some 10^7 worlds,
nearly all of them too hard for any robot, and would not separate the causes better.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from gaitchain.chain.layered_chain import IntArray
from gaitchain.chain.sampling import cover_once
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.schedule import Schedule
from gaitchain.sim.push import Punches, Push
from gaitchain.sim.robot_faults import doubt_field
from gaitchain.sim.world import DISTURBANCES, World
from gaitchain.walker.policy_table import safe_pairs

EVERY_STEP = "every step"
"""Group of the walks that visit every step, whatever the command."""
_COVER_STEPS = 22
_FIRST_PUSH_S, _PUSH_EVERY_S = 1.0, 2.0


@dataclass(frozen=True)
class Levels:
    """Levels of one disturbance."""

    kind: str
    """A field of `World`; of "push", every 2 s, and "punches" the levels are impulses,
    parts of m sqrt(g h)."""
    required: tuple[float, ...] = ()
    """Mild levels: the library must pass them, and steps that fall are removed."""
    beyond: tuple[float, ...] = ()
    """Harder levels, walked to find the limits; they do not affect the library."""


@dataclass(frozen=True)
class Cell:
    """One world of the grid."""

    name: str
    """Name for reports."""
    kind: str
    """Name of its disturbance, or "nominal" or "corner"."""
    required: bool
    """Whether the library must pass here."""
    numbers: tuple[tuple[str, float], ...] = ()
    """(disturbance, level) of those that are not nominal."""


@dataclass(frozen=True)
class Grid:
    """Worlds of a qualification, and the criterion for passing it."""

    levels: tuple[Levels, ...]
    """Levels of each disturbance."""
    corners: bool = True
    """Whether to add two worlds: the first, and the last, required levels of all."""
    seeds: int = 1
    """Walks of each command, and visits to each step, in each world."""
    share: float = 0.9
    """Part of the walks, and of the visits to a step, that must not fall."""
    brief: bool = False
    """Whether each disturbance alone has its last required level only."""

    def quick(self) -> "Grid":
        """Return only the last required level of each disturbance, and the corners."""
        return replace(self, brief=True)

    def cells(self) -> tuple[Cell, ...]:
        """Return all worlds, the nominal one first."""
        found = [Cell("nominal", "nominal", True)]
        for levels in self.levels:
            kind, required = levels.kind, levels.required
            beside = self._beside(kind)
            found += (
                Cell(
                    DISTURBANCES[kind].show(level),
                    kind,
                    level in required,
                    (*beside, (kind, level)),
                )
                for level in self._alone(levels)
            )
        ends = [(lv.kind, lv.required) for lv in self.levels if lv.required]
        for name, end in (("first", 0), ("last", -1)) if self.corners else ():
            numbers = tuple((kind, required[end]) for kind, required in ends)
            found.append(Cell(f"all mild, {name} levels", "corner", False, numbers))
        return tuple(found)

    def _beside(self, kind: str) -> tuple[tuple[str, float], ...]:
        """Return a level of what it needs: the last required one, else the first."""
        needed = DISTURBANCES[kind].needs
        return tuple(
            (levels.kind, (levels.required[-1:] or levels.beyond)[0])
            for levels in self.levels
            if levels.kind == needed
        )

    def _alone(self, levels: Levels) -> Sequence[float]:
        """Return the levels that a disturbance has while it is the only one."""
        if self.brief:
            return levels.required[-1:]
        return sorted({*levels.required, *levels.beyond})


class GridJob(NamedTuple):
    """One walk on the grid."""

    key: tuple[int, int]
    """(round, number in the round)."""
    cell: Cell
    """The world."""
    group: str
    """Group of commands, or `EVERY_STEP`."""
    walk: Schedule | IntArray
    """Commands, or (S, 4) gaits that visit steps."""


class GridRun(NamedTuple):
    """Result of one walk on the grid."""

    key: tuple[int, int]
    """Key of the job."""
    steps: list[tuple[int, int]]
    """First and last pose of each step that was begun."""
    fell: bool
    """Whether the robot fell, which ends the last of these steps."""


def _levels(balanced: bool) -> tuple[Levels, ...]:
    """Return the levels of each disturbance as `World` declares them."""
    met = {kind: d.exposure(balanced) for kind, d in DISTURBANCES.items()}
    return tuple(
        Levels(kind, exposure.required, exposure.beyond)
        for kind, exposure in met.items()
        if exposure.required or exposure.beyond
    )


DYNAMIC_GRID = Grid(_levels(balanced=True))
"""Grid for strides."""
PAPER_GRID = Grid(_levels(balanced=False))
"""Grid for key poses, which are trained in open loop: only the levels of their training
are required, and faults of servos and sensors are none of these."""


def plan_jobs(
    library: GaitLibrary, grid: Grid, entropy: int, number: int
) -> list[GridJob]:
    """List the walks of a round: each command and, in round 0, each step in each world.

    Args:
        library: the gaits.
        grid: the worlds.
        entropy: seed of the qualification.
        number: the round.
    """
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
    """Draw the world of a job, with pushes from random directions.

    What is left unknown of an identified robot is drawn in each of them.

    Args:
        library: the gaits.
        job: the walk.
        entropy: seed of the qualification.
        scale_ns: m sqrt(g h), the unit of the pushes [N s].
    """
    rng = np.random.default_rng((entropy, *job.key))
    numbers: dict[str, Any] = dict(job.cell.numbers) | doubt_field(library.robot)
    impulse_ns, step_s = numbers.pop("push", 0.0) * scale_ns, library.timing.step
    every_s, seconds = max(_PUSH_EVERY_S, 2.0 * step_s), _duration_s(job.walk, step_s)
    times = [at + rng.random() for at in np.arange(_FIRST_PUSH_S, seconds, every_s)]
    pushes = [(float(rng.uniform(-180.0, 180.0)), float(at)) for at in times]
    punch_ns = numbers.pop("punches", 0.0) * scale_ns
    return World(
        **numbers,
        punches=Punches(punch_ns, every_s) if punch_ns else None,
        seed=int(rng.integers(2**31)),
        speed_limit_deg_s=library.config.speed_limit_deg_s,
        push=tuple(Push(impulse_ns, *p) for p in pushes if impulse_ns > 0.0),
    )


def _duration_s(walk: Schedule | IntArray, step_s: float) -> float:
    if isinstance(walk, np.ndarray):
        return len(walk) * step_s
    return sum(segment.duration_s or segment.steps * step_s for segment in walk)
