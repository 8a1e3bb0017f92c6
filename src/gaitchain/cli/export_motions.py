"""`gaitchain export`: walked motions in the files that other projects read."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from gaitchain.cli.console import print_table, say, watched
from gaitchain.cli.files import check_files, check_replaced
from gaitchain.cli.libraries import read_library
from gaitchain.cli.options import Export
from gaitchain.discover.catalogue import find_robot_file
from gaitchain.errors import CommandError
from gaitchain.gait.command_range import command_text
from gaitchain.gait.library import GaitLibrary
from gaitchain.rl.formats import FORMATS
from gaitchain.rl.frames import Motion, stage_of
from gaitchain.rl.motions import Plan, record_motions
from gaitchain.walker.walker import Walker

_MOST_S = 600.0  # of a motion
_SLACK_S = 1e-9  # a cycle is a sum of times, rounded


def write_motions(options: Export) -> tuple[int, dict[str, Any]]:
    """Walk the motions and write them; the exit code is 1 if one fell."""
    if options.own_model is not None:
        find_robot_file(options.own_model)  # tells a missing file before any work
    library = read_library(options.library)
    Walker(library)  # refuses an unqualified library before any work
    kind = FORMATS[options.to]
    plan = _plan(options, library)
    to = _place(options, plan)
    walks = record_motions(plan, options.workers)
    motions = list(watched(walks, "walking the commands", len(plan.commands)))
    both = zip(plan.commands, motions, strict=True)
    fell = [asked.command for asked, motion in both if motion.fell]
    for command in fell:
        say(f"{command_text(command)}: the robot fell")
    written = [] if fell else kind.write(plan, motions, to)
    figures = _figures(plan, motions, written)
    _show(library, plan, figures)
    if fell:
        say(f"nothing written: {len(fell)} of {_counted(motions)} fell")
    else:
        named = " and ".join(map(str, written if kind.suffix else [to]))
        say(f"{named}: {_counted(motions)} for {options.to}")
    return int(bool(fell)), figures


def _plan(options: Export, library: GaitLibrary) -> Plan:
    """Return what is walked; refuse another robot's file, and too short a walk."""
    plan = Plan(
        library,
        _grid(options.grid),
        options.seconds,
        options.rate,
        options.own_model,
    )
    stage_of(library, options.own_model)  # refuses another robot's file at once
    least_s = FORMATS[options.to].least(plan)
    if not least_s - _SLACK_S <= options.seconds <= _MOST_S:  # nor NaN
        raise CommandError(
            f"--seconds {options.seconds:g}: a cycle takes {plan.cycle_s:.2f}, give "
            f"{_rounded_up(least_s):g} to {_MOST_S:g}"
        )
    return plan


def _counted(motions: Sequence[object]) -> str:
    return f"{len(motions)} motion{'s' * (len(motions) != 1)}"


def _place(options: Export, plan: Plan) -> Path:
    """Return the file or folder of the motions; refuse what they would destroy."""
    kind = FORMATS[options.to]
    name = f"{Path(options.library).stem}_{options.to}{kind.suffix}"
    to = options.output or Path("runs/export") / name
    if to.suffix != kind.suffix and kind.suffix:
        raise CommandError(
            f"{to}: --to {options.to} writes a file, name it *{kind.suffix}"
        )
    files = kind.files(plan, to)
    named = options.report.json, Path(options.library), options.own_model
    check_files(files, named)
    if kind.suffix:
        _check_beside(*files)
    else:
        _check_folder(*files)
    return to


def _check_beside(to: Path, *others: Path) -> None:
    """Refuse to replace what is no earlier export, beside a file that was named."""
    check_replaced(to, "the motions")
    for path in others:
        what = f"the motions, as {path.name} is written beside {to.name}"
        check_replaced(path, what, "the polynomials of motions")


def _check_folder(*files: Path) -> None:
    """Refuse to replace motions of a folder that is of no earlier export."""
    *motions, index = files
    check_replaced(index, "the motions", "the index of motions")
    ours = index.is_file() and index.stat().st_size  # else it has just been refused
    there = [path for path in motions if path.exists()]
    if there and not ours:
        raise CommandError(
            f"{there[0]}: it is there, without the {index.name} of an export; name "
            "another folder for the motions"
        )


def _rounded_up(seconds: float) -> float:
    """Return a time with two digits that is not below it."""
    return math.ceil(100.0 * (seconds - _SLACK_S)) / 100.0


def _grid(text: str) -> tuple[int, int, int]:
    """Read numbers of speeds ahead, aside and around."""
    words = text.split(",")
    if len(words) == 3 and all(word.strip().isdecimal() for word in words):
        ahead, aside, around = map(int, words)
        if all(n % 2 and 1 <= n <= 99 for n in (ahead, aside, around)):
            return ahead, aside, around
    raise CommandError(f"--grid {text}: give three odd numbers, such as 5,3,3")


def _figures(plan: Plan, motions: list[Motion], files: list[Path]) -> dict[str, Any]:
    """Return what was walked: commands, and the mean velocities that came of them."""
    walked = []
    for asked, motion in zip(plan.commands, motions, strict=True):
        row = {
            "wanted": list(asked.wanted.motion),
            "command": list(asked.command.motion),
            "fell": motion.fell,
        }
        walked.append(row | ({} if motion.fell else _speeds(motion)))
    return {
        "robot": plan.library.robot.name,
        "rate_hz": plan.rate_hz,
        "seconds": plan.seconds,
        "files": [str(path) for path in files],
        "motions": walked,
    }


def _speeds(motion: Motion) -> dict[str, float]:
    """Return mean speed over ground and yaw rate of a motion."""
    cos, sin = np.cos(motion.heading), np.sin(motion.heading)
    vx, vy = motion.qvel[:, 0], motion.qvel[:, 1]
    turned = np.unwrap(motion.heading)
    return {
        "vx_mps": float((cos * vx + sin * vy).mean()),
        "vy_mps": float((cos * vy - sin * vx).mean()),
        "yaw_rate_radps": float((turned[-1] - turned[0]) / motion.time[-1]),
    }


def _show(library: GaitLibrary, plan: Plan, figures: dict[str, Any]) -> None:
    done = [row for row in figures["motions"] if not row["fell"]]
    rows = []
    for name, axis in (("vx_mps", 0), ("vy_mps", 1), ("yaw_rate_radps", 2)):
        asked = np.array([row["command"][axis] for row in done])
        off = np.array([row[name] for row in done]) - asked
        limits = f"{asked.min(initial=0.0):.3f} to {asked.max(initial=0.0):.3f}"
        error = np.sqrt(np.mean(off**2)) if len(off) else np.nan
        label, _, unit = name.rpartition("_")
        shown = {"mps": "m/s", "radps": "rad/s"}[unit]
        rows.append((f"{label} [{shown}]", limits, f"{error:.3f}"))
    title = f"{_counted(plan.commands)} of {library.robot.name} in physics"
    print_table(title, ("", "commands", "rms error of the mean"), rows)
