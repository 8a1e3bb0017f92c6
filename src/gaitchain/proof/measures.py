"""What the report of a proof has beside the rate: pushes, stops and falls. Ours.

None of it changes the verdict. Its walks have seeds that the proof does not use.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gaitchain.build.grid import Cell
from gaitchain.build.jobs import run_jobs
from gaitchain.build.push import PushedWalk, PushTest, impulse_unit_ns, run_pushes
from gaitchain.build.workers import Crew
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.schedule import Schedule, counts_steps
from gaitchain.proof.falls import (
    Drop,
    FallsReport,
    Watched,
    judge_falls,
    potential_drop,
    watch_fall,
)
from gaitchain.proof.proof_walks import (
    BANK,
    Criterion,
    DrawnWalk,
    draw_walk,
    mild_cells,
    seed_of,
)
from gaitchain.proof.push_limit import Impulse, PushLimit, push_limits
from gaitchain.proof.stops import Stop, StopReport, judge_stops, measure_stop
from gaitchain.sim.push import Push
from gaitchain.sim.world import World

IN_PROOF = "walks of the proof"
PUSHED = "walks pushed with twice the impulse that fells half of them"
SIDES = 4
_APART = 2**40  # numbers of walks from here on are not the proof's
_SECONDS = 6.0  # of commands before a stop or a push that is too hard
_SPEED = 0.5  # of the highest one ahead, of a walk that is pushed
_TOO_HARD = 2.0  # times the impulse that half of the walks withstand
_PUSHED_S = 3.0, 5.0
_STOPS = 4  # walks that stop, for each one that is pushed from a side
_REPLAYED = 50  # falls of the proof at most


@dataclass(frozen=True)
class Measures:
    """What is in the report of a proof beside the rate."""

    speed_mps: float
    """Of the walks that are pushed [m/s]."""
    scale_ns: float
    """m sqrt(g h) [N s]."""
    pushes: tuple[PushLimit, ...]
    """For each side."""
    stops: StopReport | None
    """None for gaits whose commands count steps, which end in a stand by themselves."""
    falls: tuple[FallsReport, ...]
    """Those of the proof, and provoked ones."""
    drop: Drop


def measure(
    library: GaitLibrary, criterion: Criterion, walks: int, crew: Crew
) -> Measures:
    """Measure what walks withstand of pushes, how they stop, and how they fall.

    Args:
        library: with a proof.
        criterion: that of the proof.
        walks: for each side of the pushes, two or more; four times as many stops.
        crew: processes and progress.
    """
    plain, proof = library.proven(None), library.qualification.proof
    course = _Course(plain, criterion)
    speed = _SPEED * library.command_range.vx[1]
    pushes = push_limits(_push(plain, speed, walks, crew), course.scale_ns)
    again = [course.of_proof(n) for n in proof.fell_in[:_REPLAYED]] if proof else []
    hard = [course.pushed(i, *push) for i, push in _spread(pushes, walks)]
    replayed = _watch(plain, again, "walking its falls again", crew)
    provoked = _watch(plain, hard, "pushing too hard", crew)
    return Measures(
        speed,
        course.scale_ns,
        pushes,
        _stop(plain, course, _STOPS * walks, crew),
        (
            judge_falls(IN_PROOF, replayed, proof.all_walks if proof else None),
            judge_falls(PUSHED, provoked),
        ),
        potential_drop(plain),
    )


def measure_seeds(library: GaitLibrary) -> dict[str, str]:
    """Return the seeds of walk n, from 0 on, by what is drawn with them."""
    seed = seed_of(library)
    short = f"{seed}, {BANK}, {_APART} + n"
    return {
        "pushed from each side: world and moment": f"({_push_seed(library)}, n)",
        "stopping, and pushed too hard: numbers of its world": f"({short})",
        "the same: commands, and which world and contact model": f"({short}, 1)",
        "pushed too hard: its moment": f"({short}, 2)",
    }


class _Course:
    """Draws walks as the proof does."""

    def __init__(self, library: GaitLibrary, criterion: Criterion) -> None:
        self._library, self._criterion = library, criterion
        self._cells: Sequence[Cell] = mild_cells(library)
        self._entropy = seed_of(library)
        self.scale_ns = impulse_unit_ns(library)

    def of_proof(self, number: int) -> DrawnWalk:
        seed = self._entropy, number
        return draw_walk(
            self._library, self._criterion, self._cells, self.scale_ns, seed
        )

    def short(self, number: int) -> DrawnWalk:
        brief = replace(self._criterion, seconds=_SECONDS)
        seed = self._entropy, _APART + number
        return draw_walk(self._library, brief, self._cells, self.scale_ns, seed)

    def pushed(self, number: int, direction_deg: float, j50: Impulse) -> DrawnWalk:
        drawn = self.short(number)
        rng = np.random.default_rng((self._entropy, BANK, _APART + number, 2))
        at_s = float(rng.uniform(*_PUSHED_S))
        push = Push(_TOO_HARD * j50.ns, direction_deg, at_s)
        world = replace(drawn.in_world, push=(*drawn.in_world.push, push))
        return drawn._replace(in_world=world)


def _spread(
    limits: Sequence[PushLimit], walks: int
) -> list[tuple[int, tuple[float, Impulse]]]:
    """Number the walks that are pushed too hard, from each side in turn.

    A side of which no impulse is known has none.
    """
    known = [(p.direction_deg, p.j50) for p in limits if p.j50 is not None]
    return list(enumerate(known * walks))


def _push(library: GaitLibrary, speed: float, walks: int, crew: Crew) -> list[PushTest]:
    walk = PushedWalk(library, speed)
    seed = _push_seed(library)
    tests = run_pushes(walk, walks, seed, directions=SIDES, workers=crew.workers)
    return list(crew.track("pushing", tests, SIDES * walks))


def _push_seed(library: GaitLibrary) -> int:
    return seed_of(library) % 2**32


def _watch(
    library: GaitLibrary, drawn: Sequence[DrawnWalk], stage: str, crew: Crew
) -> list[Watched]:
    jobs: list[tuple[GaitLibrary, World, Schedule]] = [
        (library, walk.in_world, walk.schedule) for walk in drawn
    ]
    if not jobs:
        return []
    found = run_jobs(watch_fall, jobs, Watched, crew.workers)
    return list(crew.track(stage, found, len(jobs)))


def _stop(
    library: GaitLibrary, course: _Course, walks: int, crew: Crew
) -> StopReport | None:
    drawn = [course.short(number) for number in range(walks)]
    if counts_steps(drawn[0].schedule):
        return None
    jobs = [(library, walk.in_world, walk.schedule) for walk in drawn]
    found = run_jobs(measure_stop, jobs, Stop, crew.workers)
    return judge_stops(list(crew.track("stopping", found, len(jobs))))
