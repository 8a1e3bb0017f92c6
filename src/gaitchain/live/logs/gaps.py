"""Rows of the loop that a log does not have, found by their numbers."""

from gaitchain.live.messages import Telemetry


class Gaps:
    """Counts what is missing between the rows that come."""

    def __init__(self) -> None:
        """Nothing has come."""
        self.lost = self.gaps = 0
        """Rows that are missing, and how often some are."""
        self.longest_s = 0.0
        self._number, self._time_s = 0, 0.0

    def take(self, telemetry: Telemetry) -> int:
        """Take the next row; return how many are missing before it.

        Rows of a log from before they had numbers miss none, and a loop that was
        started again counts from 1 again.
        """
        number, time_s = telemetry.number, telemetry.time_s
        missing = number - self._number - 1 if self._number and number else 0
        if missing > 0:
            self.lost, self.gaps = self.lost + missing, self.gaps + 1
            self.longest_s = max(self.longest_s, time_s - self._time_s)
        self._number, self._time_s = number, time_s
        return max(missing, 0)

    @property
    def in_words(self) -> str:
        """What is missing."""
        often = "one gap" if self.gaps == 1 else f"{self.gaps} gaps"
        return (
            f"{self.lost} rows of the loop are not in the log: {often}, "
            f"{self.longest_s:.1f} s at most"
        )
