"""Find the cause of a fall from the telemetry of the last seconds."""

import logging
import math
from collections import deque
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

from gaitchain.analysis.fall_cause import DISTURBED_S, Explanation, explain
from gaitchain.analysis.rules import Finding
from gaitchain.errors import GaitchainError
from gaitchain.gait.library import GaitLibrary
from gaitchain.live.messages import Telemetry
from gaitchain.live.telemetry_record import before_fall, record_of
from gaitchain.service.player_part import LED_S
from gaitchain.service.schemas import Cause, Fall

_FIRST_ROWS = 250  # of a loop, of which some pass before there is anybody to see them
_LOG = logging.getLogger(__name__)


class FallWatch:
    """Keeps the last seconds of telemetry, and explains falls in its own thread."""

    def __init__(self, library: GaitLibrary) -> None:
        """Take the robot and the planned times of its steps."""
        self._library = library
        self._kept: deque[Telemetry] = deque()
        self._worker = ThreadPoolExecutor(1, "fall")
        self._down = False
        self._place: int | None = None  # which jump of a replay led here
        self.latest: Fall | None = None
        """The last fall up to now; its cause follows, a moment later."""

    def take(self, telemetry: Telemetry) -> None:
        """Take the next telemetry of the loop."""
        kept = self._kept
        if self._jumps(telemetry):
            kept.clear()
            self._down, self.latest = False, None
        if kept and telemetry.time_s == kept[-1].time_s:
            return  # a replay that is paused
        if kept and telemetry.time_s < kept[-1].time_s:
            kept.clear()  # the loop has begun anew
        # Also of a loop that was started again, where the robot stays stopped.
        was_down, self._down = self._down, telemetry.down
        kept.append(telemetry)
        while kept[0].time_s < telemetry.time_s - LED_S:
            kept.popleft()
        if telemetry.fell and not was_down:
            self._begin(telemetry)
        elif self._down and not was_down:
            self.latest = None  # it gets up from a fall that was not seen

    def _begin(self, fall: Telemetry) -> None:
        """Tell of a new fall, and have its cause looked for if anything is known."""
        known = len(self._kept) > 1
        more = (
            "Its cause is being looked for" if known else "What led to it was not seen"
        )
        sentence = f"{_told(fall)} {more}."
        self.latest = Fall(sentence, fall.time_s, fall.stamp_ns, None)
        if known:
            self._worker.submit(self._explain, tuple(self._kept))

    def _jumps(self, telemetry: Telemetry) -> bool:
        """Whether a replay goes on elsewhere in its log.

        Its player tells: a loop that began anew goes on where it was, and the robot
        lies there with the fall that it remembers.
        """
        replay, before = telemetry.replay, self._place
        self._place = None if replay is None else replay.jumps
        return None not in (self._place, before) and self._place != before

    def close(self) -> None:
        """End the thread; what it is at is finished, what waits is not."""
        self._worker.shutdown(wait=True, cancel_futures=True)

    def _explain(self, telemetries: tuple[Telemetry, ...]) -> None:
        last = telemetries[-1]
        sentence, cause = _told(last), None
        try:
            library = self._library
            robot, gait = library.robot, library.family.name
            rows = before_fall(telemetries)
            record = record_of(robot, rows, library.timing, since_s=0.0, gait=gait)
            unseen = _unseen(telemetries)
            found = replace(explain(robot, record), whole=not unseen)
            sentence, cause = f"{found.sentence}{unseen}", _cause(found)
        except GaitchainError as error:
            sentence = f"{sentence} Its cause is not known: {error}."
        except Exception:  # a thread's error would be lost
            _LOG.exception("the cause of a fall")
        now = self.latest
        if now is not None and now.stamp_ns == last.stamp_ns:  # it has not fallen again
            self.latest = Fall(sentence, last.time_s, last.stamp_ns, cause)


def _told(telemetry: Telemetry) -> str:
    """Say what the loop knows of a fall; not of each it says that the robot fell."""
    reason = telemetry.reason
    what = reason if reason.startswith("fell") else f"lies there: {reason}"
    return f"The robot {what}."


def _unseen(telemetries: Sequence[Telemetry]) -> str:
    """Say where what led to a fall was hardly seen; "" where it was.

    As in a replay that was sought to just before it, or that begins with a file whose
    beginning was dropped, and when the API was started while the robot walked.
    """
    first, fall = telemetries[0], telemetries[-1]
    seen_s = fall.time_s - first.time_s
    if seen_s >= DISTURBED_S or first.number <= _FIRST_ROWS:
        return ""
    return (
        f" Only the last {seen_s:.2f} s before it were seen, and the cause may be "
        "in those before."
    )


def _cause(found: Explanation) -> Cause | None:
    first: Finding | None = found.cause
    if first is None:
        return None
    return Cause(
        rule=first.what,
        time_s=first.time_s,
        amount=_known(first.amount),
        limit=_known(first.limit),
        unit=first.unit,
        advice=first.advice,
    )


def _known(number: float) -> float | None:
    return number if math.isfinite(number) else None
