"""The clock of the loop; tests bring their own."""

import time
from typing import Protocol


class Clock(Protocol):
    """Time that passes, and waiting for it."""

    def now(self) -> float:
        """Return the time since some beginning [s]."""

    def stamp_ns(self) -> int:
        """Return UNIX time [ns]."""

    def sleep_until(self, time_s: float) -> None:
        """Wait until `now` has reached a time; return at once if it has."""


class MonotonicClock:
    """The computer's clock, which never goes back."""

    def now(self) -> float:
        """Return the time since some beginning [s]."""
        return time.monotonic()

    def stamp_ns(self) -> int:
        """Return UNIX time [ns]."""
        return time.time_ns()

    def sleep_until(self, time_s: float) -> None:
        """Wait until `now` has reached a time; return at once if it has."""
        time.sleep(max(0.0, time_s - time.monotonic()))
