"""Read the IMU on the servos' bus, in the trunk's frame."""

import struct

import numpy as np

from gaitchain.backends.servos.bus import ServoBus
from gaitchain.backends.servos.calibration import ImuCalibration
from gaitchain.backends.servos.table import Block
from gaitchain.errors import BackendError
from gaitchain.messages import Array

_TRIES = 4
_MISSED_MOST = 3  # missed answers in a row that are reported
_FORMATS = {"int16": "<3h", "float32": "<3f"}


class BusImu:
    """Gyro and accelerometer, read in one request."""

    def __init__(self, calibration: ImuCalibration) -> None:
        """Compute addresses and mounting from the calibration."""
        self._as = calibration
        places = calibration.gyro, calibration.accelerometer
        size = max(places) + calibration.vector_bytes - min(places)
        self._block = Block(min(places), size)
        self._turn = calibration.turn
        self._missed = 0

    @property
    def size(self) -> int:
        """Data of a read [byte]."""
        return self._block.size

    @property
    def note(self) -> str:
        """Present problem of the IMU; empty if none."""
        silent = self._missed >= _MISSED_MOST
        return f"imu (id {self._as.id}) does not answer" if silent else ""

    def find(self, bus: ServoBus) -> None:
        """Check that the IMU answers.

        Raises:
            BackendError: it does not answer.
        """
        if all(bus.read(self._as.id, self._block) is None for _ in range(_TRIES)):
            raise BackendError(
                f"{bus.name}: no answer from the imu (id {self._as.id}), asked for "
                f"{self._block.size} bytes at {self._block.address}; correct id and "
                "addresses in the table [imu] of the calibration, or take it out and "
                "walk with --open-loop"
            )

    def read(self, bus: ServoBus) -> tuple[Array, Array]:
        """Return angular velocity (3,) [rad/s] and acceleration (3,) [m/s^2].

        Both are in the trunk's frame, and NaN if the IMU does not answer.

        Raises:
            BackendError: the port is lost.
        """
        answer = bus.read(self._as.id, self._block)
        self._missed = self._missed + 1 if answer is None else 0
        if answer is None:
            return np.full(3, np.nan), np.full(3, np.nan)
        return (
            self._vector(answer.data, self._as.gyro, self._as.gyro_scale),
            self._vector(
                answer.data, self._as.accelerometer, self._as.accelerometer_scale
            ),
        )

    def _vector(self, data: bytes, address: int, scale: float) -> Array:
        start = address - self._block.address
        counts = struct.unpack_from(_FORMATS[self._as.format], data, start)
        return np.asarray(self._turn @ np.array(counts) * scale)
