"""Rows of the loop that a log does not have, found by their numbers."""

from gaitchain.live.messages import Telemetry


class Gaps:
    """Counts what is missing between the rows that come."""

    def __init__(self, after: int | None = 0) -> None:
        """Nothing has come.

        Args:
            after: number of the row before the first one that comes, 0 where the loop's
                first is to come; None where nobody knows, and that one misses none.
        """
        self.lost = self.gaps = 0
        """Rows that are missing, and how often some are."""
        self.longest_s = 0.0
        self.number = after
        """Of the latest row that is in the log."""
        self._heard = after  # of the latest row at all
        self.keep()

    def take(self, telemetry: Telemetry) -> None:
        """Take the next row of the log, and count what is missing before it.

        Rows of a log from before they had numbers miss none. A loop that was started
        again counts from 1 again.
        """
        self.pass_over(telemetry)
        self._count(telemetry.number - 1 - (self.number or 0), telemetry)
        self.number = telemetry.number

    def pass_over(self, telemetry: Telemetry) -> None:
        """Note a row that is not put in the log; it is counted with the next one."""
        heard, self._heard = self._heard, telemetry.number
        if heard is None or self.number is None:
            self.number = max(telemetry.number - 1, 0)
        elif telemetry.number <= heard:
            # Of another loop: how far the one before came is not known later on.
            self._count(heard - self.number, telemetry)
            self.number = 0

    def keep(self) -> None:
        """Note that all rows taken so far are on the disk."""
        self._kept = self.lost, self.gaps, self.longest_s, self.number

    def drop(self) -> None:
        """Go back to the last `keep`: rows taken since then are not in the log."""
        taken = self.number
        self.lost, self.gaps, self.longest_s, self.number = self._kept
        if taken is not None and self.number is not None and taken < self.number:
            self.number = 0  # of another loop

    @property
    def lost_since_kept(self) -> int:
        """How many rows are missing since the last `keep`."""
        return self.lost - self._kept[0]

    @property
    def in_words(self) -> str:
        """What is missing."""
        often = "one gap" if self.gaps == 1 else f"{self.gaps} gaps"
        return f"{rows_missing(self.lost)}: {often}, {self.longest_s:.1f} s at most"

    def _count(self, missing: int, telemetry: Telemetry) -> None:
        if missing > 0:
            self.lost, self.gaps = self.lost + missing, self.gaps + 1
            missed_s = missing * telemetry.pace.period_s
            self.longest_s = max(self.longest_s, missed_s)


def rows_missing(count: int) -> str:
    """Return in words how many rows a log does not have."""
    rows = "1 row of the loop is" if count == 1 else f"{count} rows of the loop are"
    return f"{rows} not in the log"
