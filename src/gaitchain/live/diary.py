"""Events between two telemetries, each with its time."""

from gaitchain.live.clock import Clock
from gaitchain.live.messages import Event

_MOST = 20  # in one control period; a flood is cut short


class Diary:
    """Collects what happens until it is told on."""

    def __init__(self, clock: Clock) -> None:
        """Begin now."""
        self._clock, self._began_s = clock, clock.now()
        self._events: list[Event] = []

    def time_s(self) -> float:
        """Return the time since the beginning [s]."""
        return self._clock.now() - self._began_s

    def tell(self, kind: str, text: str) -> None:
        """Note an event of a kind (`messages.Event.kind`)."""
        if len(self._events) < _MOST:
            event = Event(self.time_s(), self._clock.stamp_ns(), kind, text)
            self._events.append(event)

    def take(self) -> tuple[Event, ...]:
        """Return the events since the last call."""
        events, self._events = tuple(self._events), []
        return events
