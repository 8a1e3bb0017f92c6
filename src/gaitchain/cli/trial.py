"""`gaitchain trial`: many random schedules, each in a world of its own."""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from gaitchain.cli.console import (
    check_writable,
    print_table,
    say,
    watched,
    write_json,
)
from gaitchain.cli.options import Trial
from gaitchain.errors import CommandError
from gaitchain.library_file import load_library
from gaitchain.trial import TrialRun, run_trials
from gaitchain.walker import Walker


def run(options: Trial) -> int:
    """Walk all schedules; return 1 if the robot fell in any."""
    if options.runs < 1:
        raise CommandError(f"--runs {options.runs}: give 1 or more")
    if not 0 <= options.seed < 2**32:  # from there on, seeds are the gate's
        raise CommandError(f"--seed {options.seed}: give 0 to {2**32 - 1}")
    if options.json is not None:
        check_writable(options.json)
    library = load_library(options.library)
    Walker(library)  # refuses an unqualified library before any work
    trials = run_trials(library, options.runs, options.seed)
    results = list(watched(trials, "walking random schedules", options.runs))
    figures = _figures(options, results)
    if options.json is not None:
        write_json(options.json, figures)
    _show(library.biped.name, figures, results)
    return 0 if figures["survived"] == options.runs else 1


def _figures(options: Trial, results: Sequence[TrialRun]) -> dict[str, Any]:
    errors = [r.speed_error_mps for r in results if not r.fell]
    return {
        "runs": options.runs,
        "survived": sum(not r.fell for r in results),
        "speed_error_mps": float(np.mean(errors)) if errors else None,
        "seed": options.seed,
        "feedback": False,
        "per_run": [_plain(r) for r in results],
    }


def _plain(result: TrialRun) -> dict[str, Any]:
    error = result.speed_error_mps
    return {**asdict(result), "speed_error_mps": None if math.isnan(error) else error}


def _show(robot: str, figures: dict[str, Any], results: Sequence[TrialRun]) -> None:
    error = figures["speed_error_mps"]
    causes = Counter(r.cause.split(" at ")[0] for r in results if r.cause)
    rows = [
        ("survived", f"{figures['survived']} of {figures['runs']}"),
        ("mean speed error", "-" if error is None else f"{error:.4f} m/s"),
        *((cause, f"{count}") for cause, count in causes.most_common()),
    ]
    print_table(f"Random schedules, {robot}, open loop", ("", ""), rows)
    for result in results:
        if result.fell:
            say(f"run {result.seed[1]}: {result.schedule}: {result.cause}")
