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
        """Of the latest row."""

    def take(self, telemetry: Telemetry) -> int:
        """Take the next row; return how many are missing before it.

        Rows of a log from before they had numbers miss none. A loop that was started
        again counts from 1 again.
        """
        before, self.number = self.number, telemetry.number
        if before is None or not telemetry.number:
            return 0
        anew = telemetry.number <= before
        missing = telemetry.number - 1 - (0 if anew else before)
        if missing > 0:
            self.lost, self.gaps = self.lost + missing, self.gaps + 1
            missed_s = missing * telemetry.pace.period_s
            self.longest_s = max(self.longest_s, missed_s)
        return max(missing, 0)

    @property
    def in_words(self) -> str:
        """What is missing."""
        often = "one gap" if self.gaps == 1 else f"{self.gaps} gaps"
        return (
            f"{self.lost} rows of the loop are not in the log: {often}, "
            f"{self.longest_s:.1f} s at most"
        )
