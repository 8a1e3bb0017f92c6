"""An emulated IMU on the servos' bus."""

import struct

import numpy as np

from gaitchain.backends.servos.calibration import ImuCalibration
from gaitchain.backends.servos.table import Block
from gaitchain.messages import GRAVITY, Array

_OK, _ACCESS = 0, 7  # error codes of protocol 2.0
_SIZE = 1100  # bytes of the table
_MOST_INT16 = 2**15 - 1


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
        self.noise = 0.0
        """Standard deviation of what it measures [counts]."""
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
        for address, scale, vector in (
            (mounted.gyro, mounted.gyro_scale, self.angular_velocity),
            (mounted.accelerometer, mounted.accelerometer_scale, self.acceleration),
        ):
            counts = mounted.turn.T @ vector / scale
            data = self._packed(counts + self._random.normal(0.0, self.noise, 3))
            memory[address : address + len(data)] = data
        return _OK, bytes(memory[block.address : block.end])

    def _packed(self, counts: Array) -> bytes:
        if self._as.format == "float32":
            return struct.pack("<3f", *counts)
        whole = np.clip(np.round(counts), -_MOST_INT16, _MOST_INT16).astype(int)
        return struct.pack("<3h", *whole)
