"""Many walks of random schedules, each in a world of its own."""

import os
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from joblib import Parallel, delayed

from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.choices import Policy
from gaitchain.control import run_schedule
from gaitchain.library import GaitLibrary
from gaitchain.measure import summarise
from gaitchain.physics import WorldRange
from gaitchain.schedule import format_schedule, random_schedule
from gaitchain.walker import Walker


@dataclass(frozen=True)
class TrialRun:
    """One random schedule, walked."""

    seed: tuple[int, int]
    """(seed of the trial, number of the run): repeats this very run."""
    schedule: str
    fell: bool
    cause: str | None
    speed_error_mps: float
    distance_m: float
    last_step: tuple[int, int]
    """First and last pose of the step in which the walk ended or fell."""


def run_trials(
    library: GaitLibrary,
    runs: int,
    seed: int,
    *,
    workers: int | None = None,
    policy: Policy = "look_ahead",
    worlds: WorldRange | None = None,
    require_qualified: bool = True,
) -> Iterator[TrialRun]:
    """Walk random schedules within the library's speed range.

    Args:
        library: the gaits.
        runs: number of schedules.
        seed: of schedules and worlds.
        workers: processes; all cores by default.
        policy: how the chain chooses.
        worlds: how much friction, servo gain and mass vary.
        require_qualified: False only for qualifying the library itself.

    Yields:
        One result per run, in order, whatever the workers.
    """
    jobs = (
        delayed(_run)(library, (seed, i), policy, worlds, require_qualified)
        for i in range(runs)
    )
    pool = Parallel(n_jobs=workers or available_cores(), return_as="generator")
    yield from pool(jobs)


def available_cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 1


def _run(
    library: GaitLibrary,
    seed: tuple[int, int],
    policy: Policy,
    worlds: WorldRange | None,
    require_qualified: bool,
) -> TrialRun:
    rng = np.random.default_rng(seed)
    schedule = random_schedule(rng, *library.speed_range)
    world = (worlds or WorldRange()).draw(rng)
    walker = Walker(library, policy, require_qualified=require_qualified)
    record = run_schedule(walker, MujocoBackend(library.biped, world), schedule)
    summary = summarise(library.biped, record, schedule)
    return TrialRun(
        seed=seed,
        schedule=format_schedule(schedule),
        fell=summary.fell,
        cause=summary.cause,
        speed_error_mps=summary.speed_error_mps,
        distance_m=summary.distance_m,
        last_step=(walker.state.first, walker.state.target),
    )
