"""`gaitchain doctor`: take a robot into service stage by stage, go or no-go."""

import math
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import msgspec

from gaitchain.backends.servos import Calibration, ServoBusEmulator
from gaitchain.backends.servos.calibration import ImuCalibration
from gaitchain.cli.console import (
    print_line,
    print_table,
    progress,
    results_so_far,
    say,
)
from gaitchain.cli.libraries import read_library
from gaitchain.cli.options import Doctor
from gaitchain.cli.prompt import YES, Answers
from gaitchain.cli.robot_page import robot_page
from gaitchain.cli.servo_calibration import EMULATED, calibration_of
from gaitchain.commission.bench import Bench, Verdict
from gaitchain.commission.stages import STAGES, Stage
from gaitchain.errors import CommandError
from gaitchain.gait.library import GaitLibrary
from gaitchain.messages import GRAVITY

_SKIP, _QUIT, _NO = ("s", "skip"), ("q", "quit"), ("n", "no")
_ALONE = Verdict(
    "skipped",
    "--yes: nobody is ready to catch it",
    "stand beside the robot, and leave --yes out",
)
_UNREACHED = Verdict("skipped", "not reached")
# As on an OpenCR board: 2000 deg/s and 2 g are the ends of 16 bits.
_EMULATED_IMU = ImuCalibration(
    id=200,
    gyro=38,
    accelerometer=44,
    gyro_scale=math.radians(2000.0) / 2**15,
    accelerometer_scale=2.0 * GRAVITY / 2**15,
)
_HEADS = "stage", "verdict", "found", "what to do"


def run(options: Doctor) -> tuple[int, dict[str, Any]]:
    """Go through the stages until one fails; the exit code is 0 if the last is a go."""
    library = read_library(options.library)
    if not library.qualified:
        raise CommandError(
            f"{options.library}: not qualified: physics has not passed it; `gaitchain "
            "qualify` says what holds"
        )
    calibration = _calibration(library, options)
    person = _Asked(None if options.yes else Answers(sys.stdin))
    with (
        robot_page(library, options.view, "Doctor") as screen,
        _port(library, calibration, options.port) as port,
        progress() as tell,
    ):
        bench = Bench(library, calibration, port, options.rate, person, tell, screen)
        bench.emulated = options.port == EMULATED
        found = {stage.name: _UNREACHED for stage in STAGES}
        try:
            _examine(bench, person, options, found)
        finally:
            results_so_far(_facts(library.robot.name, found))
            _show(found, library.robot.name, options.port)
            if bench.not_let_go:
                print_line(f"SWITCH THE SUPPLY OFF: {bench.not_let_go} may hold on")
    return 0 if _is_go(found) else 1, _facts(library.robot.name, found)


def _facts(robot: str, found: dict[str, Verdict]) -> dict[str, Any]:
    stages = {name: msgspec.to_builtins(v) for name, v in found.items()}
    return {"robot": robot, "go": _is_go(found), "stages": stages}


def _examine(
    bench: Bench, person: "_Asked", options: Doctor, found: dict[str, Verdict]
) -> None:
    """Carry out the stages from one on, and note the verdicts as they come."""
    names, begin = [stage.name for stage in STAGES], options.begin
    real = options.port != EMULATED
    for number, stage in enumerate(STAGES, start=1):
        if number <= names.index(begin):
            found[stage.name] = Verdict("skipped", f"begun with {begin}")
            continue
        if real and not (stage.held or person.present):
            found[stage.name] = _ALONE
            return
        say(f"\n[{number} of {len(STAGES)}] {stage.name}: {stage.what}")
        typed = person.goes_on()
        if typed in _QUIT:
            found[stage.name] = Verdict("skipped", "ended here")
            return
        if typed in _SKIP:
            found[stage.name] = Verdict("skipped", "by you")
            continue
        found[stage.name] = Verdict("skipped", "interrupted")
        verdict = found[stage.name] = stage.run(bench)
        say(_told(stage, verdict))
        if verdict.outcome == "no-go":
            return


def _told(stage: Stage, verdict: Verdict) -> str:
    todo = f"\n  to do: {verdict.todo}" if verdict.todo else ""
    return f"  {stage.name}: {verdict.outcome.upper()}: {verdict.said}{todo}"


def _show(found: dict[str, Verdict], robot: str, port: str) -> None:
    rows = [(n, v.outcome, v.said, v.todo) for n, v in found.items()]
    print_table(f"{robot} on {port}", _HEADS, rows, range(len(_HEADS)))
    if _is_go(found):
        say("GO: serve it slowly, rope on, and raise the speed step by step")


def _is_go(found: dict[str, Verdict]) -> bool:
    """Whether the last stage is a go; skipped or unreached stages do not count."""
    return found[STAGES[-1].name].outcome == "go"


class _Asked:
    """A person at the terminal, or nobody."""

    def __init__(self, answers: Answers | None) -> None:
        self._answers = answers

    @property
    def present(self) -> bool:
        """Whether anybody answers."""
        return self._answers is not None

    def goes_on(self) -> str:
        """Return what was typed before Enter at the begin of a stage."""
        if self._answers is None:
            return ""
        text = f"  Enter to begin, {_SKIP[0]} to skip it, {_QUIT[0]} to end"
        return self._answers.choose(text, *_SKIP, *_QUIT)

    def ready(self, text: str, meanwhile: Callable[[], None] | None = None) -> None:
        """Ask for something to be done by hand."""
        if self._answers is not None:
            self._answers.choose(f"  {text}. Press Enter", meanwhile=meanwhile)

    def confirms(
        self, question: str, meanwhile: Callable[[], None] | None = None
    ) -> bool:
        """Ask a question until it is answered by yes or no."""
        while self._answers is not None:
            typed = self._answers.ask(f"  {question} [y/n]", meanwhile).lower()
            if typed in YES + _NO:
                return typed in YES
            print_line("  type y or n")
        return True


def _calibration(library: GaitLibrary, options: Doctor) -> Calibration:
    robot, file, port = library.robot.nominal, options.calibration, options.port
    found = calibration_of(robot, file, port, "doctor")
    if file is None:
        return msgspec.structs.replace(found, imu=_EMULATED_IMU)
    return found


@contextmanager
def _port(library: GaitLibrary, calibration: Calibration, port: str) -> Iterator[str]:
    """Yield the serial port, of emulated servos if these are asked for."""
    if port != EMULATED:
        yield port
        return
    with ServoBusEmulator.standing(calibration, library.robot.legs) as bus:
        yield bus.port
