"""How hard a push must be to bring a walking robot down, from every side.

Each run has a world and a moment of the gait of its own, the same for all sides. Its
critical impulse lies between one that it withstands and one that it falls after, found
by bisection; half of the runs fall at the median of theirs.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from gaitchain.analysis.simulated_walk import run_unrecorded
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.build.jobs import run_jobs
from gaitchain.build.trial import draw_world
from gaitchain.build.workers import available_cores
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.schedule import Segment
from gaitchain.messages import GRAVITY, Command
from gaitchain.sim.world import Push
from gaitchain.walker.walker import Walker

RESOLUTION_NS = 0.5
"""Of a critical impulse [N s]."""
MOST_NS = 256.0
"""A robot that withstands this much counts as falling after it [N s]."""
_FIRST_NS = 8.0
_RUN_IN_S, _RUN_IN_STEPS = 4.0, 2.0  # walking before the push, the longer one
_AFTER_S, _AFTER_STEPS = 4.0, 2.0  # and after it
_PHASE_STEPS = 2.0  # the push comes at any time of a cycle
_RESAMPLES = 2000
_INTERVAL = (0.05, 0.95)


@dataclass(frozen=True)
class PushTest:
    """One run pushed from one side."""

    run: int
    direction_deg: float
    """As the trunk faces: 0 is pushed forward, +90 to the left [deg]."""
    at_s: float
    """When the push begins, since the walk began [s]."""
    critical_ns: float
    """Between an impulse that it withstood and one that it fell after [N s]."""


@dataclass(frozen=True)
class PushResult:
    """What the runs say about one side."""

    direction_deg: float
    impulse_ns: float
    """Half of the runs fall [N s]."""
    interval_ns: tuple[float, float]
    """90 % interval of it, from runs drawn again (bootstrap) [N s]."""
    critical_ns: tuple[float, ...]
    """Of each run [N s]."""


@dataclass(frozen=True)
class PushedWalk:
    """What is walked while it is pushed; the same for all runs."""

    library: GaitLibrary
    vx: float = 0.3
    """Speed of the walk [m/s]."""
    fixed: Mapping[str, Any] = field(default_factory=dict)
    """Numbers of `World` that are the same in all runs, see `draw_world`."""
    feedback: bool = True
    """Whether the walk is balanced."""


def run_pushes(
    walk: PushedWalk,
    runs: int,
    seed: int,
    *,
    directions: int = 8,
    workers: int | None = None,
) -> Iterator[PushTest]:
    """Find the critical impulse of each run and side.

    Args:
        walk: what is walk.
        runs: worlds and moments of the gait.
        seed: of both.
        directions: sides, evenly spaced from 0, pushed forward.
        workers: processes; all cores by default.

    Yields:
        One result per run and side, side after side, whatever the workers.
    """
    sides = [360.0 * i / directions for i in range(directions)]
    jobs = [(walk, (seed, i), side) for side in sides for i in range(runs)]
    yield from run_jobs(_critical, jobs, PushTest, workers or available_cores())


def judge(tests: Sequence[PushTest], seed: int = 0) -> list[PushResult]:
    """Put the runs of each side together, in the order of the sides.

    Args:
        tests: of every side and run.
        seed: of the runs that are drawn again for the interval.
    """
    results: list[PushResult] = []
    for side in dict.fromkeys(test.direction_deg for test in tests):
        critical = np.array([t.critical_ns for t in tests if t.direction_deg == side])
        rng = np.random.default_rng((seed, len(results)))
        drawn = rng.choice(critical, (_RESAMPLES, len(critical)))
        low, high = np.quantile(np.median(drawn, axis=1), _INTERVAL).tolist()
        median = float(np.median(critical))
        results.append(PushResult(side, median, (low, high), tuple(critical.tolist())))
    return results


def impulse_scale(library: GaitLibrary) -> tuple[float, float, float]:
    """Return mass m [kg], height h of the CoM standing [m], and m sqrt(g h) [N s]."""
    robot = library.robot
    backend = MujocoBackend(robot)
    backend.connect(Walker(library, require_qualified=False).stand)
    height = float(backend.data.subtree_com[1, 2])
    return robot.reduced.mass, height, robot.reduced.mass * math.sqrt(GRAVITY * height)


def _critical(walk: PushedWalk, seed: tuple[int, int], side: float) -> PushTest:
    library, rng = walk.library, np.random.default_rng(seed)
    world = draw_world(library, seed, rng, fixed=walk.fixed)
    step_s = library.timing.step
    phase_s = float(rng.uniform(0.0, _PHASE_STEPS)) * step_s
    at_s = round(max(_RUN_IN_S, _RUN_IN_STEPS * step_s) + phase_s, 2)
    walker = Walker(library, feedback=walk.feedback)
    backend = MujocoBackend(library.robot, world)

    def falls(impulse_ns: float) -> bool:
        push = Push(impulse_ns, side, at_s)
        backend.world = replace(world, push=(push,))
        walker.reset()
        seconds = at_s + push.duration_s + max(_AFTER_S, _AFTER_STEPS * step_s)
        ahead = (Segment(Command(walk.vx), seconds),)
        return run_unrecorded(walker, backend, ahead).fell_at_s is not None

    return PushTest(seed[1], side, at_s, _bisect(falls))


def _bisect(falls: Callable[[float], bool]) -> float:
    """Return the middle between an impulse that holds and one that does not [N s]."""
    if falls(0.0):
        return 0.0
    low, high = 0.0, _FIRST_NS
    while not falls(high):
        low, high = high, 2.0 * high
        if high > MOST_NS:
            return MOST_NS
    while high - low > RESOLUTION_NS:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if falls(middle) else (middle, high)
    return 0.5 * (low + high)
