"""An emulated IMU on the servos' bus."""

import struct

import numpy as np

from gaitchain.backends.dynamixel.calibration import ImuCalibration
from gaitchain.backends.dynamixel.control_table import Block
from gaitchain.backends.dynamixel.emulator.servo import ACCESS, OK
from gaitchain.messages import GRAVITY, Array

_SIZE = 1100  # bytes of the table
_MOST = 2**15 - 1


class EmulatedImu:
    """A gyro and an accelerometer, mounted as in a calibration."""

    alert, status_level = 0, 2
    ping_data = (0x7400).to_bytes(2, "little") + b"\x05"

    def __init__(self, calibration: ImuCalibration) -> None:
        """Start upright and at rest."""
        self.number = calibration.id
        self.angular_velocity: Array = np.zeros(3)
        """(3,) angular velocity in the trunk's frame [rad/s]."""
        self.acceleration: Array = np.array([0.0, 0.0, GRAVITY])
        """(3,) acceleration with gravity in the trunk's frame [m/s^2]."""
        self._as = calibration

    def hear(self, now: float) -> None:
        """Do nothing: the IMU has no watchdog."""

    def reboot(self) -> None:
        """Do nothing: the IMU has no state to reset."""

    def write(self, address: int, data: bytes) -> int:
        """Return an access error: the table is read-only."""
        return ACCESS

    def read(self, block: Block) -> tuple[int, bytes]:
        """Return the error and a block of the table."""
        table, mounted = bytearray(_SIZE), self._as
        if block.end > _SIZE:
            return ACCESS, b""
        for address, scale, vector in (
            (mounted.gyro, mounted.gyro_scale, self.angular_velocity),
            (mounted.accelerometer, mounted.accelerometer_scale, self.acceleration),
        ):
            data = self._packed(mounted.turn.T @ vector / scale)
            table[address : address + len(data)] = data
        return OK, bytes(table[block.address : block.end])

    def _packed(self, counts: Array) -> bytes:
        if self._as.format == "float32":
            return struct.pack("<3f", *counts)
        whole = np.clip(np.round(counts), -_MOST, _MOST).astype(int)
        return struct.pack("<3h", *whole)
