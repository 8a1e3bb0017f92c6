"""An emulated IMU on the servos' bus."""

import struct

import numpy as np

from gaitchain.backends.servos.calibration import ImuCalibration
from gaitchain.backends.servos.table import Block
from gaitchain.messages import GRAVITY, Array

_OK, _ACCESS = 0, 7  # error codes of protocol 2.0
_SIZE = 1100  # bytes of the table
_MOST_INT16 = 2**15 - 1
_GYRO_NOISE, _ACCELEROMETER_NOISE = 0.003, 0.01  # rad/s and m/s^2, of a usual IMU


class EmulatedImu:
    """A gyro and an accelerometer, mounted as in a calibration."""

    alert, status_level = 0, 2
    ping_data = (0x7400).to_bytes(2, "little") + b"\x05"

    def __init__(self, calibration: ImuCalibration) -> None:
        """Start upright and at rest."""
        self.number = calibration.id
        self.registered: tuple[int, bytes] | None = None
        """Address and data of a write that waits for an action."""
        self.angular_velocity: Array = np.zeros(3)
        """(3,) angular velocity in the trunk's frame [rad/s]."""
        self.acceleration: Array = np.array([0.0, 0.0, GRAVITY])
        """(3,) acceleration with gravity in the trunk's frame [m/s^2]."""
        self.noise_factor = 1.0
        """How much it is of a usual IMU's, at least one count; without any it counts as
        stuck."""
        self._as = calibration
        self._random = np.random.default_rng(calibration.id)

    def hear(self, now: float) -> None:
        """Do nothing: the IMU has no watchdog."""

    def reboot(self) -> None:
        """Do nothing: the IMU has no state to reset."""

    def write(self, address: int, data: bytes) -> int:
        """Return an access error: the table is read-only."""
        return _ACCESS

    def read(self, block: Block) -> tuple[int, bytes]:
        """Return the error and a block of the table."""
        memory, mounted = bytearray(_SIZE), self._as
        if block.end > _SIZE:
            return _ACCESS, b""
        turning, pulling = mounted.gyro_scale, mounted.accelerometer_scale
        for address, scale, vector, noise in (
            (mounted.gyro, turning, self.angular_velocity, _GYRO_NOISE),
            (mounted.accelerometer, pulling, self.acceleration, _ACCELEROMETER_NOISE),
        ):
            counts = mounted.turn.T @ vector / scale + self._rustle(noise / scale)
            data = self._packed(counts)
            memory[address : address + len(data)] = data
        return _OK, bytes(memory[block.address : block.end])

    def _rustle(self, counts: float) -> Array:
        """Draw noise of a standard deviation; below a count nothing would change."""
        least = 0.0 if self._as.format == "float32" else 1.0
        return self._random.normal(0.0, self.noise_factor * max(counts, least), 3)

    def _packed(self, counts: Array) -> bytes:
        if self._as.format == "float32":
            return struct.pack("<3f", *counts)
        whole = np.clip(np.round(counts), -_MOST_INT16, _MOST_INT16).astype(int)
        return struct.pack("<3h", *whole)
