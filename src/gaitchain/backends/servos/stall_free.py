"""Time that leaves out how long the computer stood still."""

import time
from collections.abc import Callable


class StallFreeClock:
    """A clock that goes on by a little at most between two looks.

    A busy computer may hold a program up for longer than a servo takes to answer. Such
    time is no silence of the servo: the program did not listen. A wait looks at the
    clock more often than `most_s`, so that a wait without a stall keeps its length.
    """

    def __init__(
        self, most_s: float, clock: Callable[[], float] = time.monotonic
    ) -> None:
        """Begin at zero.

        Args:
            most_s: between two looks [s].
            clock: the computer's [s].
        """
        self._most_s, self._clock = most_s, clock
        self._seen_s, self._now_s = clock(), 0.0

    def __call__(self) -> float:
        """Return the time [s]."""
        seen_s = self._clock()
        self._now_s += min(seen_s - self._seen_s, self._most_s)
        self._seen_s = seen_s
        return self._now_s
