"""An emulated bus: servos and an IMU that answer on a pseudo-terminal."""

from gaitchain.backends.servos.emulator.bus import EmulatedBus
from gaitchain.backends.servos.emulator.imu import EmulatedImu
from gaitchain.backends.servos.emulator.port import ServoBusEmulator

__all__ = ["EmulatedBus", "EmulatedImu", "ServoBusEmulator"]
