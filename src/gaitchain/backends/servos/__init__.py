"""Servos on a bus, of any make: calibration, backend, and an emulated bus."""

from gaitchain.backends.servos.backend import ServoBackend
from gaitchain.backends.servos.calibration import Calibration, plain_calibration
from gaitchain.backends.servos.calibration_file import (
    load_calibration,
    save_calibration,
)
from gaitchain.backends.servos.emulator import ServoBusEmulator

__all__ = [
    "Calibration",
    "ServoBackend",
    "ServoBusEmulator",
    "load_calibration",
    "plain_calibration",
    "save_calibration",
]
