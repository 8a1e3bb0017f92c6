"""An emulated bus: servos and an IMU that answer on a pseudo-terminal."""

from gaitchain.backends.dynamixel.emulator.bus import EmulatedBus
from gaitchain.backends.dynamixel.emulator.devices import EmulatedImu, EmulatedServo
from gaitchain.backends.dynamixel.emulator.port import ServoBusEmulator

__all__ = ["EmulatedBus", "EmulatedImu", "EmulatedServo", "ServoBusEmulator"]
