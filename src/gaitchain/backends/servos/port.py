"""A serial port that the makes' SDKs can use in a control loop."""

import contextlib
import os
from importlib import import_module
from typing import Any

from gaitchain.backends.servos.stall_free import StallFreeClock
from gaitchain.errors import BackendError, needed_by

_SLICE_S = 0.001  # longest wait for bytes between two checks of the packet's timeout
# Longest time between two checks that counts; Windows wakes programs each 16 ms.
_COUNTED_S = 0.02 if os.name == "nt" else 2.0 * _SLICE_S
BITS = 10.0
"""Bits on the line for one byte, with start and stop bit."""


class ServoPort:
    """A replacement of the SDKs' `PortHandler`, with bounded waits.

    ROBOTIS' own class waits at least 34 ms, over three control periods, for each
    missing packet; polls the port in a busy loop, which occupies one core; uses the
    wall clock, which may jump and runs on while the computer is held up; and blocks
    forever on a port that accepts no bytes. The method names are those of the SDKs.
    """

    def __init__(self, name: str, baud: int, patience_s: float) -> None:
        """Open the port.

        Args:
            name: serial port, such as "/dev/ttyUSB0".
            baud: rate [bit/s].
            patience_s: longest silence before a packet, in addition to the
                transmission time of its bytes [s].

        Raises:
            BackendError: the port cannot be opened.
            MissingExtraError: pyserial is not installed.
        """
        self.is_using = False
        self.patience_s = patience_s
        self._baud = baud
        self.now = StallFreeClock(_COUNTED_S)
        """Clock of all waits for answers [s]."""
        self.late_bytes = 0
        """Number of discarded bytes."""
        self._start_s, self._timeout_s = 0.0, 0.0
        self._serial = _open(name, baud)

    @property
    def byte_s(self) -> float:
        """Transmission time of one byte [s]."""
        return BITS / self._baud

    def close(self) -> None:
        """Close the port; never raises."""
        with contextlib.suppress(OSError):
            self._serial.close()

    def clearPort(self) -> None:
        """Discard the received bytes, which came after their time; count them."""
        self.late_bytes += self._serial.in_waiting
        self._serial.reset_input_buffer()

    def readPort(self, length: int) -> bytes:
        """Return up to `length` received bytes, after at most a millisecond."""
        return bytes(self._serial.read(length)) if length > 0 else b""

    def writePort(self, packet: list[int]) -> int:
        """Send bytes without blocking; return how many were accepted."""
        if os.name == "nt":
            return int(self._serial.write(bytes(packet)))
        return os.write(self._serial.fileno(), bytes(packet))

    def getBaudRate(self) -> int:
        """Return the rate [bit/s]."""
        return self._baud

    def setPacketTimeout(self, packet_length: int) -> None:
        """Start the timeout for a packet of so many bytes."""
        self.wait_for(packet_length * self.byte_s + self.patience_s)

    def setPacketTimeoutMillis(self, msec: float) -> None:
        """Start a timeout [ms]."""
        self.wait_for(1e-3 * msec)

    def wait_for(self, timeout_s: float) -> None:
        """Start a timeout [s]."""
        self._start_s, self._timeout_s = self.now(), timeout_s

    def isPacketTimeout(self) -> bool:
        """Return whether the timeout has expired."""
        return self.now() - self._start_s > self._timeout_s


def _open(name: str, baud: int) -> Any:
    with needed_by("a servo bus"):
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
    # FTDI adapters buffer received bytes for 16 ms by default; other adapters, and some
    # systems, do not have this setting.
    with contextlib.suppress(AttributeError, NotImplementedError, OSError, ValueError):
        port.set_low_latency_mode(True)
    return port
