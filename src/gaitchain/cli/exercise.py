"""`gaitchain calibrate --exercise`: safe motions of a robot, and the log of them."""

import sys
from typing import Any

from gaitchain.backends.base import Backend
from gaitchain.backends.dynamixel import (
    DynamixelBackend,
    ServoBusEmulator,
    load_calibration,
    plain_calibration,
)
from gaitchain.cli.console import check_writable, progress, say
from gaitchain.cli.libraries import read_library
from gaitchain.cli.options import Calibrate
from gaitchain.cli.prompt import Answers
from gaitchain.errors import CommandError
from gaitchain.identify.log import ExerciseLog, save_log
from gaitchain.identify.on_servos import exercise_servos
from gaitchain.live.exercise import Support
from gaitchain.messages import CONTROL_PERIOD_S
from gaitchain.robot.robot import Robot

_EMULATED = "emulated"
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


def run_exercise(options: Calibrate) -> tuple[int, dict[str, Any]]:
    """Let a robot exercise, in simulation or on its servos; write the log."""
    assert options.exercise is not None  # whoever calls has seen it
    other = {"-o": options.output, "--check": options.check}
    for name, value in other.items():
        if value is not None:
            raise CommandError(f"--exercise: not with {name}; calibrate first")
    if (options.port is None) == (options.robot_hidden is None):
        raise CommandError(
            "--exercise: give either --port, for a robot of servos, or --robot-hidden "
            "SEED, for a simulated one"
        )
    robot = read_library(options.library).robot.nominal
    check_writable(options.exercise)
    log = _simulated(robot, options) or _on_servos(robot, options)
    save_log(log, options.exercise)
    say(f"{options.exercise}: the log of {log.seconds:.0f} s. Next: gaitchain identify")
    rows = {part.motion.support: len(part.motion.targets) for part in log.parts}
    return 0, {"robot": robot.name, "seconds": log.seconds, "rows": rows}


def _simulated(robot: Robot, options: Calibrate) -> ExerciseLog | None:
    if options.robot_hidden is None:
        return None
    from gaitchain.identify.simulated import exercise_hidden  # noqa: PLC0415 - heavy

    return exercise_hidden(robot, options.robot_hidden)


def _on_servos(robot: Robot, options: Calibrate) -> ExerciseLog:
    backend = _servos(robot, options)
    answers = Answers(sys.stdin)
    with progress() as tell:
        return exercise_servos(
            robot, backend, lambda support: _ask(answers, support), tell
        )


def _ask(answers: Answers, support: Support) -> None:
    answers.ask(_WORDS[support])


def _servos(robot: Robot, options: Calibrate) -> Backend:
    """Return the robot's servos, or emulated ones."""
    assert options.port is not None  # checked by `run_exercise`
    port, emulated = options.port, options.port == _EMULATED
    if options.calibration is not None:
        calibration = load_calibration(options.calibration, robot)
    elif emulated:
        calibration = plain_calibration(robot)
    else:
        raise CommandError(
            "--exercise: servos need a calibration: `gaitchain calibrate LIBRARY "
            f"--port {port} -o robot.toml`, then --calibration robot.toml"
        )
    if emulated:
        port = ServoBusEmulator.like(calibration).port
    names = robot.legs.joint_names
    return DynamixelBackend(
        port, calibration, names, CONTROL_PERIOD_S, physical=not emulated
    )
