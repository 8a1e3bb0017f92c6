"""The clock of the loop, the rate that is kept by it, and what is due by its rows."""

import math
import time
from collections import deque

import numpy as np

from gaitchain.live.messages import Pace

_WINDOW = 1000  # ticks that the percentiles are of
_GIVE_UP = 3  # periods behind: those ticks are left out, not caught up with
_SUMMED_UP_EVERY = 50  # ticks


class Clock:
    """The computer's clock, which never goes back; tests bring their own."""

    def now(self) -> float:
        """Return the time since some beginning [s]."""
        return time.monotonic()

    def stamp_ns(self) -> int:
        """Return UNIX time [ns]."""
        return time.time_ns()

    def sleep_until(self, time_s: float) -> None:
        """Wait until `now` has reached a time; return at once if it has."""
        time.sleep(max(0.0, time_s - time.monotonic()))


class Pacer:
    """Begin a tick each period."""

    def __init__(self, clock: Clock, period_s: float) -> None:
        """Begin now.

        Args:
            clock: the loop's.
            period_s: between two ticks [s].
        """
        self._clock, self.period_s = clock, period_s
        self._due = self._began = clock.now()
        self._ticks = self._overruns = 0
        self._begins: deque[float] = deque(maxlen=_WINDOW)
        self._late: deque[float] = deque(maxlen=_WINDOW)
        self._busy: deque[float] = deque(maxlen=_WINDOW)
        self._late_max = 0.0
        self._pace = Pace(period_s, 0, 0, 0.0, 0.0, 0.0)

    def wait(self) -> float:
        """Wait for the next tick.

        Returns:
            How late it begins; a clock that went back is not late [s].
        """
        now = self._clock.now()
        self._busy.append(max(0.0, now - self._began))
        if now > self._due and self._ticks:
            self._overruns += 1
        elif self._due - now > 2.0 * self.period_s:
            self._due = now  # the clock went back
        self._clock.sleep_until(self._due)
        self._began = self._clock.now()
        late = max(0.0, self._began - self._due)
        self._begins.append(self._began)
        self._late.append(late)
        self._late_max = max(self._late_max, late)
        self._ticks += 1
        behind = late > _GIVE_UP * self.period_s
        self._due = (self._began if behind else self._due) + self.period_s
        return late

    @property
    def pace(self) -> Pace:
        """How well the rate was kept; percentiles are renewed every 50 ticks."""
        if self._ticks % _SUMMED_UP_EVERY == 1 or not self._pace.ticks:
            self._pace = Pace(
                self.period_s,
                self._ticks,
                self._overruns,
                float(np.percentile(self._late, 99)) if self._late else 0.0,
                self._late_max,
                float(np.percentile(self._busy, 99)) if self._busy else 0.0,
                self._rate_hz,
            )
        return self._pace

    @property
    def _rate_hz(self) -> float | None:
        """Ticks a second over the window, None where that says nothing."""
        lasted_s = self._begins[-1] - self._begins[0] if self._begins else 0.0
        return (len(self._begins) - 1) / lasted_s if lasted_s > 0.0 else None


class Beat:
    """Says when something is due again, on a clock that may jump or run backward."""

    def __init__(self, period_s: float) -> None:
        """Let the first row be due.

        Args:
            period_s: mean time between two that are [s].
        """
        self._period_s, self._next_s = period_s, -math.inf

    def due(self, now_s: float) -> bool:
        """Return whether it is; a row may come a quarter of the period early.

        Args:
            now_s: time of the row [s].
        """
        period_s, ahead_s = self._period_s, self._next_s - now_s
        if 0.25 * period_s < ahead_s <= 1.5 * period_s:
            return False
        on_beat = -period_s < ahead_s <= 0.25 * period_s
        self._next_s = (self._next_s if on_beat else now_s) + period_s
        return True
