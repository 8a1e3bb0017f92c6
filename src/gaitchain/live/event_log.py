"""Events between two telemetries, each with its time.

What goes on for a while, such as a link that is lost, is two events: its beginning, and
its end with how often it was found. A text may have other numbers each time.
"""

import math
import re
from collections import deque
from dataclasses import dataclass

from gaitchain.live.clock import Clock
from gaitchain.live.messages import Event

_KEPT = 100
_MOST = 20  # in one control period beside changes of mode; a flood is cut short
_ANSWERS = 8  # refusals in one control period
_SAME_REFUSAL_S = 10.0  # least time between two refusals alike
_REFUSALS, _REFUSALS_S = 5, 1.0  # so many others at once, then one in so long [s]
_REFUSED = 32  # texts of refusals that are kept
_OVER_S = 1.0  # what has not been found for so long is over
_SPELLS = 32  # at once; more and the oldest one ends
_AMOUNT = re.compile(r"\d+\.\d+|\d+(?= (?:s|ms|deg|%|A|V|N m|N|m|packets|times)\b)")


@dataclass
class _Spell:
    kind: str
    text: str
    began_s: float
    last_s: float
    count: int = 1


class EventLog:
    """Collects what happens until the next telemetry takes it."""

    def __init__(self, clock: Clock) -> None:
        """Begin now."""
        self._clock, self._began_s = clock, clock.now()
        self._events: list[Event] = []
        self._past: deque[Event] = deque(maxlen=_KEPT)
        self._spells: dict[tuple[str, str], _Spell] = {}
        self._asked = False
        self._refused: dict[str, float] = {}  # when each was told last, oldest first
        self._refusals_s = -math.inf  # each refusal is told at the cost of some time
        self._now_refused: list[str] = []

    def time_s(self) -> float:
        """Return the time since the beginning [s]."""
        return self._clock.now() - self._began_s

    def stamp_ns(self) -> int:
        """Return UNIX time [ns]."""
        return self._clock.stamp_ns()

    def add(self, kind: str, text: str) -> None:
        """Note an event of a kind (`messages.Event.kind`)."""
        others = sum(event.kind != "mode" for event in self._events)
        if kind == "mode" or others < _MOST:
            event = Event(self.time_s(), self.stamp_ns(), kind, text)
            self._events.append(event)

    def add_spell(self, kind: str, text: str) -> None:
        """Note what is found again and again: its beginning, and later its end.

        Args:
            kind: as of `add`.
            text: other amounts in it make it no other event.
        """
        key, now_s = (kind, _AMOUNT.sub("#", text)), self.time_s()
        spell = self._spells.get(key)
        if spell is None:
            if len(self._spells) >= _SPELLS:
                self._end(next(iter(self._spells)))
            self._spells[key] = _Spell(kind, text, now_s, now_s)
            self.add(kind, text)
            return
        spell.text, spell.last_s, spell.count = text, now_s, spell.count + 1

    def _end_spells(self) -> None:
        now_s = self.time_s()
        for key in [k for k, s in self._spells.items() if now_s - s.last_s > _OVER_S]:
            self._end(key)

    def _end(self, key: tuple[str, str]) -> None:
        spell = self._spells.pop(key)
        if spell.count > 1:
            lasted_s = spell.last_s - spell.began_s
            how_often = f"{spell.count} times in {lasted_s:.2f} s"
            self.add(spell.kind, f"over, {how_often}: {spell.text}")

    def add_refusal(self, text: str) -> None:
        """Note a request that is not carried out, and why; a few of many alike."""
        if len(self._now_refused) < _ANSWERS:
            self._now_refused.append(text)
        now_s = self.time_s()
        if now_s - self._refused.get(text, -math.inf) < _SAME_REFUSAL_S:
            return
        spent_s = max(self._refusals_s, now_s - _REFUSALS * _REFUSALS_S) + _REFUSALS_S
        if spent_s > now_s:
            return  # names in the texts are free, so all may differ
        self._refusals_s = spent_s
        self._refused.pop(text, None)
        self._refused[text] = now_s
        if len(self._refused) > _REFUSED:
            del self._refused[next(iter(self._refused))]
        self.add("command", text)

    def take(self) -> tuple[Event, ...]:
        """Return the events since the last call."""
        self._end_spells()
        events, self._events = tuple(self._events), []
        self._past += events
        return events

    def take_refused(self) -> tuple[str, ...]:
        """Return what was refused since the last call, for whoever asked for it."""
        refused, self._now_refused = tuple(self._now_refused), []
        return refused

    def recall(self) -> None:
        """Let `recalled` give the latest events once."""
        self._asked = True

    def recalled(self) -> tuple[Event, ...] | None:
        """Return the latest 100 events; None if nobody asked since the last call."""
        asked, self._asked = self._asked, False
        return tuple(self._past) if asked else None
