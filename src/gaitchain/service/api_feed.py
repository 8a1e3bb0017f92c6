"""The loop's latest telemetry for the HTTP API, read in one thread."""

import math
import threading
import time
from contextlib import closing
from pathlib import Path

import msgspec

from gaitchain.live.messages import Event, Recall, Telemetry
from gaitchain.service.channel import Asker, Listener
from gaitchain.service.fall_watch import FallWatch
from gaitchain.service.player_part import KEPT_EVENTS
from gaitchain.service.schemas import Fall, NumberedEvent

LOOP_SILENT = "the loop is silent: it is being restarted"
"""Why there is nothing to tell, and nobody to ask."""
LOOP_BEGINS = "the loop has said nothing yet: it is about to begin"
"""The same before its first row."""
_POLL_S = 0.2
_ASK_EVERY_S = 0.5  # for what was said before; a loop that ends takes a request with it
_HELD_S = 2.0  # events wait at most so long for those before them
_TRUTH_S = 0.1  # older than this, what the simulator knew is no picture of now


class Feed:
    """Reads telemetry from when it is started until it is closed."""

    def __init__(self, folder: Path, watch: FallWatch, silent_s: float) -> None:
        """Make it ready.

        Args:
            folder: of the channels.
            watch: what explains falls.
            silent_s: a loop without telemetry for so long is silent [s].
        """
        self._folder, self._watch, self._silent_s = folder, watch, silent_s
        self._newest: tuple[float, Telemetry] | None = None
        self.events: tuple[NumberedEvent, ...] = ()
        """The latest events, the newest last."""
        self._number = self._row = 0
        self._place: int | None = None  # which jump of a replay led here
        self._held: list[Event] = []
        self._missed_s: float | None = None  # since when some may have been missed
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._read, name="telemetry")

    def start(self) -> None:
        """Begin to read."""
        self._thread.start()

    def close(self) -> None:
        """End the thread."""
        self._ended.set()
        self._thread.join()
        self._watch.close()

    @property
    def latest(self) -> Telemetry | None:
        """The newest telemetry, None if the loop is silent.

        In simulation the newest with the simulator's truth: scenes with and without it
        differ.
        """
        newest = self._newest
        if newest is None or time.monotonic() - newest[0] > self._silent_s:
            return None
        return newest[1]

    @property
    def why_silent(self) -> str:
        """Why `latest` is None."""
        return LOOP_BEGINS if self._newest is None else LOOP_SILENT

    @property
    def fall(self) -> Fall | None:
        """The last fall."""
        return self._watch.latest

    def events_after(self, number: int) -> tuple[NumberedEvent, ...]:
        """Return the latest events with higher numbers.

        A number that is yet to come is one of a server before this one: all are new.
        """
        events = self.events
        if number > self._number:
            return events
        return tuple(event for event in events if event.number > number)

    @property
    def misses(self) -> bool:
        """Whether rows were lost whose events the loop has not repeated yet."""
        return self._missed_s is not None

    def _read(self) -> None:
        asked_s = -math.inf
        with (
            closing(Listener(self._folder)) as listener,
            closing(Asker(self._folder)) as asker,
        ):
            while not self._ended.is_set():
                try:
                    telemetry = listener.next(_POLL_S)
                except msgspec.DecodeError:  # of another version of this package
                    continue
                if telemetry is None:
                    self._give_out()
                    continue
                self.hear(telemetry)
                if self.misses and time.monotonic() - asked_s > _ASK_EVERY_S:
                    asked_s = time.monotonic()
                    asker.ask(Recall())

    def hear(self, telemetry: Telemetry) -> None:
        """Take the next row that came."""
        self._find_gap(telemetry)
        self._hold(telemetry)
        self._give_out()
        now, newest = time.monotonic(), self._newest
        shown = telemetry if newest is None else _better(newest[1], telemetry)
        if newest is not None and telemetry.leads:
            shown = newest[1]
        self._watch.take(telemetry)  # first: a frame of a fall has its own sentence
        self._newest = now, shown

    def _find_gap(self, telemetry: Telemetry) -> None:
        """See whether rows were lost, or a loop told nobody of its first."""
        follows = self._follows(telemetry)
        if telemetry.recalled is not None:
            self._missed_s = None
        elif not follows and not self.misses:
            self._missed_s = time.monotonic()

    def _follows(self, telemetry: Telemetry) -> bool:
        """Whether nothing happened between the row before and this one.

        Not all rows of a log come that is played fast, but all that have events do.
        """
        row, self._row = self._row, telemetry.number
        replay, place = telemetry.replay, self._place
        self._place = None if replay is None else replay.jumps
        if replay is None:
            return telemetry.number == row + 1
        if replay.jumps != place:
            self.events = ()  # of elsewhere in the log
            self._held.clear()
        return replay.jumps == place

    def _hold(self, telemetry: Telemetry) -> None:
        if telemetry.recalled:
            known = {_key(e) for e in self.events} | {_key(e) for e in self._held}
            self._held += (e for e in telemetry.recalled if _key(e) not in known)
        self._held += telemetry.events

    def _give_out(self) -> None:
        """Number what happened, unless what happened before it is still to come."""
        missed_s = self._missed_s
        if missed_s is not None and time.monotonic() - missed_s < _HELD_S:
            return
        for event in sorted(self._held, key=lambda event: event.stamp_ns):
            self._note(event)
        self._held.clear()

    def _note(self, event: Event) -> None:
        self._number += 1
        noted = NumberedEvent(
            self._number, event.time_s, event.stamp_ns, event.kind, event.text
        )
        # A new tuple each time: others read it while this thread goes on.
        self.events = (*self.events[1 - KEPT_EVENTS :], noted)


def _key(event: Event | NumberedEvent) -> tuple[int, str]:
    """Return what tells events apart; each loop's own clock begins at 0."""
    return event.stamp_ns, event.text


def _better(before: Telemetry, now: Telemetry) -> Telemetry:
    """Return the newer one, unless only the other has the simulator's truth."""
    if now.truth is not None or before.truth is None:
        return now
    if now.replay is not None and not now.replay.playing:
        return now  # no other one follows
    return before if 0.0 <= now.time_s - before.time_s < _TRUTH_S else now
