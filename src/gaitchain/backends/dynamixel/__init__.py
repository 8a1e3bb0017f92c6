"""Servos on a bus, and DYNAMIXEL: calibration, backend, and an emulated bus."""

from gaitchain.backends.dynamixel.backend import DynamixelBackend
from gaitchain.backends.dynamixel.calibration import Calibration, plain_calibration
from gaitchain.backends.dynamixel.calibration_file import (
    load_calibration,
    save_calibration,
)
from gaitchain.backends.dynamixel.emulator import ServoBusEmulator

__all__ = [
    "Calibration",
    "DynamixelBackend",
    "ServoBusEmulator",
    "load_calibration",
    "plain_calibration",
    "save_calibration",
]
