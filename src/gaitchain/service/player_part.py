"""Play a log in place of the loop: the same telemetry at the same rate, or another."""

import threading
import time
from array import array
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterator
from contextlib import closing
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING

from msgspec import UNSET
from msgspec.structs import replace

from gaitchain.errors import CommandError, LogError
from gaitchain.live.logs.reader import Log, read_log
from gaitchain.live.messages import (
    EmergencyStop,
    Event,
    Note,
    Play,
    Recall,
    ReplayState,
    Request,
    Reset,
    Shutdown,
    Start,
    Stop,
    Telemetry,
)
from gaitchain.service.channel import LoopEnd
from gaitchain.service.pulse import Pulse
from gaitchain.service.settings import load_settings

if TYPE_CHECKING:
    from gaitchain.live.loop import LoopPort

KEPT_EVENTS = 200
"""The latest events that are kept, and told again where a log is sought."""
LED_S = 12.0
"""So much of what led to a fall is kept to explain it [s]."""
_SILENCE_S = 1.0  # longest one of a log that is played; what is longer is cut to it
_STILL_S = 0.04  # between rows while it is paused
_LAG_S = 0.2  # a player that is later does not catch up
_LOOK_S = 0.01  # requests are answered within this
_LED_AT_ONCE, _LEAD_S = 5, 0.001  # rows in so long: faster, some would be lost
_AT_ONCE = 250  # rows that are measured between two looks at requests
_SHOWN_S = 0.02  # rows that are played faster than so are not all shown


class Player:
    """A log that plays, pauses and begins again as it is asked to."""

    def __init__(
        self,
        log: Log,
        port: "LoopPort",
        now: Callable[[], float] = time.monotonic,
        *,
        say: Callable[[str], None] = lambda _doing: None,
        playing: bool = True,
    ) -> None:
        """Begin to play.

        Args:
            log: what to play.
            port: requests and telemetry; asked while the log is measured, too.
            now: a clock [s].
            say: told what it does before there is telemetry.
            playing: whether it plays at once, or waits at its beginning.

        Raises:
            LogError: there is no telemetry in the log.
        """
        self._log, self._port, self._say, self._now = log, port, say, now
        self._notes: list[Note] = []
        self._playing, self._due_s, self._speed = playing, now(), 1.0
        self._sought: int | None = None
        self._rows: Iterator[Telemetry] = iter(())
        self._happened: list[tuple[int, Event]] = []  # with the number of the row
        # From which row on the robot lies there, or does not, and whether it fell then.
        self._spells: list[tuple[int, bool]] = []
        self._led = range(0)  # rows that led to a fall, to be passed on by a seek
        self._jumps = 0
        self.ended = False
        """Whether a shutdown was asked for."""
        self._times = self._measured()
        self._rewind()

    def wait_s(self) -> float:
        """Return how long nothing is to be done, 10 ms at most [s]."""
        if self._sought is not None:
            return _LEAD_S if self._leads else 0.0
        return min(max(self._due_s - self._now(), 0.0), _LOOK_S)

    def tick(self) -> None:
        """Answer requests, and publish the row that is due."""
        for request in self._port.requests():
            self._handle(request)
        self._skip()
        if self._leads:
            return  # nothing else may come between these rows
        now_s = self._now()
        if now_s < self._due_s:
            return
        self._publish(passes=self._playing and self._sought is None)
        if self._playing and self._sought is None:
            self._advance(now_s)
        else:
            self._due_s = now_s + _STILL_S

    def _handle(self, request: Request) -> None:
        match request:
            case Start():
                if self._over:
                    self._rewind()
                self._playing, self._due_s = True, self._now()
            case Stop() | EmergencyStop():
                self._playing = False
            case Reset():
                self._rewind()
            case Play():
                self._play(request)
            case Note():
                self._notes.append(request)
            case Recall():
                self._recalls = True
            case Shutdown():
                self.ended = True
            case _:
                pass  # nobody drives a log

    def _play(self, wanted: Play) -> None:
        """Go elsewhere, at another speed, on or not."""
        self._due_s = self._now()
        if wanted.speed is not UNSET:
            self._speed = wanted.speed
        if wanted.at_s is not UNSET:
            self._seek(wanted.at_s)
        if wanted.playing is not UNSET:
            if wanted.playing and self._over:
                self._rewind()
            self._playing = wanted.playing

    def _seek(self, at_s: float) -> None:
        """Go to the last row that is not later, from where its chunk begins.

        Where the robot lies there since a fall, from before that, as nobody could tell
        its cause otherwise.
        """
        self._sought = max(bisect_right(self._times, at_s) - 1, 0)
        self._led = self._led_to(self._sought)
        mark = self._log.mark(self._led.start if self._led else self._sought)
        self._rows, self._passed = self._log.telemetries(mark), mark.rows
        self._over = False

    def _led_to(self, row: int) -> range:
        """Return the rows up to the fall since which the robot lies there, if any."""
        spell = bisect_right(self._spells, row, key=itemgetter(0)) - 1
        began, fell = self._spells[spell]
        first = bisect_left(self._times, self._times[began] - LED_S)
        return range(first, began + 1) if fell else range(0)

    def _skip(self) -> None:
        """Pass over rows until the one that is sought; what is shown stays till then.

        Little by little, as rows have to be read, and who watches must not think that
        the player has died.
        """
        until_s, most = self._now() + _LOOK_S, self._passed + _LED_AT_ONCE
        while self._sought is not None and self._now() <= until_s:
            if self._leads and self._passed >= most:
                break
            following = next(self._rows, None)
            if following is None:  # the log has become shorter
                self._rewind()
            elif self._passed == self._sought:
                self._arrive(following)
            elif self._passed in self._led:
                self._lead(following)
            self._passed += 1
            if self._passed == self._led.stop:
                self._go_near()

    @property
    def _leads(self) -> bool:
        """Whether rows that led to a fall are being passed on."""
        begun = bool(self._led) and self._passed > self._led.start
        return self._sought is not None and begun

    def _go_near(self) -> None:
        """Leave out the chunks between the fall and the row that is sought."""
        if self._sought is None:
            return
        mark = self._log.mark(self._sought)
        if mark.rows > self._passed:
            self._rows, self._passed = self._log.telemetries(mark), mark.rows

    def _arrive(self, row: Telemetry) -> None:
        """Show the row that is sought; what led there is no other place."""
        self._show(row, self._passed)
        self._sought = None
        self._jumps += not self._led

    def _lead(self, row: Telemetry) -> None:
        """Pass on a row that led to a fall; who shows rows leaves it out."""
        if self._passed == self._led.start:
            self._show(row, self._passed)
            self._jumps += 1
        self._row, self._index = row, self._passed
        self._publish(passes=True, leads=True)

    def _show(self, row: Telemetry, index: int) -> None:
        """Show a row, with all that happened up to it."""
        self._row, self._index, self._due_s = row, index, self._now()
        self._told, self._recalls = row, True

    def _measured(self) -> "array[float]":
        """Return when each row is played from the beginning, at its own speed [s]."""
        times, at_s, before = array("d"), 0.0, None
        for number, row in enumerate(self._log.telemetries()):
            if not number % _AT_ONCE:
                self._listen()
                self._say(f"reading the log, {number} rows")
            gap_s = 0.0 if before is None else row.time_s - before.time_s
            at_s += min(max(gap_s, 0.0), _SILENCE_S)
            times.append(at_s)
            self._note(number, row, before)
            before = row
            if self.ended:
                break
        return times

    def _note(self, number: int, row: Telemetry, before: Telemetry | None) -> None:
        """Keep what happened, and when the robot began to lie there or was up again."""
        self._happened += ((number, event) for event in row.events)
        if before is None or row.down is not before.down:
            self._spells.append((number, row.fell and before is not None))

    def _listen(self) -> None:
        """Keep what is said before it plays; nothing else can be asked of it yet."""
        for request in self._port.requests():
            if isinstance(request, Note | Shutdown):
                self._handle(request)

    def _rewind(self) -> None:
        self._passed, self._sought, self._over = 0, None, False
        self._rows = self._log.telemetries()
        first = next(self._rows, None)
        if first is None:
            raise LogError(f"{self._log.path}: no telemetry in it to play")
        self._show(first, 0)
        self._jumps += 1

    def _advance(self, now_s: float) -> None:
        """Make the next row due; pause at the last one.

        Where rows come faster than anybody sees, only some of them are shown.
        """
        shown_s = self._times[self._index]
        following = self._next()
        while (
            following is not None
            and self._speed > 1.0
            and not following.events
            and self._times[self._index] - shown_s < _SHOWN_S * self._speed
        ):
            self._row, following = following, self._next()
        if following is None:
            self._playing, self._over = False, True
            self._due_s = now_s + _STILL_S
            return
        self._row = following
        self._due_s += (self._times[self._index] - shown_s) / self._speed
        if self._due_s < now_s - _LAG_S:
            self._due_s = now_s

    def _next(self) -> Telemetry | None:
        following = next(self._rows, None)
        if following is not None:
            self._index = min(self._index + 1, len(self._times) - 1)
        return following

    def _publish(self, *, passes: bool, leads: bool = False) -> None:
        """Tell of the row; of its events once, when the log passes it."""
        row = self._row
        events = row.events if passes and row is not self._told else ()
        recalled = self._recalled() if self._recalls else None
        self._recalls = False
        if passes:
            self._told = row
        self._port.publish(
            replace(
                row,
                driver="",
                recalled=recalled,
                events=events + self._own_events(),
                replay=self._state(leads=leads),
            )
        )

    def _recalled(self) -> tuple[Event, ...]:
        """Return the latest events of the log by now, but for those to be told yet."""
        rows = self._index + (self._row is self._told)
        end = bisect_left(self._happened, rows, key=itemgetter(0))
        latest = self._happened[max(end - KEPT_EVENTS, 0) : end]
        return tuple(event for _, event in latest)

    def _state(self, *, leads: bool) -> ReplayState:
        return ReplayState(
            at_s=self._times[self._index],
            length_s=self._times[-1],
            speed=self._speed,
            playing=self._playing,
            where=self._where(),
            jumps=self._jumps,
            leads=leads,
        )

    def _where(self) -> str:
        paused = "" if self._playing else "paused at "
        # The place in the log, as on the page's bar; a loop's own time begins anew.
        at = f"{self._times[self._index]:.1f} of {self._times[-1]:.1f} s"
        where = f"replay of {self._log.path.name}, {paused}{at}"
        if self._playing or not self._over:
            return where
        damage = self._log.damage
        return f"{where}, its end" + (f"; {damage}" if damage else "")

    def _own_events(self) -> tuple[Event, ...]:
        """Return what other parts of the service had to say."""
        time_s, stamp_ns = self._row.time_s, time.time_ns()
        notes, self._notes = self._notes, []
        return tuple(Event(time_s, stamp_ns, note.kind, note.text) for note in notes)


def run(folder: Path, ended: threading.Event) -> None:
    """Play the log of the service until its end.

    Raises:
        CommandError: no log is to be played.
        LogError: the log cannot be read.
    """
    settings = load_settings(folder)
    if settings.replay is None:
        raise CommandError("no log to play; give `gaitchain replay FILE.mcap`")
    log = read_log(Path(settings.replay))
    with closing(LoopEnd(folder)) as port, closing(Pulse(folder)) as pulse:
        # It waits, as nobody has the page open yet.
        player = Player(log, port, say=pulse.say, playing=False)
        while not player.ended and not ended.is_set():
            player.tick()
            ended.wait(player.wait_s())
