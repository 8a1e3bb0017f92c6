"""`gaitchain trial`: walk many schedules, each in its own world."""

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from gaitchain.build import trial as walks
from gaitchain.build.own_trials import (
    changes_since_gate,
    check_possible,
    run_own_trials,
)
from gaitchain.build.trial import TrialRun
from gaitchain.cli.console import print_table, say, watched
from gaitchain.cli.libraries import read_library
from gaitchain.cli.mixtures import refuse
from gaitchain.cli.options import Trial
from gaitchain.cli.world_options import (
    check_crouch,
    check_effects,
    check_pushes,
    given_by,
    read_schedule,
    wants_feedback,
    world_json,
    world_numbers,
)
from gaitchain.discover.catalogue import find_robot_file
from gaitchain.errors import CommandError
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.schedule import Schedule, ends_at
from gaitchain.sim.hidden_robot import draw_hidden_robot
from gaitchain.sim.world import World
from gaitchain.walker.walker import Walker

_RANDOM = "random"


def run(options: Trial) -> tuple[int, dict[str, Any]]:
    """Walk all schedules; the exit code is 1 if the robot fell in any."""
    feedback = wants_feedback(options.loop)
    fixed = world_numbers(options.world, options.push, options.punches)
    hidden = _hidden(options, fixed)
    if options.own_model is not None:
        check_possible(fixed, partial(given_by, options=options.world))
        find_robot_file(options.own_model)  # tells a missing file before any work
    library = read_library(options.library)
    Walker(library)  # refuses an unqualified library before any work
    check_effects(fixed, library.robot)
    check_crouch(options.crouch, library)
    random = options.schedule == _RANDOM
    _check_seconds(options, library)
    schedule = None if random else read_schedule(options.schedule, library)
    check_pushes(fixed, _ends_s(options, library, schedule))
    trial = walks.Trial(
        library,
        fixed=fixed | hidden,
        schedule=schedule,
        seconds=options.seconds,
        crouch=options.crouch,
        feedback=feedback,
        plant=library.robot.nominal if hidden else None,
    )
    stage = f"walking {_RANDOM} schedules" if random else "walking the schedule"
    results = list(watched(_walked(options, trial), stage, options.runs))
    if hidden:
        results = [replace(result, world=None) for result in results]
    figures = _figures(options, library, fixed, results)
    _show(library.robot.name, figures, results)
    return 0 if figures["survived"] == options.runs else 1, figures


def _check_seconds(options: Trial, library: GaitLibrary) -> None:
    """Refuse a length that other things decide.

    Raises:
        CommandError: a length is given, and the walks have their own.
    """
    if options.schedule != _RANDOM:
        refuse(
            options,
            ("seconds",),
            "of random schedules; --schedule says its own, as 0.3,0,0@9",
        )
    if library.family.counts_steps:
        refuse(options, ("seconds",), "this library's schedules are counted in steps")


def _walked(options: Trial, trial: walks.Trial) -> Iterator[TrialRun]:
    """Walk the trial, in the robot's own model if that is asked for."""
    asked = options.runs, options.seed, options.workers
    if options.own_model is None:
        return walks.run_trials(trial, *asked)
    if changed := changes_since_gate(options.own_model, trial.library):
        say(changed)
    return run_own_trials(trial, options.own_model, *asked)


def _ends_s(options: Trial, library: GaitLibrary, schedule: Schedule | None) -> float:
    """Return when the last command of each run ends [s]."""
    if schedule is not None:
        return ends_at(schedule, library.timing.step)
    # A random schedule in steps has a length of its own in each run.
    return math.inf if library.family.counts_steps else options.seconds


def _hidden(options: Trial, fixed: Mapping[str, Any]) -> dict[str, Any]:
    """Return the numbers of the hidden robot, if one is asked for.

    Raises:
        CommandError: another option says what it is like.
    """
    if options.robot_hidden is None:
        return {}
    if options.own_model is not None:
        raise CommandError("--robot-hidden: not with --own-model, which is the file's")
    hidden = draw_hidden_robot(options.robot_hidden)
    told = [given_by(name, options.world) for name in fixed if name in hidden]
    if told:
        raise CommandError(
            f"--{told[0]}: the hidden robot has one of its own; leave it out"
        )
    return hidden


def _figures(
    options: Trial,
    library: GaitLibrary,
    fixed: Mapping[str, Any],
    results: Sequence[TrialRun],
) -> dict[str, Any]:
    """Sum up the runs; means are over the runs that did not fall."""
    stood = [r for r in results if not r.fell]
    stops = [r.stop_s for r in stood if r.stop_s is not None]
    timed = options.schedule == _RANDOM and not library.family.counts_steps
    return {
        "runs": options.runs,
        "survived": len(stood),
        "speed_mps": _mean([r.speed_mps for r in stood]),
        "speed_error_mps": _mean([r.speed_error_mps for r in stood]),
        "yaw_drift_deg": _mean([_size(r.yaw_drift_deg) for r in stood]),
        "lateral_drift_m": _mean([_size(r.lateral_drift_m) for r in stood]),
        "zmp_rms_m": _mean([r.zmp_rms_m for r in stood]),
        "stop_s": max(stops, default=None),
        "stopped": len(stops),
        "seed": options.seed,
        "schedule": options.schedule,
        "seconds": options.seconds if timed else None,
        "feedback": not options.loop.open_loop,
        "own_model": None if options.own_model is None else str(options.own_model),
        "robot_hidden": options.robot_hidden,
        "fixed": world_json(fixed),
        "per_run": [_plain(r) for r in results],
    }


def _plain(result: TrialRun) -> dict[str, Any]:
    """Convert a run for JSON, with those numbers of its world that are not nominal."""
    values = {name: value for name, value in vars(result).items() if name != "fell"}
    world, nominal = vars(result.world or World()), vars(World())
    drawn = {name: value for name, value in world.items() if value != nominal[name]}
    return {**values, "survived": not result.fell, "world": world_json(drawn)}


def _mean(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None


def _size(value: float | None) -> float | None:
    return None if value is None else abs(value)


def _show(robot: str, figures: dict[str, Any], results: Sequence[TrialRun]) -> None:
    causes = Counter(r.cause.split(" at ")[0] for r in results if r.cause)
    slowest = f"{_text(figures['stop_s'], 's', 2)}, {figures['stopped']} stopped"
    rows = [
        ("survived", f"{figures['survived']} of {figures['runs']}"),
        ("mean speed", _text(figures["speed_mps"], "m/s")),
        ("mean speed error", _text(figures["speed_error_mps"], "m/s")),
        ("mean yaw drift", _text(figures["yaw_drift_deg"], "deg", 1)),
        ("mean drift to the side", _text(figures["lateral_drift_m"], "m", 3)),
        ("longest stop", slowest),
        *((cause, f"{count}") for cause, count in causes.most_common()),
    ]
    loop = "with feedback" if figures["feedback"] else "open loop"
    random = figures["schedule"] == _RANDOM
    title = "Random schedules" if random else figures["schedule"]
    loop += ", in its own model" if figures["own_model"] else ""
    loop += ", a hidden robot" if figures["robot_hidden"] is not None else ""
    print_table(f"{title}, {robot}, {loop}", ("", ""), rows)
    for result in results:
        if result.fell:
            say(f"run {result.seed[1]}: {result.schedule}: {result.cause}")


def _text(value: float | None, unit: str, digits: int = 4) -> str:
    return "-" if value is None else f"{value:.{digits}f} {unit}"
