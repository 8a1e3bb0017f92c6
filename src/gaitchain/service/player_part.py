"""Play a log in place of the loop: the same telemetry at the same rate, or another."""

import threading
import time
from array import array
from bisect import bisect_right
from collections.abc import Callable, Iterator
from contextlib import closing
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

SILENCE_S = 1.0
"""Longest silence of a log that is played; what is longer is cut to it [s]."""
_STILL_S = 0.04  # between rows while it is paused
_LAG_S = 0.2  # a player that is later does not catch up
_LOOK_S = 0.01  # requests are answered within this
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
        self.ended = False
        """Whether a shutdown was asked for."""
        self._times = self._measured()
        self._rewind()

    def wait_s(self) -> float:
        """Return how long nothing is to be done, 10 ms at most [s]."""
        if self._sought is not None:
            return 0.0
        return min(max(self._due_s - self._now(), 0.0), _LOOK_S)

    def tick(self) -> None:
        """Answer requests, and publish the row that is due."""
        for request in self._port.requests():
            self._handle(request)
        self._skip()
        now_s = self._now()
        if now_s < self._due_s:
            return
        self._publish()
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
        """Go to the last row that is not later, from where its chunk begins."""
        self._sought = max(bisect_right(self._times, at_s) - 1, 0)
        mark = self._log.mark(self._sought)
        self._rows, self._passed = self._log.telemetries(mark), mark.rows
        self._over = False

    def _skip(self) -> None:
        """Pass over rows until the one that is sought; what is shown stays till then.

        Little by little, as rows have to be read, and who watches must not think that
        the player has died.
        """
        until_s = self._now() + _LOOK_S
        while self._sought is not None and self._now() <= until_s:
            following = next(self._rows, None)
            if following is None:  # the log has become shorter
                self._rewind()
            elif self._passed == self._sought:
                self._row, self._index = following, self._sought
                self._sought, self._due_s = None, self._now()
            self._passed += 1

    def _measured(self) -> "array[float]":
        """Return when each row is played from the beginning, at its own speed [s]."""
        times, at_s, before_s = array("d"), 0.0, None
        for number, row in enumerate(self._log.telemetries()):
            if not number % _AT_ONCE:
                self._listen()
                self._say(f"reading the log, {number} rows")
            gap_s = 0.0 if before_s is None else row.time_s - before_s
            at_s += min(max(gap_s, 0.0), SILENCE_S)
            before_s = row.time_s
            times.append(at_s)
            if self.ended:
                break
        return times

    def _listen(self) -> None:
        """Keep what is said before it plays; nothing else can be asked of it yet."""
        for request in self._port.requests():
            if isinstance(request, Note | Shutdown):
                self._handle(request)

    def _rewind(self) -> None:
        self._index = self._passed = 0
        self._sought, self._over = None, False
        self._rows = self._log.telemetries()
        first = next(self._rows, None)
        if first is None:
            raise LogError(f"{self._log.path}: no telemetry in it to play")
        self._row, self._due_s = first, self._now()

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

    def _publish(self) -> None:
        row = self._row
        goes_on = self._playing and self._sought is None
        events = (row.events if goes_on else ()) + self._own_events()
        self._port.publish(
            replace(
                row,
                driver="",
                reason=self._reason(),
                events=events,
                replay=ReplayState(
                    at_s=self._times[self._index],
                    length_s=self._times[-1],
                    speed=self._speed,
                    playing=self._playing,
                ),
            )
        )

    def _reason(self) -> str:
        """Return the row's own reason with the place in the log."""
        own, where = self._row.reason, self._where()
        return f"{own} ({where})" if own else where

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
