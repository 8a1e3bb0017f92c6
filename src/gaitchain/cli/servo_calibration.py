"""The calibration of the servos that a verb moves, real or emulated ones."""

from pathlib import Path

from gaitchain.backends.servos import Calibration, load_calibration, plain_calibration
from gaitchain.robot.robot import Robot
from gaitchain.service.robots import uncalibrated

EMULATED = "emulated"
"""What `--port` says for emulated servos."""


def calibration_of(
    robot: Robot, file: Path | None, port: str, what: str
) -> Calibration:
    """Return the calibration of a file, or for emulated servos a plain one.

    Args:
        robot: as in its file.
        file: of the calibration, if one is given.
        port: of the servos.
        what: needs it, for the message.

    Raises:
        CalibrationError: the file cannot be read, or is of another robot.
        CommandError: real servos have none.
    """
    if file is not None:
        return load_calibration(file, robot)
    if port == EMULATED:
        return plain_calibration(robot)
    raise uncalibrated(what, port)
