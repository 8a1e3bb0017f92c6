"""Emulated X-series servos."""

from gaitchain.backends.dynamixel.emulator.bus import EmulatedXSeriesBus
from gaitchain.backends.dynamixel.emulator.servo import EmulatedXSeries
from gaitchain.backends.servos.emulator.port import Kinds

KINDS = Kinds(EmulatedXSeries, EmulatedXSeriesBus)

__all__ = ["KINDS", "EmulatedXSeries", "EmulatedXSeriesBus"]
