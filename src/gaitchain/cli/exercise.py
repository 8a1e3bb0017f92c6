"""`gaitchain calibrate --exercise`: safe motions of a robot, and the log of them."""

# ruff: noqa: PLC0415 - a robot's computer has no simulator.

import sys
from pathlib import Path
from typing import Any

import numpy as np

from gaitchain.backends.servos import ServoBackend, ServoBusEmulator
from gaitchain.backends.servos.calibration import LOW_PWM, MOST_PWM
from gaitchain.cli.console import progress, say
from gaitchain.cli.files import check_files, check_replaced
from gaitchain.cli.libraries import read_library
from gaitchain.cli.mixtures import refuse
from gaitchain.cli.options import Calibrate
from gaitchain.cli.prompt import Answers
from gaitchain.cli.robot_page import robot_page
from gaitchain.cli.servo_calibration import EMULATED, calibration_of
from gaitchain.errors import CommandError
from gaitchain.figures.replay import Recording, write_replay
from gaitchain.gait.library import GaitLibrary
from gaitchain.identify.log import ExerciseLog, save_log
from gaitchain.identify.on_servos import exercise_servos
from gaitchain.live.exercise import Motion, Support
from gaitchain.messages import CONTROL_PERIOD_S
from gaitchain.robot.robot import Robot

_OF_CALIBRATION, _OF_CALIBRATING = ("make", "baud", "ids"), ("pose", "limits")
_WORDS: dict[Support, str] = {
    "held": (
        "Hold the trunk up, level and fixed, so that both legs swing freely; keep "
        "hands away. Press Enter: the legs move for half a minute; Ctrl-C ends it"
    ),
    "standing": (
        "Stand the robot on level ground, feet side by side, hands ready to catch it. "
        "Press Enter: it stands up and sways for half a minute, Ctrl-C turns it off"
    ),
}
# Hung legs need little torque; a robot that stands has what its calibration allows.
_MOST_PWM: dict[Support, float] = {"held": LOW_PWM, "standing": MOST_PWM}
_COMES: dict[Support, str] = {
    "held": "Preview: so the legs will swing, the trunk held up",
    "standing": "Preview: so the legs will move, both soles on the ground",
}


def run_exercise(options: Calibrate) -> tuple[int, dict[str, Any]]:
    """Let a robot exercise, in simulation or on its servos; write page and log."""
    _check(options)
    library = read_library(options.library)
    robot, result = library.robot.nominal, dict[str, Any]()
    written = options.exercise, options.preview, options.report.json
    check_files(written, [Path(options.library), options.calibration])
    check_replaced(options.exercise, "the log", "the log of an exercise")
    check_replaced(options.preview, "the page")
    if options.preview is not None:  # before any motor moves
        result["preview"] = _draw(library, options.preview)
    if options.exercise is not None:
        log = _simulated(robot, options) or _on_servos(library, options)
        save_log(log, options.exercise)
        seconds = f"{log.seconds:.0f} s"
        next_is = log.uneven or "Next: gaitchain identify"
        say(f"{options.exercise}: the log of {seconds}. {next_is}")
        rows = {part.motion.support: len(part.motion.targets) for part in log.parts}
        result |= {"seconds": log.seconds, "rows": rows}
    return 0, {"robot": robot.name, **result}


def _check(options: Calibrate) -> None:
    """Refuse options that do not go together."""
    what = "--preview" if options.exercise is None else "--exercise"
    other = {"-o": options.output, "--check": options.check}
    for name, value in other.items():
        if value is not None:
            raise CommandError(f"{what}: not with {name}; calibrate first")
    _check_unused(options, what)
    sources = (options.port is not None) + (options.robot_hidden is not None)
    if options.exercise is not None and sources != 1:
        raise CommandError(
            "--exercise: give either --port, for a robot of servos, or --robot-hidden "
            "SEED, for a simulated one"
        )
    if options.view is not None and options.port is None:
        raise CommandError(
            "--view: shows what servos are asked for; give --exercise FILE and --port"
        )
    if options.exercise is None and sources:
        raise CommandError(
            "--preview: moves no robot; give --exercise FILE as well, or leave --port "
            "and --robot-hidden out"
        )


def _check_unused(options: Calibrate, what: str) -> None:
    """Refuse options that have no effect on an exercise."""
    refuse(
        options, _OF_CALIBRATION, f"has no effect with {what}: the calibration says it"
    )
    refuse(
        options, _OF_CALIBRATING, f"has no effect with {what}; it is for calibrating"
    )
    if options.calibration is not None and options.port is None:
        raise CommandError(
            f"{what}: --calibration is of servos; give their --port, or leave it out"
        )


def _draw(library: GaitLibrary, file: Path) -> dict[str, Any]:
    """Write the page of what the file's robot does in simulation; say how long."""
    from gaitchain.discover.looks import find_looks
    from gaitchain.identify.simulated import preview
    from gaitchain.sim.model import build_model

    robot = library.robot.nominal
    shown = preview(robot)
    model = build_model(robot, looks=find_looks(library))
    no_zmp = np.full((len(shown.qpos), 2), np.nan)
    recording = Recording(shown.time_s, shown.qpos, no_zmp)
    write_replay(model, recording, file, title=f"{robot.name}: exercise")
    seconds = float(shown.time_s[-1])
    say(f"{file}: the {seconds:.0f} s in simulation (open it in any browser)")
    return {"seconds": seconds}


def _simulated(robot: Robot, options: Calibrate) -> ExerciseLog | None:
    if options.robot_hidden is None:
        return None
    from gaitchain.identify.simulated import exercise_hidden

    return exercise_hidden(robot, options.robot_hidden)


def _on_servos(library: GaitLibrary, options: Calibrate) -> ExerciseLog:
    robot = library.robot.nominal
    backend = _servos(robot, options)
    answers = Answers(sys.stdin)
    with robot_page(library, options.view, "Exercise") as screen, progress() as tell:

        def ready(motion: Motion) -> None:
            backend.limit_torque(_MOST_PWM[motion.support])
            screen.play(motion.targets, CONTROL_PERIOD_S, _COMES[motion.support])
            answers.choose(_WORDS[motion.support])
            screen.clear()

        return exercise_servos(
            robot,
            backend,
            ready,
            tell,
            sent=screen.show,
            write_s=backend.load.write_s,
        )


def _servos(robot: Robot, options: Calibrate) -> ServoBackend:
    """Return the robot's servos, or emulated ones."""
    assert options.port is not None  # checked by `run_exercise`
    port, emulated = options.port, options.port == EMULATED
    calibration = calibration_of(robot, options.calibration, port, "--exercise")
    if emulated:
        port = ServoBusEmulator.like(calibration).port
    names = robot.legs.joint_names
    return ServoBackend(
        port, calibration, names, CONTROL_PERIOD_S, physical=not emulated
    )
