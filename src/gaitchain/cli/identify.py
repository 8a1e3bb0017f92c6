"""`gaitchain identify`: how a robot differs from its file, by its own log."""

import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from gaitchain.build.journal import Journal
from gaitchain.build.workers import Crew, available_cores
from gaitchain.cli.console import print_table, progress, say
from gaitchain.cli.files import check_files, check_picture, check_replaced
from gaitchain.cli.kept_work import kept_in
from gaitchain.cli.libraries import read_library
from gaitchain.cli.options import Identify
from gaitchain.errors import CommandError, LogError
from gaitchain.figures.identification import Compared, plot_missed
from gaitchain.gait.command_range import AXES, ends_text, inward
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.library_file import library_bytes, save_library
from gaitchain.identify.adapt import adapt
from gaitchain.identify.fit import Fit, Found, checked_parts, fit_logs
from gaitchain.identify.log import ExerciseLog, load_log
from gaitchain.robot.robot import Robot

_NAMES = {
    "gain": "servo gain",
    "offset": "encoder shows more by",
    "com": "CoM of the trunk",
    "tilt": "IMU turned about",
    "damping": "damping beyond the gain",
    "delay_s": "delay",
    "backlash_deg": "backlash",
    "dry_friction": "dry friction / torque limit",
    "stiction": "stiction",
    "viscous_friction": "viscous friction",
    "trunk_mass": "mass of the trunk",
    "imu_delay_s": "IMU late by",
}
_SENSORS = (
    ("joints", math.degrees(1.0), "deg"),
    ("gyro", 1.0, "rad/s"),
    ("accelerometer", 1.0, "m/s^2"),
)
_MOST = 0.95  # of the rows: a log that has a sensor in less of them lost packets


def run(options: Identify) -> tuple[int, dict[str, Any]]:
    """Fit the robot, qualify the library for it; the exit code is 1 if it fails."""
    library = read_library(options.library)
    logs = _logs(options.logs)
    written = options.output, options.picture, options.report.json
    check_files(written, [Path(options.library), *options.logs])
    check_replaced(options.output, "the library", "a gait library")
    if options.picture is not None:
        check_picture(options.picture)
    _check(library.robot, options.logs, logs)  # before a journal is begun
    journal = _begun(options, library)
    fit, fitted = _identified(options, library, logs, journal)
    save_library(fitted, options.output)
    journal.remove()
    verdict = "qualified" if fitted.qualified else "NOT qualified"
    say(
        f"{options.output}: {verdict} for this robot, "
        f"{ends_text(*fitted.command_range.vx, AXES['vx'])} "
        f"({inward(library.command_range.vx[1]):.3f} before)"
    )
    return 0 if fitted.qualified else 1, _figures(fitted, fit)


def _begun(options: Identify, library: GaitLibrary) -> Journal:
    """Open the journal of the fit and of the walks after it; say if it goes on."""
    path = options.output.with_name(f"{options.output.name}.identify.jsonl")
    interrupted = path.exists()
    logs = [log.read_bytes() for log in options.logs]
    journal = Journal(path, library_bytes(library), *logs)
    if interrupted:
        say(journal.greeting)
    return journal


def _identified(
    options: Identify,
    library: GaitLibrary,
    logs: Sequence[ExerciseLog],
    journal: Journal,
) -> tuple[Fit, GaitLibrary]:
    """Fit the robot, show it as soon as it is found, and walk it.

    What is finished is kept until the end, so that an interrupted one can be continued.
    """
    workers = options.workers or available_cores()
    with kept_in(journal):
        with progress() as tell:
            fit = fit_logs(library.robot, logs, workers, tell)
        _show(library.robot.name, fit)
        if options.picture is not None:
            _draw(library.robot, logs, fit, options.picture)
        with progress() as tell:
            return fit, adapt(library, fit, Crew(workers, tell))


def _logs(paths: Sequence[Path]) -> list[ExerciseLog]:
    """Read the logs.

    Raises:
        CommandError: there is none, or two have the same content.
    """
    if not paths:
        raise CommandError("identify: give a log, which `calibrate --exercise` writes")
    logs = [load_log(path) for path in paths]
    contents = [path.read_bytes() for path in paths]
    for i, content in enumerate(contents):
        first = contents.index(content)
        if first < i:
            raise CommandError(
                f"{paths[i]}: the same log as {paths[first]}; it tells things only once"
            )
    return logs


def _check(robot: Robot, paths: Sequence[Path], logs: Sequence[ExerciseLog]) -> None:
    """Refuse logs that cannot be fitted, and name the file of the one that cannot be.

    Raises:
        LogError: one cannot; without a file where it is what none of them has.
    """
    try:
        checked_parts(robot, logs)
    except LogError as error:
        for path, log in zip(paths, logs, strict=True):
            if _fault(robot, log) == str(error):
                raise LogError(f"{path}: {error}") from None
        raise


def _fault(robot: Robot, log: ExerciseLog) -> str:
    """Return why a log cannot be fitted; empty if it can be."""
    try:
        checked_parts(robot, [log])
    except LogError as error:
        return str(error)
    return ""


def _figures(fitted: GaitLibrary, fit: Fit) -> dict[str, Any]:
    """Return what was found, in plain values."""
    figures = {
        "robot": fitted.robot.name,
        "qualified": fitted.qualified,
        "commands": asdict(fitted.command_range),
        "turnaround_s": fit.identified.turnaround_s,
        "numbers": [_plain(number) for number in fit.numbers],
        "rms_before": fit.before,
        "rms_after": fit.after,
        "present": fit.present,
    }
    plain: dict[str, Any] = json.loads(json.dumps(figures))
    return plain


def _draw(robot: Robot, logs: Sequence[ExerciseLog], fit: Fit, path: Path) -> None:
    names = robot.legs.joint_names
    legs, parts = slice(len(names)), [part for log in logs for part in log.parts]
    motions = [
        Compared(
            "held up" if support == "held" else support,
            part.measured.joint_position,
            before[:, legs],
            after[:, legs],
        )
        for part, (support, before, after) in zip(parts, fit.missed, strict=True)
    ]
    plot_missed(names, motions, robot.name, path)
    say(f"{path}: the joint fitted worst, and what replays miss of each joint")


def _show(robot: str, fit: Fit) -> None:
    heads = "", "of", "found", "+-", "unit"
    print_table(f"{robot}, as its log shows it", heads, _rows(fit.numbers))
    if not all(number.told for number in fit.numbers):
        say("(in brackets: the log says little more than what was assumed before)")
    took_s = fit.identified.turnaround_s
    if took_s is not None:
        say(
            f"of the delay, {1e3 * took_s:.1f} ms are the bus's (median, from a read "
            "to its targets); `gaitchain doctor` compares with that"
        )
    for sensor in zip(_SENSORS, fit.before, fit.after, fit.present, strict=True):
        say(_missed(*sensor))


def _missed(
    sensor: tuple[str, float, str],
    before: float | None,
    after: float | None,
    present: float,
) -> str:
    """Say what replays miss of a sensor, and how much of it the logs have."""
    what, scale, unit = sensor
    if before is None or after is None:
        return f"{what}: none in the log; what only it tells is as assumed before"
    seldom = f"; only {present:.0%} of the rows have it" if present < _MOST else ""
    return (
        f"replay misses the {what} by {scale * before:.3g} {unit} with the file's "
        f"numbers, {scale * after:.3g} with these (RMS){seldom}"
    )


def _rows(numbers: Iterable[Found]) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = []
    for parameter, value, sd, told in numbers:
        shown = f"{value:.3g}" if told else f"({value:.3g})"
        name, unit = _NAMES[parameter.name], parameter.prior.unit
        rows.append((name, parameter.of, shown, f"{sd:.2g}", unit))
    return rows


def _plain(number: Found) -> dict[str, Any]:
    parameter = number.parameter
    return {
        "name": parameter.name,
        "of": parameter.of,
        "value": number.value,
        "sd": number.sd,
        "unit": parameter.prior.unit,
        "told": number.told,
    }
