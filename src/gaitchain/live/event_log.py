"""Events between two telemetries, each with its time."""

from collections import deque

from gaitchain.live.clock import Clock
from gaitchain.live.messages import Event

_KEPT = 100
_MOST = 20  # in one control period; a flood is cut short
_REFUSALS_S, _SAME_REFUSAL_S = 1.0, 10.0  # least times between two, and two alike


class EventLog:
    """Collects what happens until the next telemetry takes it."""

    def __init__(self, clock: Clock) -> None:
        """Begin now."""
        self._clock, self._began_s = clock, clock.now()
        self._events: list[Event] = []
        self._past: deque[Event] = deque(maxlen=_KEPT)
        self._asked = False
        self._refused, self._refused_s = "", -_SAME_REFUSAL_S

    def time_s(self) -> float:
        """Return the time since the beginning [s]."""
        return self._clock.now() - self._began_s

    def stamp_ns(self) -> int:
        """Return UNIX time [ns]."""
        return self._clock.stamp_ns()

    def add(self, kind: str, text: str) -> None:
        """Note an event of a kind (`messages.Event.kind`)."""
        if len(self._events) < _MOST:
            event = Event(self.time_s(), self.stamp_ns(), kind, text)
            self._events.append(event)

    def add_refusal(self, text: str) -> None:
        """Note a request that is not carried out, and why; a few of many alike."""
        now_s = self.time_s()
        pause_s = _SAME_REFUSAL_S if text == self._refused else _REFUSALS_S
        if now_s - self._refused_s >= pause_s:
            self._refused, self._refused_s = text, now_s
            self.add("command", text)

    def take(self) -> tuple[Event, ...]:
        """Return the events since the last call."""
        events, self._events = tuple(self._events), []
        self._past += events
        return events

    def recall(self) -> None:
        """Let `recalled` give the latest events once."""
        self._asked = True

    def recalled(self) -> tuple[Event, ...]:
        """Return the latest 100 events if somebody asked since the last call."""
        asked, self._asked = self._asked, False
        return tuple(self._past) if asked else ()
