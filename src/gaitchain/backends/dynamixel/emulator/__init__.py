"""An emulated bus: servos and an IMU that answer on a pseudo-terminal."""

from gaitchain.backends.dynamixel.emulator.bus import EmulatedBus
from gaitchain.backends.dynamixel.emulator.imu import EmulatedImu
from gaitchain.backends.dynamixel.emulator.port import ServoBusEmulator
from gaitchain.backends.dynamixel.emulator.servo import EmulatedServo

__all__ = ["EmulatedBus", "EmulatedImu", "EmulatedServo", "ServoBusEmulator"]
