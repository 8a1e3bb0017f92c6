"""When to try again what has failed."""

import math

_FIRST_S, _LONGEST_S = 1.0, 10.0


class Retry:
    """Soon at first, then ever less often; it waits for nobody."""

    def __init__(self) -> None:
        """Have nothing to try."""
        self.over()

    def over(self) -> None:
        """Try no more: it was done, or is no longer wanted."""
        self._pause_s, self._due_s = 0.0, math.inf

    def failed(self, now_s: float) -> float:
        """Return after how long to try again [s].

        Args:
            now_s: when it failed [s].
        """
        self._pause_s = min(max(2.0 * self._pause_s, _FIRST_S), _LONGEST_S)
        self._due_s = now_s + self._pause_s
        return self._pause_s

    def due(self, now_s: float) -> bool:
        """Return whether to try now [s]."""
        return now_s >= self._due_s
