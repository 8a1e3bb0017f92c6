"""The walks of a proof, by their numbers: what is drawn for each, and what comes.

In the nominal world and all mild ones of the grid, with both models of contact, each
drawn with equal chances.
"""

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, get_args

import numpy as np

from gaitchain.analysis.simulated_walk import run_unrecorded
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.build.grid import Cell, GridJob, grid_world
from gaitchain.build.jobs import run_jobs
from gaitchain.build.push import impulse_unit_ns
from gaitchain.build.qualify import default_grid
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.library_file import library_bytes
from gaitchain.gait.schedule import Schedule
from gaitchain.proof.rate_test import steps_needed
from gaitchain.sim.world import Cone, World
from gaitchain.walker.walker import Walker

BANK = 3
"""Of seeds: those of the grid's rounds are 0, 1, 2 and 6."""
CHOSEN = 2**39
"""Number of the walk in the first world, if it is chosen; those in the other worlds
follow, and after them those with each contact model."""
CONES: tuple[Cone, ...] = get_args(Cone)
"""The models of contact."""
# Walks that are begun together. Their number follows from those before, never from the
# workers, so that runs can be resumed; the rest of the last batch is walked in vain, at
# most 31 walks in the first 256, and an eighth of all later.
_BATCH, _MORE, _MOST = 32, 8, 1024
_ENOUGH = 20.0  # times the steps that it takes if none falls


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
    """After which no verdict is reached any more; by default 20 times what it takes
    without a fall in walks of one step, longer ones take more."""

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

    @property
    def length(self) -> int:
        """The steps that it counts for."""
        return max(len(self.steps), 1)


class DrawnWalk(NamedTuple):
    """What was drawn, or chosen, for one walk."""

    world: int
    """Number of the mild world."""
    cone: int
    """Number of the contact model."""
    in_world: World
    """The world, with its seed."""
    schedule: Schedule
    """The commands."""


def draw_schedule(
    library: GaitLibrary, criterion: Criterion, rng: np.random.Generator
) -> Schedule:
    """Draw the commands of a walk.

    Args:
        library: the gaits.
        criterion: says how long the walk is.
        rng: of the commands.
    """
    most = library.command_range
    return library.family.random_schedule(rng, most, criterion.seconds)


class ProofWalks:
    """The walks of a proof, by their numbers."""

    def __init__(
        self,
        library: GaitLibrary,
        criterion: Criterion,
        cells: list[Cell],
        workers: int,
    ) -> None:
        """Make ready.

        Args:
            library: the gaits, without a proof.
            criterion: says how long the walks are.
            cells: the mild worlds.
            workers: processes at once.
        """
        self._fixed = library, criterion, cells, impulse_unit_ns(library)
        self._entropy, self._workers = seed_of(library), workers

    def drawn(self) -> Iterator[ProofWalk]:
        """Yield those whose world is drawn in their order, without end."""
        number = 0
        while True:
            count = min(max(_BATCH, number // _MORE), _MOST)
            # All of a batch is taken, as what has begun in the workers is not stopped.
            yield from list(self._walk(range(number, number + count)))
            number += count

    def chosen(self, places: Sequence[int]) -> Iterator[ProofWalk]:
        """Yield one for each world or, after the last world, contact model."""
        return self._walk([CHOSEN + place for place in places], f" {list(places)}")

    def _walk(self, numbers: Sequence[int], of: str = "") -> Iterator[ProofWalk]:
        jobs = [(*self._fixed, (self._entropy, number)) for number in numbers]
        return run_jobs(_walk, jobs, ProofWalk, self._workers, of=of)


def _walk(
    library: GaitLibrary,
    criterion: Criterion,
    cells: list[Cell],
    scale_ns: float,
    seed: tuple[int, int],
) -> ProofWalk:
    drawn = draw_walk(library, criterion, cells, scale_ns, seed)
    backend = MujocoBackend(library.robot, drawn.in_world)
    walked = run_unrecorded(Walker(library), backend, drawn.schedule)
    fell = walked.fell_at_s is not None
    return ProofWalk(drawn.world, drawn.cone, list(walked.steps), fell)


def draw_walk(
    library: GaitLibrary,
    criterion: Criterion,
    cells: Sequence[Cell],
    scale_ns: float,
    seed: tuple[int, int],
) -> DrawnWalk:
    """Draw the world and the commands of a walk.

    Walks from number `CHOSEN` on have the world or the contact model that their number
    says; the rest of them is drawn.

    Args:
        library: the gaits, without a proof.
        criterion: says how long the walk is.
        cells: the mild worlds.
        scale_ns: m sqrt(g h), the unit of the pushes [N s].
        seed: `seed_of` the library, and the number of the walk.
    """
    entropy, number = seed
    rng = np.random.default_rng((entropy, BANK, number, 1))
    at, cone = int(rng.integers(len(cells))), int(rng.integers(len(CONES)))
    place = number - CHOSEN
    if place in range(len(cells)):
        at = place
    elif place - len(cells) in range(len(CONES)):
        cone = place - len(cells)
    schedule = draw_schedule(library, criterion, rng)
    job = GridJob((BANK, number), cells[at], "", schedule)
    world = grid_world(library, job, entropy, scale_ns)
    return DrawnWalk(at, cone, replace(world, cone=CONES[cone]), schedule)


def seed_of(library: GaitLibrary) -> int:
    """Return the seed of all walks of a proof: a digest of the library without one."""
    unproven = library_bytes(library.proven(None))
    return int.from_bytes(hashlib.sha256(unproven).digest()[:16])


def mild_cells(library: GaitLibrary) -> list[Cell]:
    """Return the worlds of a proof: the nominal one and the grid's mild ones."""
    return [cell for cell in default_grid(library).cells() if cell.required]
