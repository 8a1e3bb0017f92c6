"""Qualification in physics: of single steps, and on a grid of worlds."""

import hashlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from itertools import chain
from typing import NamedTuple

import numpy as np

from gaitchain.analysis.simulated_walk import run_unrecorded
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.build.families import build_of
from gaitchain.build.grid import (
    EVERY_STEP,
    Cell,
    Grid,
    GridJob,
    GridRun,
    grid_world,
    plan_jobs,
)
from gaitchain.build.jobs import arrivals
from gaitchain.build.push import impulse_unit_ns
from gaitchain.build.rollout import PhysicsCost, WalkResult
from gaitchain.build.trial import without_caution
from gaitchain.build.usual_errors import StepErrors, errors_of
from gaitchain.build.workers import Crew, in_round
from gaitchain.chain.layered_chain import FloatArray, IntArray
from gaitchain.chain.sampling import Mask, cover_pairs
from gaitchain.gait.family import STAND
from gaitchain.gait.library import GaitLibrary, best_gaits
from gaitchain.gait.library_file import library_bytes
from gaitchain.gait.qualification import (
    CellReport,
    GridReport,
    GridVerdict,
)
from gaitchain.walker.policy_table import safe_pairs
from gaitchain.walker.walker import Walker

# Seeds of the rounds; 3 to 5 are those of a proof and of splitting. The last round may
# only confirm what the others left.
_ROUNDS = 0, 1, 2, 6
_STOPS = 8  # walks of each stop, where stops are walked alone


def qualify_steps(
    draft: GaitLibrary,
    size: tuple[int, int],
    rng: np.random.Generator,
    crew: Crew,
    pairs: Mask | None = None,
) -> tuple[GaitLibrary, StepErrors]:
    """Walk every pair of first and last pose; record falls, advance and DCM error.

    Args:
        draft: a library without verdicts.
        size: number of walks, each in its own world, and steps per walk.
        rng: source of randomness.
        crew: processes and worlds.
        pairs: (N_1, N_4) pairs to walk; by default all that a gait joins.

    Returns:
        The library with what is known of pairs, `pair_runs` to `pair_slip`, and what
        each step without a push was off.
    """
    gait_of = best_gaits(draft.path_costs)
    joined = gait_of[..., 0] >= 0
    joined = joined if pairs is None else joined & pairs
    plan = cover_pairs(gait_of, joined, *size, rng)
    source = PhysicsCost(
        draft.poses,
        draft.timing,
        worlds=crew.worlds,
        seed=int(rng.integers(2**31)),
        workers=crew.workers,
    )
    track = crew.track("qualifying every step", source.walk_all(plan), len(plan))
    results = list(track)
    counts = _walk_stops_alone(
        gait_of, _count(plan, results, joined.shape), source, crew
    )
    errors = errors_of(plan, results)
    usual_error, usual_slip = errors.usual(joined.shape)
    tested = replace(
        draft,
        pair_runs=counts.runs,
        pair_passes=counts.passes,
        pair_advance=counts.advance / np.maximum(counts.passes, 1),
        pair_error=usual_error,
        pair_slip=usual_slip,
    )
    return tested, errors


class _Counts(NamedTuple):
    """What walks showed of each pair of first and last pose, (N_1, N_4) each."""

    runs: IntArray
    passes: IntArray
    advance: FloatArray
    """Sum over the passes [m]."""

    @property
    def held(self) -> Mask:
        """Pairs that were walked and never fell."""
        return np.asarray((self.runs > 0) & (self.passes == self.runs))


def _count(
    plan: Sequence[IntArray], results: Sequence[WalkResult], pairs: tuple[int, ...]
) -> _Counts:
    runs, passes = np.zeros(pairs, dtype=np.int64), np.zeros(pairs, dtype=np.int64)
    advance = np.zeros(pairs)
    for walk, result in zip(plan, results, strict=True):
        made, held = ~np.isnan(result.cost), ~np.isnan(result.advance)
        np.add.at(runs, (walk[made, 0], walk[made, 3]), 1)
        np.add.at(passes, (walk[held, 0], walk[held, 3]), 1)
        np.add.at(advance, (walk[held, 0], walk[held, 3]), result.advance[held])
    return _Counts(runs, passes, advance)


def _walk_stops_alone(
    gait_of: IntArray, counts: _Counts, source: PhysicsCost, crew: Crew
) -> _Counts:
    """Walk each stop that fell again, after one step from a stand; count that instead.

    Every walk ends with a stop, and a fall takes longer than quick steps do: so stops
    are blamed for what steps before them did.
    """
    fell = np.flatnonzero(counts.held[STAND] & (counts.passes < counts.runs)[:, STAND])
    ways = [(STAND, int(pose), STAND) for pose in fell for _ in range(_STOPS)]
    if not ways:
        return counts
    plan = [gait_of[way[:-1], way[1:]] for way in ways]
    again = replace(source, seed=source.seed + 1)
    track = crew.track("walking stops alone", again.walk_all(plan), len(plan))
    found = _count(plan, list(track), counts.runs.shape)
    runs, passes = counts.runs.copy(), counts.passes.copy()
    advance = counts.advance.copy()
    runs[fell, STAND] = found.runs[fell, STAND]
    passes[fell, STAND] = found.passes[fell, STAND]
    advance[fell, STAND] = found.advance[fell, STAND]
    return _Counts(runs, passes, advance)


def default_grid(library: GaitLibrary, *, quick: bool = False, seeds: int = 1) -> Grid:
    """Return the grid for a library.

    Args:
        library: the gaits.
        quick: only the nominal world, the last required level of each disturbance,
            and the corners.
        seeds: see `Grid`.
    """
    grid = replace(build_of(library.poses).grid, seeds=seeds)
    return grid.quick() if quick else grid


def qualify_grid(
    library: GaitLibrary,
    grid: Grid,
    crew: Crew,
    finished: Mapping[tuple[int, int], GridRun] | None = None,
    note: Callable[[GridRun], None] = lambda run: None,
) -> GaitLibrary:
    """Walk every step and every command in every world; remove the steps that fall.

    A step is removed if it fell in the nominal world, or if too few of its visits in
    all required worlds passed. The remaining library then walks all commands again, in
    new worlds, until a round removes nothing; one that the last round still takes steps
    from does not pass. The result does not depend on the backend of
    `joblib.parallel_config`.

    Args:
        library: a library with its verdicts; those of an earlier grid are dropped.
        grid: the worlds.
        crew: processes and progress.
        finished: results of an interrupted run.
        note: called with the result of each walk as soon as it is finished.

    Returns:
        The library with the verdict; `qualification.grid` has the table.
    """
    draft, number, done = library.as_built(), 0, finished or {}
    entropy = int.from_bytes(hashlib.sha256(library_bytes(draft)).digest()[:16])
    current, tally = draft, _Tally(grid, draft.pair_runs.shape)
    tested, left = -1, int(draft.allowed_pairs.sum())
    while number < len(_ROUNDS) and tested != left and can_walk(current):
        jobs = plan_jobs(current, grid, entropy, _ROUNDS[number])
        known = (done[job.key] for job in jobs if job.key in done)
        todo = [job for job in jobs if job.key not in done]
        runs = chain(known, _walk_all(current, todo, entropy, crew.workers))
        tally.walks = {k: n for k, n in tally.walks.items() if k[1] == EVERY_STEP}
        stage = in_round("walking the grid", number)
        for run in crew.track(stage, runs, len(jobs)):
            if run.key not in done:
                note(run)
            tally.add(jobs[run.key[1]], run)
        current, number = replace(draft, grid=tally.verdict()), number + 1
        tested, left = left, int(current.allowed_pairs.sum())
    walks = can_walk(current)
    built, settled = draft.qualified and walks, tested in (-1, left) or not walks
    out = np.argwhere(draft.allowed_pairs & ~current.allowed_pairs).tolist()
    taken_out = [(a, b) for a, b in out]
    return current.judged(tally.report(number, built, taken_out, settled=settled))


def _walk_all(
    library: GaitLibrary, jobs: Sequence[GridJob], entropy: int, workers: int
) -> Iterator[GridRun]:
    """Yield the results in the order in which the walks finish."""
    scale_ns = impulse_unit_ns(library)
    calls = [(n, _walk, library, job, entropy, scale_ns) for n, job in enumerate(jobs)]
    for _, run in arrivals(calls, workers):
        yield run


class _Tally:
    """Counts of walks per world and group of commands, and of steps per world."""

    def __init__(self, grid: Grid, pairs: tuple[int, ...]) -> None:
        self._grid, self._cells = grid, grid.cells()
        self._visits = np.zeros((len(self._cells), 2, *pairs), dtype=np.int64)
        self.walks: dict[tuple[str, str], list[int]] = {}

    def add(self, job: GridJob, run: GridRun) -> None:
        walks = self.walks.setdefault((job.cell.name, job.group), [0, 0])
        walks[:] = walks[0] + 1, walks[1] + (not run.fell)
        steps = np.array(run.steps, dtype=np.int64).reshape(-1, 2)
        walked, held = self._visits[self._cells.index(job.cell)]
        np.add.at(walked, tuple(steps.T), 1)
        np.add.at(held, tuple(steps[: len(steps) - run.fell].T), 1)

    def verdict(self) -> GridVerdict:
        runs, held = self._visits[[c.required for c in self._cells]].sum(axis=0)
        fell = self._visits[0, 0] > self._visits[0, 1]
        return GridVerdict(runs, held, fell | (held < self._grid.share * runs))

    def report(
        self,
        rounds: int,
        walks: bool,
        taken_out: Sequence[tuple[int, int]],
        *,
        settled: bool,
    ) -> GridReport:
        """Return the figures of each world, and whether the library passes.

        Args:
            rounds: number of rounds.
            walks: whether the gate passed, and the remaining steps form a walk.
            taken_out: first and last pose of the steps that were removed.
            settled: whether the last round, if any, removed none.
        """
        cells = tuple(map(self._cell_report, self._cells, self._visits))
        held = all(self._holds(cell) for cell in cells)
        passed, share = walks and held and settled, self._grid.share
        return GridReport(passed, rounds, share, cells, tuple(taken_out), settled)

    def _cell_report(self, cell: Cell, visits: IntArray) -> CellReport:
        of = {k[1]: n for k, n in sorted(self.walks.items()) if k[0] == cell.name}
        asked = [n for group, n in of.items() if group != EVERY_STEP]
        walked, held = visits
        return CellReport(
            **asdict(cell),
            runs=sum(n[0] for n in asked),
            passes=sum(n[1] for n in asked),
            groups={group: (n[0], n[1]) for group, n in of.items()},
            steps=(int((walked > 0).sum()), int((walked > held).sum())),
        )

    def _holds(self, cell: CellReport) -> bool:
        share = 1.0 if cell.kind == "nominal" else self._grid.share
        return not cell.required or 0 < share * cell.runs <= cell.passes


def _walk(library: GaitLibrary, job: GridJob, entropy: int, scale_ns: float) -> GridRun:
    world = grid_world(library, job, entropy, scale_ns)
    if isinstance(job.walk, np.ndarray):
        result = PhysicsCost(library.poses, library.timing).measure(job.walk, world)
        begun = job.walk[~np.isnan(result.cost)][:, [0, 3]].tolist()
        return GridRun(job.key, [(a, b) for a, b in begun], result.fell)
    walker = Walker(without_caution(library), require_qualified=False)
    backend = MujocoBackend(library.robot, world)
    walked = run_unrecorded(walker, backend, job.walk)
    return GridRun(job.key, list(walked.steps), walked.fell_at_s is not None)


def can_walk(library: GaitLibrary) -> bool:
    """Return whether the steps that passed form a walk ahead, from and to standing."""
    return library.speed_range[1] > 0.0 and bool(safe_pairs(library)[0][STAND].any())
