"""The calibration of the servos that a verb moves, real or emulated ones."""

from pathlib import Path

from gaitchain.backends.dynamixel import (
    Calibration,
    load_calibration,
    plain_calibration,
)
from gaitchain.errors import CommandError
from gaitchain.robot.robot import Robot

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
    raise CommandError(
        f"{what}: servos need a calibration: `gaitchain calibrate LIBRARY --port "
        f"{port} -o robot.toml`, then --calibration robot.toml"
    )
