"""A serial port that the DYNAMIXEL SDK's packet handler can use in a control loop."""

import contextlib
import os
import time
from importlib import import_module
from typing import Any

from gaitchain.errors import BackendError, needed_by

_SLICE_S = 0.001  # longest wait for bytes before the packet's own time is looked at
BITS = 10.0
"""Bits that one byte takes on the line."""


class ServoPort:
    """What the SDK's packet handler asks of its `PortHandler`, with bounded waits.

    The SDK's own waits 34 ms and more for each packet that does not come, which is
    three control periods; it asks the port for bytes without a pause, so that one core
    does nothing else; it measures by the wall clock, which may jump; and it waits
    without end for a port that takes no bytes. Hence this one in its place; its names
    are the SDK's.
    """

    def __init__(self, name: str, baud: int, patience_s: float) -> None:
        """Open the port.

        Args:
            name: such as "/dev/ttyUSB0".
            baud: [bit/s]
            patience_s: longest silence before a packet, beyond what its bytes take.

        Raises:
            BackendError: the port cannot be opened.
            MissingExtraError: the SDK is not installed.
        """
        self.is_using = False
        self.patience_s = patience_s
        self._baud = baud
        self._start_s, self._timeout_s = 0.0, 0.0
        self._serial = _open(name, baud)

    @property
    def byte_s(self) -> float:
        """Time that a byte takes on the line [s]."""
        return BITS / self._baud

    def close(self) -> None:
        """Close it; never raises."""
        with contextlib.suppress(OSError):
            self._serial.close()

    def clearPort(self) -> None:
        """Drop what has arrived."""
        self._serial.reset_input_buffer()

    def readPort(self, length: int) -> bytes:
        """Return up to `length` bytes, after a millisecond at most."""
        return bytes(self._serial.read(length)) if length > 0 else b""

    def writePort(self, packet: list[int]) -> int:
        """Send bytes; return how many the system takes at once."""
        if os.name == "nt":
            return int(self._serial.write(bytes(packet)))
        return os.write(self._serial.fileno(), bytes(packet))

    def getBaudRate(self) -> int:
        """Return the rate [bit/s]."""
        return self._baud

    def setPacketTimeout(self, packet_length: int) -> None:
        """Wait from now on for a packet of so many bytes."""
        self.wait_for(packet_length * self.byte_s + self.patience_s)

    def setPacketTimeoutMillis(self, msec: float) -> None:
        """Wait from now on for so long [ms]."""
        self.wait_for(1e-3 * msec)

    def wait_for(self, timeout_s: float) -> None:
        """Wait from now on for so long [s]."""
        self._start_s, self._timeout_s = time.monotonic(), timeout_s

    def isPacketTimeout(self) -> bool:
        """Return whether the packet's time is over."""
        return time.monotonic() - self._start_s > self._timeout_s


def sdk() -> Any:
    """Return the DYNAMIXEL SDK.

    Raises:
        MissingExtraError: it is not installed.
    """
    with needed_by("a DYNAMIXEL servo"):
        return import_module("dynamixel_sdk")


def _open(name: str, baud: int) -> Any:
    sdk()  # which brings pyserial
    serial = import_module("serial")
    try:
        port = serial.Serial(
            name, baud, timeout=_SLICE_S, write_timeout=1.0, exclusive=True
        )
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise BackendError(
            f"{name}: cannot be opened at {baud} bit/s: {reason}; check its name (`ls "
            "/dev/ttyUSB*`), your rights (group dialout), and that no other program "
            "has it"
        ) from None
    # FTDI adapters keep bytes back for 16 ms by default; others, and systems where
    # this is unknown, have no such setting.
    with contextlib.suppress(AttributeError, NotImplementedError, OSError, ValueError):
        port.set_low_latency_mode(True)
    return port
