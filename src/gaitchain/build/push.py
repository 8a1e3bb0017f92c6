"""Least impulse of a push after which a walking robot falls, for each direction.

Each run has its own world and its own moment of the push, the same for all directions.
Bisection finds its critical impulse, between one that the robot withstands and one
after which it falls. At the median of the critical impulses half of the runs fall.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import scipy

from gaitchain.analysis.simulated_walk import run_unrecorded
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.build.jobs import run_jobs
from gaitchain.build.trial import draw_world
from gaitchain.build.workers import available_cores
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.schedule import Segment
from gaitchain.messages import GRAVITY, Command
from gaitchain.sim.bodies import ANY_BODY, check_body
from gaitchain.sim.push import Push
from gaitchain.sim.push_force import draw_body
from gaitchain.walker.walker import Walker

RESOLUTION = 1.0 / 128.0
"""Resolution of a critical impulse over m sqrt(g h), so that it suits any robot."""
MOST = 4.0
"""Upper limit of a critical impulse, used if the robot withstands it; the same unit."""
_FIRST = 1.0 / 8.0
_RUN_IN_S, _RUN_IN_STEPS = 4.0, 2.0  # walk before the push, the longer one
_AFTER_S, _AFTER_STEPS = 4.0, 2.0  # walk after the push, the longer one
_PHASE_STEPS = 2.0  # the moment of the push is uniform over one cycle
_CONFIDENCE = 0.9


@dataclass(frozen=True)
class PushTest:
    """Result of one run with pushes in one direction."""

    run: int
    """Number of the run."""
    direction_deg: float
    """Direction of the push relative to the trunk: 0 forward, +90 to the left [deg]."""
    at_s: float
    """Start of the push, since the start of the walk [s]."""
    critical_ns: float
    """Critical impulse [N s]."""


@dataclass(frozen=True)
class PushResult:
    """Result of all runs for one direction."""

    direction_deg: float
    """Direction of the push relative to the trunk [deg]."""
    impulse_ns: float
    """Median of the critical impulses [N s]."""
    interval_ns: tuple[float, float]
    """90 % confidence interval of the median [N s]; NaN of fewer than five runs."""
    critical_ns: tuple[float, ...]
    """Critical impulse of each run [N s]."""

    @property
    def fell_alone(self) -> int:
        """Number of runs that fell without a push, which count as 0."""
        return sum(impulse == 0.0 for impulse in self.critical_ns)

    def withstood(self, scale_ns: float) -> int:
        """Return the number of runs that no push made fall, and count as the hardest.

        Args:
            scale_ns: m sqrt(g h) of the robot [N s].
        """
        return sum(impulse >= MOST * scale_ns for impulse in self.critical_ns)


@dataclass(frozen=True)
class PushedWalk:
    """The walk that is pushed; the same for all runs."""

    library: GaitLibrary
    """The gaits."""
    vx: float = 0.3
    """Speed of the walk [m/s]."""
    fixed: Mapping[str, Any] = field(default_factory=dict)
    """Fields of `World` that are the same in all runs, see `draw_world`."""
    feedback: bool = True
    """Whether to walk with balance feedback."""
    body: str = Push.body
    """Name of the body that is pushed, or `bodies.ANY_BODY`."""


def run_pushes(
    walk: PushedWalk,
    runs: int,
    seed: int,
    *,
    directions: int = 8,
    workers: int | None = None,
) -> Iterator[PushTest]:
    """Find the critical impulse of each run in each direction.

    Args:
        walk: the walk that is pushed.
        runs: number of runs per direction.
        seed: seed of worlds and moments of the push.
        directions: number of directions, evenly spaced from 0 (forward).
        workers: number of processes; all cores by default.

    Yields:
        One result per run, direction by direction, independent of the workers.
    """
    sides = [360.0 * i / directions for i in range(directions)]
    jobs = [(walk, (seed, i), side) for side in sides for i in range(runs)]
    yield from run_jobs(_critical, jobs, PushTest, workers or available_cores())


def judge(tests: Sequence[PushTest]) -> list[PushResult]:
    """Combine the runs of each direction, in the order of the directions.

    Args:
        tests: results of all runs in all directions.
    """
    results: list[PushResult] = []
    for side in dict.fromkeys(test.direction_deg for test in tests):
        critical = tuple(t.critical_ns for t in tests if t.direction_deg == side)
        median = float(np.median(critical))
        results.append(PushResult(side, median, _interval(critical), critical))
    return results


def _interval(critical: Sequence[float]) -> tuple[float, float]:
    """Return the runs between which the median is with 90 % confidence, at least.

    Each run is below the median by even odds, so that the number of those below is
    binomial. Of fewer than five runs all may be on one side: NaN.
    """
    ordered = sorted(critical)
    outside = int(scipy.stats.binom.ppf(0.5 * (1.0 - _CONFIDENCE), len(ordered), 0.5))
    return (ordered[outside - 1], ordered[-outside]) if outside else (math.nan,) * 2


class Size(NamedTuple):
    """What impulses and heights of a robot are compared with."""

    mass_kg: float
    com_m: float
    """Height h of the CoM of the standing robot."""
    impulse_ns: float
    """m sqrt(g h)."""


def size_of(library: GaitLibrary) -> Size:
    """Return the size of a library's robot."""
    mass, backend = library.robot.reduced.mass, MujocoBackend(library.robot)
    backend.connect(Walker(library, require_qualified=False).stand)
    height = float(backend.data.subtree_com[1, 2])
    return Size(mass, height, mass * math.sqrt(GRAVITY * height))


def impulse_unit_ns(library: GaitLibrary) -> float:
    """Return the unit of impulses on a library's robot, m sqrt(g h) [N s]."""
    return size_of(library).impulse_ns


def _critical(walk: PushedWalk, seed: tuple[int, int], side: float) -> PushTest:
    library, rng = walk.library, np.random.default_rng(seed)
    world = draw_world(library, seed, rng, fixed=walk.fixed)
    step_s = library.timing.step
    phase_s = float(rng.uniform(0.0, _PHASE_STEPS)) * step_s
    at_s = round(max(_RUN_IN_S, _RUN_IN_STEPS * step_s) + phase_s, 2)
    walker = Walker(library, feedback=walk.feedback)
    backend = MujocoBackend(library.robot, world)
    body = draw_body(backend.masses, rng) if walk.body == ANY_BODY else walk.body
    check_body(body, backend.masses)
    scale_ns = impulse_unit_ns(library)

    def falls(part: float) -> bool:
        push = Push(part * scale_ns, side, at_s, body=body)
        backend.set_pushes(push)
        walker.reset()
        seconds = at_s + push.duration_s + max(_AFTER_S, _AFTER_STEPS * step_s)
        ahead = (Segment(Command(walk.vx), seconds),)
        return run_unrecorded(walker, backend, ahead).fell_at_s is not None

    return PushTest(seed[1], side, at_s, scale_ns * _bisect(falls))


def _bisect(falls: Callable[[float], bool]) -> float:
    """Return the critical impulse: midway between one without and one with a fall."""
    if falls(0.0):
        return 0.0
    low, high = 0.0, _FIRST
    while not falls(high):
        low, high = high, 2.0 * high
        if high > MOST:
            return MOST
    while high - low > RESOLUTION:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if falls(middle) else (middle, high)
    return 0.5 * (low + high)
