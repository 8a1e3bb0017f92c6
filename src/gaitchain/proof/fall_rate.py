"""How often a library falls: random walks in mild worlds until that is sure. Ours.

The criterion is fixed beforehand: falls per step, of random schedules over the whole
range of commands, as the robot walks them, in the nominal world and all mild ones of
the grid, with both models of contact, each drawn with equal chances.
"""

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple, get_args

import numpy as np

from gaitchain.analysis.simulated_walk import run_unrecorded
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.build.grid import Cell, GridJob, grid_world
from gaitchain.build.jobs import run_jobs
from gaitchain.build.push import impulse_scale
from gaitchain.build.qualify import default_grid
from gaitchain.build.workers import Crew
from gaitchain.chain.layered_chain import IntArray
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.library_file import library_bytes
from gaitchain.gait.qualification import ProofReport, Stratum
from gaitchain.gait.schedule import Schedule
from gaitchain.proof.rate_test import RateTest, rate_interval, steps_needed
from gaitchain.sim.world import Cone
from gaitchain.walker.policy_table import safe_pairs
from gaitchain.walker.walker import Walker

_BANK = 3  # of seeds: the grid's rounds are 0 to 2
_BATCH = 32  # walks; the same for any number of workers, so that runs can be resumed
_ENOUGH = 20.0  # times the steps that it takes if none falls
_HURRY = 2.0  # steps of a walk over those that the plan makes in the time


@dataclass(frozen=True)
class Criterion:
    """What is to be shown, fixed before the first walk."""

    bound: float
    """Falls per step."""
    confidence: float = 0.95
    """Of the verdict."""
    seconds: float = 60.0
    """Length of a walk's schedule, if it counts time [s]."""
    most_steps: int | None = None
    """After which no verdict is reached any more; 20 times what it takes without a
    fall by default."""

    @property
    def limit(self) -> int:
        """Most steps."""
        need = _ENOUGH * steps_needed(self.bound, self.confidence)
        return self.most_steps or round(need)


class ProofWalk(NamedTuple):
    """One walk: what was drawn for it, and what came."""

    world: int
    """Number of the mild world."""
    cone: int
    """Number of the contact model."""
    steps: list[tuple[int, int]]
    """First and last pose of each step that was begun."""
    fell: bool
    """Whether the robot fell, in the last of these steps."""


def prove(library: GaitLibrary, criterion: Criterion, crew: Crew) -> GaitLibrary:
    """Walk until it is sure that robots fall less often than a bound, or more often.

    Every walk has seeds of its own that neither a build nor a grid uses. The verdict
    depends on them in their order, not on the workers or the backend of
    `joblib.parallel_config`.

    Args:
        library: a qualified library.
        criterion: what is to be shown.
        crew: processes and progress.

    Returns:
        The library with the report, `qualification.proof`.

    Raises:
        CommandError: the bound cannot be tested by walks of this length.
        LibraryError: the library is not qualified.
    """
    plain = library.proven(None)
    cells = [cell for cell in default_grid(plain).cells() if cell.required]
    longest = _longest(plain, criterion)
    tally = _Tally(plain, cells, longest)
    test = RateTest(criterion.bound, longest, criterion.confidence)
    verdict, stage = test.verdict, "walking for the proof"
    crew.tell(stage, 0, 100)
    for walk in _walk_on(plain, criterion, cells, crew.workers):
        tally.add(walk)
        verdict = test.add(max(len(walk.steps), 1), fell=walk.fell)
        crew.tell(stage, round(100.0 * test.sureness), 100)
        if verdict != "open" or tally.steps >= criterion.limit:
            break
    return library.proven(tally.report(criterion, verdict))


def _longest(library: GaitLibrary, criterion: Criterion) -> int:
    """Return the most steps that a walk may have."""
    schedule = _draw_schedule(library, criterion, np.random.default_rng(0))
    planned = sum(
        s.steps or (s.duration_s or 0.0) / library.timing.step for s in schedule
    )
    return int(_HURRY * planned) + 2


def _draw_schedule(
    library: GaitLibrary, criterion: Criterion, rng: np.random.Generator
) -> Schedule:
    most = library.command_range
    return library.family.random_schedule(rng, most, criterion.seconds)


def _walk_on(
    library: GaitLibrary, criterion: Criterion, cells: list[Cell], workers: int
) -> Iterator[ProofWalk]:
    """Yield walks in their order, without end."""
    entropy = int.from_bytes(hashlib.sha256(library_bytes(library)).digest()[:16])
    scale_ns, number = impulse_scale(library)[2], 0
    while True:
        seeds = [(entropy, number + i) for i in range(_BATCH)]
        jobs = [(library, criterion, cells, scale_ns, seed) for seed in seeds]
        # All of a batch is taken, as what has begun in the workers is not stopped.
        yield from list(run_jobs(_walk, jobs, ProofWalk, workers))
        number += _BATCH


def _walk(
    library: GaitLibrary,
    criterion: Criterion,
    cells: list[Cell],
    scale_ns: float,
    seed: tuple[int, int],
) -> ProofWalk:
    entropy, number = seed
    rng = np.random.default_rng((entropy, _BANK, number, 1))
    at, cone = int(rng.integers(len(cells))), int(rng.integers(len(get_args(Cone))))
    schedule = _draw_schedule(library, criterion, rng)
    job = GridJob((_BANK, number), cells[at], "", schedule)
    world = grid_world(library, job, entropy, scale_ns)
    backend = MujocoBackend(library.robot, replace(world, cone=get_args(Cone)[cone]))
    walked = run_unrecorded(Walker(library), backend, schedule)
    return ProofWalk(at, cone, list(walked.steps), walked.fell_at_s is not None)


class _Tally:
    """Counts of walks, steps and falls; its memory does not grow with the walks."""

    def __init__(self, library: GaitLibrary, cells: list[Cell], longest: int) -> None:
        self._cells, self._longest = cells, longest
        self._pairs = safe_pairs(library)[0]
        self._visits = np.zeros((2, *self._pairs.shape), dtype=np.int64)
        # Walks by world, contact model, whether they fell, and number of steps.
        self._lengths: dict[tuple[int, int, bool, int], int] = {}
        self.steps = 0

    def add(self, walk: ProofWalk) -> None:
        length = max(len(walk.steps), 1)
        kind = walk.world, walk.cone, walk.fell, length
        self._lengths[kind] = self._lengths.get(kind, 0) + 1
        self.steps += length
        walked, fell = self._visits
        np.add.at(
            walked, tuple(np.array(walk.steps, dtype=np.int64).reshape(-1, 2).T), 1
        )
        if walk.fell and walk.steps:
            fell[walk.steps[-1]] += 1

    def report(self, criterion: Criterion, verdict: str) -> ProofReport:
        walked, fell = self._visits
        named = np.argwhere(fell).tolist()
        return ProofReport(
            bound=criterion.bound,
            confidence=criterion.confidence,
            verdict=verdict,
            seconds=criterion.seconds,
            total=self._stratum("all", criterion),
            worlds=tuple(
                self._stratum(cell.name, criterion, world=i)
                for i, cell in enumerate(self._cells)
            ),
            contacts=tuple(
                self._stratum(f"{name} friction", criterion, cone=i)
                for i, name in enumerate(get_args(Cone))
            ),
            edges=(int((walked > 0).sum()), int(self._pairs.sum())),
            fell_on=tuple((a, b, int(walked[a, b]), int(fell[a, b])) for a, b in named),
        )

    def _stratum(
        self,
        name: str,
        criterion: Criterion,
        world: int | None = None,
        cone: int | None = None,
    ) -> Stratum:
        rows = [
            (length, fell, count)
            for (of, model, fell, length), count in self._lengths.items()
            if world in (None, of) and cone in (None, model)
        ]
        found: IntArray = np.array(rows, dtype=np.int64).reshape(-1, 3)
        steps, fell = (np.repeat(found[:, i], found[:, 2]) for i in range(2))
        low, high = rate_interval(
            steps.tolist(), fell.tolist(), self._longest, criterion.confidence
        )
        return Stratum(name, steps.size, int(steps.sum()), int(fell.sum()), low, high)
