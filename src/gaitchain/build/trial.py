"""Trials: many walks, each with its own schedule and world."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from gaitchain.analysis.base_motion import drift, own_motion, pace, stretches
from gaitchain.analysis.simulated_walk import follow_schedule, run_schedule
from gaitchain.analysis.walk_metrics import RUN_IN_S, summarise
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.build.families import build_of
from gaitchain.build.jobs import run_jobs
from gaitchain.build.workers import available_cores
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.schedule import (
    Schedule,
    counts_steps,
    format_schedule,
    lowered,
)
from gaitchain.robot.robot import Robot
from gaitchain.sim.world import World
from gaitchain.sim.world_range import WorldRange
from gaitchain.walker.policy_table import Policy
from gaitchain.walker.walker import Walker

_RUNS_PER_SEED = 1_000_000
_FIGURES = (
    *("fell", "cause", "speed_error_mps", "distance_m", "speed_mps", "yaw_drift_deg"),
    *("lateral_drift_m", "stop_s", "zmp_rms_m"),
)


@dataclass(frozen=True)
class TrialRun:
    """Result of one walk, see `WalkSummary`; None for undefined figures."""

    seed: tuple[int, int]
    """(seed of the trial, number of the run), which reproduces the run."""
    schedule: str
    """The schedule as text."""
    fell: bool
    cause: str | None
    speed_error_mps: float | None
    distance_m: float
    last_step: tuple[int, int]
    """First and last pose of the last step."""
    speed_mps: float | None = None
    yaw_drift_deg: float | None = None
    lateral_drift_m: float | None = None
    stop_s: float | None = None
    zmp_rms_m: float | None = None
    world: World | None = None


@dataclass(frozen=True)
class Trial:
    """Settings that are the same for all runs."""

    library: GaitLibrary
    """The gaits."""
    policy: Policy = "look_ahead"
    """Selection rule of the chain."""
    worlds: WorldRange | None = None
    """Range of the worlds; None for the default of `draw_world`."""
    fixed: Mapping[str, Any] = field(default_factory=dict)
    """Fields of `World` that are the same in all runs."""
    schedule: Schedule | None = None
    """Schedule of every run; None draws one for each run."""
    seconds: float = 30.0
    """Length of the drawn schedules, if they count time [s]."""
    crouch: float = 0.0
    """Hips lower by this, see `schedule.lowered` [m]."""
    feedback: bool = True
    """Whether to walk with balance feedback."""
    plant: Robot | None = None
    """The robot that walks; the library's by default."""
    require_qualified: bool = True
    """False only for qualifying the library itself."""
    figures: bool = True
    """Whether all figures are measured; else falls, speeds and drift alone, in half the
    time."""


def run_trials(
    trial: Trial, runs: int, seed: int, workers: int | None = None, first: int = 0
) -> Iterator[TrialRun]:
    """Walk random schedules over the library's range of commands, or a given schedule.

    Args:
        trial: settings of the runs.
        runs: number of walks.
        seed: seed of schedules and worlds.
        workers: number of processes; all cores by default.
        first: number of the first walk, to go on with the walks of a seed.

    Yields:
        One result per run, in order, independent of the workers.
    """
    jobs = [(trial, (seed, i)) for i in range(first, first + runs)]
    yield from run_jobs(_run, jobs, TrialRun, workers or available_cores())


def without_caution(library: GaitLibrary) -> GaitLibrary:
    """Return a library whose robot does not slow down after a disturbance.

    A robot that slows down may survive a test because it does not execute the command
    that is to be tested.
    """
    return replace(library, recovery=None)


def draw_world(
    library: GaitLibrary,
    seed: tuple[int, int],
    rng: np.random.Generator,
    worlds: WorldRange | None = None,
    fixed: Mapping[str, Any] | None = None,
) -> World:
    """Draw the world of one run.

    By default the friction is 0.6 to 1. For strides the links differ by up to 0.1 from
    the robot's model; for key poses servo gain and mass vary as in `WorldRange`. Servos
    have the speed limit of the library's build.

    Args:
        library: the gaits.
        seed: seed of the trial and number of the run, which give the world's seed.
        rng: source of randomness.
        worlds: range of the worlds; by default that of the library's family.
        fixed: fields of `World` that are not drawn.
    """
    numbers: dict[str, Any] = {
        "seed": _RUNS_PER_SEED * seed[0] + seed[1],
        "speed_limit_deg_s": library.config.speed_limit_deg_s,
    }
    if worlds is None:
        worlds, shared = build_of(library.poses).trial_worlds()
        numbers |= shared
    return replace(worlds.draw(rng), **{**numbers, **(fixed or {})})


def _run(trial: Trial, seed: tuple[int, int]) -> TrialRun:
    library, rng = trial.library, np.random.default_rng(seed)
    drawn = trial.schedule or draw_schedule(trial, rng)
    schedule = lowered(drawn, trial.crouch)
    world = draw_world(library, seed, rng, trial.worlds, trial.fixed)
    walker = Walker(
        library,
        trial.policy,
        feedback=trial.feedback,
        require_qualified=trial.require_qualified,
    )
    backend, measure = MujocoBackend(trial.plant or library.robot, world), _measured
    if not trial.figures:
        measure = _followed
    found = measure(walker, backend, schedule)
    return TrialRun(
        seed=seed,
        schedule=format_schedule(schedule),
        last_step=(walker.gait.state.first, walker.gait.state.target),
        world=world,
        **{name: _known(value) for name, value in found.items()},
    )


def _measured(
    walker: Walker, backend: MujocoBackend, schedule: Schedule
) -> dict[str, Any]:
    """Walk, record it, and return all figures."""
    robot = walker.library.robot
    summary = summarise(robot, run_schedule(walker, backend, schedule), schedule)
    return {name: getattr(summary, name) for name in _FIGURES}


def _followed(
    walker: Walker, backend: MujocoBackend, schedule: Schedule
) -> dict[str, Any]:
    """Walk, and return what the way of the base tells."""
    walked = follow_schedule(walker, backend, schedule)
    base, fell_at_s = np.array(walked.base), walked.fell_at_s
    found: dict[str, Any] = dict.fromkeys(_FIGURES)
    found["fell"] = fell_at_s is not None
    found["cause"] = None if fell_at_s is None else f"fell at {fell_at_s:.1f} s"
    found["distance_m"] = float(base[-1, 0] - base[0, 0])
    if not counts_steps(schedule):
        motion, parts = own_motion(base), stretches((), schedule)
        found["speed_mps"], found["speed_error_mps"] = pace(motion, parts, RUN_IN_S)
        found["yaw_drift_deg"] = math.degrees(drift(motion, parts, 2))
        found["lateral_drift_m"] = drift(motion, parts, 1)
    return found


def draw_schedule(trial: Trial, rng: np.random.Generator) -> Schedule:
    """Draw a schedule over the library's range of commands."""
    library = trial.library
    most, seconds = library.command_range, trial.seconds
    return library.family.random_schedule(rng, most, seconds)


def _known(value: Any) -> Any:
    return None if isinstance(value, float) and math.isnan(value) else value
