"""The falls in a log, and what led to each of them."""

from collections import deque
from collections.abc import Iterable

from gaitchain.errors import CommandError
from gaitchain.live.messages import Telemetry

LONGEST_S = 60.0
"""So much before a fall is looked at [s]."""


def before_fall(
    telemetries: Iterable[Telemetry], number: int | None = None
) -> tuple[Telemetry, ...]:
    """Return the rows that led to a fall, at most the last minute of them.

    They begin after the fall before, or where the loop was started again.

    Args:
        telemetries: of a log, in order.
        number: of the fall, 1 for the first; the last one by default.

    Returns:
        The rows, the last one that of the fall; the log's last minute if the robot
        never fell.

    Raises:
        CommandError: there is no fall of this number.
    """
    kept: deque[Telemetry] = deque()
    found: tuple[Telemetry, ...] = ()
    falls, down = 0, False
    for t in telemetries:
        was_down, down = down, t.fell
        if was_down and down:
            continue
        if kept and (was_down or not t.time_s > kept[-1].time_s):
            kept.clear()
        kept.append(t)
        while kept[0].time_s < t.time_s - LONGEST_S:
            kept.popleft()
        if down:
            falls, found = falls + 1, tuple(kept)
            if falls == number:
                return found
    if number is not None:
        often = {0: "no fall", 1: "one fall"}.get(falls, f"{falls} falls")
        raise CommandError(f"--fall {number}: the log has {often}")
    return found or tuple(kept)
