"""How often a library falls: random walks in mild worlds until that is sure. Ours.

The criterion is fixed beforehand: falls per step, of random schedules over the whole
range of commands, as the robot walks them, in the nominal world and all mild ones of
the grid, with both models of contact, each drawn with equal chances.

Few walks leave worlds that none was drawn for. Each of these, and a contact model that
was not drawn, is walked once after the test is sure. That it was sure once is enough
[Ville39], so that these walks, which are no draws, cannot make the verdict wrong; but a
fall in one of them counts against it (`RateTest.count_against`). If it is not sure any
more then, the draws go on.
"""

import hashlib
import math
from bisect import bisect_left
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from statistics import fmean
from typing import NamedTuple, get_args

import numpy as np

from gaitchain.analysis.simulated_walk import run_unrecorded
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.build.grid import Cell, GridJob, grid_world
from gaitchain.build.jobs import run_jobs
from gaitchain.build.push import impulse_scale
from gaitchain.build.qualify import default_grid
from gaitchain.build.workers import Crew
from gaitchain.errors import CommandError
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.library_file import library_bytes
from gaitchain.gait.qualification import ChosenWalks, ProofReport, Stratum
from gaitchain.gait.schedule import Schedule
from gaitchain.proof.rate_test import (
    RateTest,
    Verdict,
    length_fault,
    rate_interval,
    steps_needed,
)
from gaitchain.proof.step_strata import StepTally
from gaitchain.sim.world import DISTURBANCES, Cone, World
from gaitchain.walker.policy_table import safe_pairs
from gaitchain.walker.walker import Walker

BANK = 3
"""Of seeds: those of the grid's rounds are 0, 1, 2 and 6."""
CHOSEN = 2**39
"""Number of the walk in the first world, if it is chosen; those in the other worlds
follow, and after them those with each contact model."""
# Walks that are begun together. Their number follows from those before, never from the
# workers, so that runs can be resumed; at the end up to an eighth is walked in vain.
_BATCH, _MORE, _MOST = 32, 8, 1024
_ENOUGH = 20.0  # times the steps that it takes if none falls
_NAMED = 100  # walks with a fall, by their numbers
_HURRY = 2.0  # steps of a walk over those that the plan makes in the time
_DRAWN = 64  # schedules by which walks are known to be so long
_CONES = get_args(Cone)
_SHORTEST_S = 2  # of a walk: a random schedule holds each command for so long


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


def prove(library: GaitLibrary, criterion: Criterion, crew: Crew) -> GaitLibrary:
    """Walk until it is sure that robots fall less often than a bound, or more often.

    Before it says so of less often, each world and each contact model has been walked:
    see above for those that were not drawn. They are in the rows of their own world or
    model alone, and in `ProofReport.chosen`.

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
    check_length(plain, criterion)
    cells = mild_cells(plain)
    longest = _longest(plain, criterion)
    tally = _Tally(plain, cells, longest)
    test = RateTest(criterion.bound, longest, criterion.confidence)
    walks = ProofWalks(plain, criterion, cells, crew.workers)
    verdict, stage = test.verdict, "walking for the proof"
    crew.tell(stage, 0, 100)
    for walk in walks.drawn():
        tally.add(walk)
        verdict = test.add(_length(walk), fell=walk.fell)
        crew.tell(stage, round(100.0 * test.sureness), 100)
        if verdict == "below":
            verdict = _cover(tally, test, walks, crew)
        if verdict != "open" or tally.steps >= criterion.limit:
            break
    return library.proven(tally.report(criterion, verdict))


def _cover(tally: "_Tally", test: RateTest, walks: "ProofWalks", crew: Crew) -> Verdict:
    """Walk once wherever no draw has led; return what is known then."""
    missing = tally.missing
    if missing:
        found = crew.track(
            "walking where no walk was drawn", walks.chosen(missing), len(missing)
        )
        for place, walk in zip(missing, found, strict=True):
            tally.choose(place, walk)
            if walk.fell:
                test.count_against()
    return test.verdict


def check_length(library: GaitLibrary, criterion: Criterion) -> None:
    """Refuse walks so long that each would count as a fall by its length alone.

    Raises:
        CommandError: a walk may have 1 / bound steps or more.
    """
    fault = _length_fault(library, criterion)
    if fault:
        raise CommandError(f"{fault}; {_way_out(library, criterion)}")


def _length_fault(library: GaitLibrary, criterion: Criterion) -> str:
    return length_fault(criterion.bound, _longest(library, criterion))


def _way_out(library: GaitLibrary, criterion: Criterion) -> str:
    """Say how long a walk may be, or which bound its shortest walks can be tested for.

    Walks that count steps are as long whatever the seconds.
    """

    def lasting(seconds: float) -> Criterion:
        return replace(criterion, seconds=float(seconds))

    def too_long(seconds: float) -> bool:
        return bool(_length_fault(library, lasting(seconds)))

    end = _SHORTEST_S  # from below: to draw schedules of an hour takes seconds
    while end < criterion.seconds and not too_long(end):
        end *= 2
    shorter = range(_SHORTEST_S, min(end, math.ceil(criterion.seconds)))
    fit = bisect_left(shorter, True, key=too_long)
    if fit:
        return f"give --seconds {shorter[fit - 1]} or less"
    least = _longest(library, lasting(_SHORTEST_S))
    most = math.floor(1e4 / (least + 1)) / 1e4  # rounded down, so that it will do
    return f"no walk is short enough; give --bound {most:g} or less"


def _longest(library: GaitLibrary, criterion: Criterion) -> int:
    """Return the most steps that a walk may have."""
    return int(_HURRY * max(_planned(library, criterion))) + 2


def usual_steps(library: GaitLibrary, criterion: Criterion) -> int:
    """Return how many steps a walk of the proof has, as planned, in the mean."""
    return max(round(fmean(_planned(library, criterion))), 1)


def _planned(library: GaitLibrary, criterion: Criterion) -> list[float]:
    """Return the steps of some walks; those that count steps are not equally long."""
    rng, step_s = np.random.default_rng(0), library.timing.step
    drawn = (_draw_schedule(library, criterion, rng) for _ in range(_DRAWN))
    return [sum(s.steps or (s.duration_s or 0.0) / step_s for s in d) for d in drawn]


def walk_length(library: GaitLibrary, proof: ProofReport) -> str:
    """Say how long the walks of a proof were, by what its schedules count."""
    if not library.family.counts_steps:
        return f"{proof.seconds:g} s"
    return f"{proof.total.steps / max(proof.total.walks, 1):.0f} steps on average"


def describe_chosen(chosen: ChosenWalks) -> str:
    """Say what came of the walks that were no draws."""
    return (
        f"No walk was drawn for {len(chosen.names)} of the worlds and contact models; "
        f"each was walked once after the test was sure, {chosen.steps} steps in all, "
        f"and {chosen.falls} of these walks fell. A fall counts against the verdict, "
        "and a walk without one does not count for it."
    )


def _draw_schedule(
    library: GaitLibrary, criterion: Criterion, rng: np.random.Generator
) -> Schedule:
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
        self._fixed = library, criterion, cells, impulse_scale(library)[2]
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
    at, cone = int(rng.integers(len(cells))), int(rng.integers(len(_CONES)))
    place = number - CHOSEN
    if place in range(len(cells)):
        at = place
    elif place - len(cells) in range(len(_CONES)):
        cone = place - len(cells)
    schedule = _draw_schedule(library, criterion, rng)
    job = GridJob((BANK, number), cells[at], "", schedule)
    world = grid_world(library, job, entropy, scale_ns)
    return DrawnWalk(at, cone, replace(world, cone=_CONES[cone]), schedule)


def seed_of(library: GaitLibrary) -> int:
    """Return the seed of all walks of a proof: a digest of the library without one."""
    unproven = library_bytes(library.proven(None))
    return int.from_bytes(hashlib.sha256(unproven).digest()[:16])


def mild_cells(library: GaitLibrary) -> list[Cell]:
    """Return the worlds of a proof: the nominal one and the grid's mild ones."""
    return [cell for cell in default_grid(library).cells() if cell.required]


class _Tally:
    """Counts of walks, steps and falls; its memory does not grow with the walks."""

    def __init__(self, library: GaitLibrary, cells: list[Cell], longest: int) -> None:
        self._cells, self._longest = cells, longest
        self._steps = StepTally(safe_pairs(library)[0])
        # Walks by world, contact model, whether they fell, and number of steps.
        self._lengths: dict[tuple[int, int, bool, int], int] = {}
        self._chosen: dict[int, ProofWalk] = {}
        self._fell_in: list[int] = []
        self._walks = self.steps = 0

    @property
    def missing(self) -> list[int]:
        """Numbers of the worlds, and after the last of the contact models, unwalked."""
        worlds = {world for world, _, _, _ in self._lengths}
        cones = {len(self._cells) + cone for _, cone, _, _ in self._lengths}
        walked = worlds | cones | self._chosen.keys()
        return [n for n in range(len(self._cells) + len(_CONES)) if n not in walked]

    def choose(self, place: int, walk: ProofWalk) -> None:
        """Add a walk that was no draw."""
        self._chosen[place] = walk
        self._note(CHOSEN + place, walk)

    def add(self, walk: ProofWalk) -> None:
        """Add a walk that was drawn."""
        self._note(self._walks, walk)
        self._walks += 1
        length = _length(walk)
        kind = walk.world, walk.cone, walk.fell, length
        self._lengths[kind] = self._lengths.get(kind, 0) + 1
        self.steps += length
        self._steps.add(walk.steps, fell=walk.fell)

    def _note(self, number: int, walk: ProofWalk) -> None:
        if walk.fell and len(self._fell_in) < _NAMED:
            self._fell_in.append(number)

    def report(self, criterion: Criterion, verdict: str) -> ProofReport:
        kinds = list(dict.fromkeys(cell.kind for cell in self._cells))
        strata = len(self._cells) + len(kinds) + len(_CONES)
        # Two ends each, any of which may be wrong. Those of all walks are the test's:
        # the upper one is at the bound where its verdict is "below".
        each = 1.0 - (1.0 - criterion.confidence) / (2 * strata)
        return ProofReport(
            bound=criterion.bound,
            confidence=criterion.confidence,
            verdict=verdict,
            seconds=criterion.seconds,
            total=self._stratum("all", criterion.confidence),
            worlds=tuple(
                self._stratum(cell.name, each, worlds={i}, place=i)
                for i, cell in enumerate(self._cells)
            ),
            contacts=tuple(
                self._stratum(_of_cone(i), each, cone=i, place=len(self._cells) + i)
                for i in range(len(_CONES))
            ),
            kinds=tuple(
                self._stratum(
                    DISTURBANCES[kind].label if kind in DISTURBANCES else kind,
                    each,
                    worlds={i for i, c in enumerate(self._cells) if c.kind == kind},
                )
                for kind in kinds
            ),
            steps=self._steps.report(self._longest, criterion.confidence),
            fell_in=tuple(self._fell_in),
            chosen=self._report_chosen(),
        )

    def _report_chosen(self) -> ChosenWalks | None:
        """Return what came of walks that were no draws; None without one."""
        if not self._chosen:
            return None
        names = [cell.name for cell in self._cells]
        names += (_of_cone(i) for i in range(len(_CONES)))
        walks = self._chosen.values()
        return ChosenWalks(
            names=tuple(names[place] for place in self._chosen),
            steps=sum(_length(walk) for walk in walks),
            falls=sum(walk.fell for walk in walks),
        )

    def _stratum(
        self,
        name: str,
        confidence: float,
        worlds: set[int] | None = None,
        cone: int | None = None,
        place: int | None = None,
    ) -> Stratum:
        """Return what is known of drawn walks, and of the one chosen for a place."""
        walks = [
            (length, fell, count)
            for (of, model, fell, length), count in self._lengths.items()
            if (worlds is None or of in worlds) and cone in (None, model)
        ]
        if place in self._chosen:
            walk = self._chosen[place]
            walks.append((_length(walk), walk.fell, 1))
        number = sum(count for _, _, count in walks)
        steps = sum(length * count for length, _, count in walks)
        falls = sum(count for _, fell, count in walks if fell)
        low, high = rate_interval(walks, self._longest, confidence)
        return Stratum(name, number, steps, falls, low, high)


def _of_cone(number: int) -> str:
    return f"{_CONES[number]} friction"


def _length(walk: ProofWalk) -> int:
    """Return the steps that a walk counts for."""
    return max(len(walk.steps), 1)
