"""Play a log in place of the loop: the same telemetry at the same rate."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

from msgspec.structs import replace

from gaitchain.errors import CommandError, LogError
from gaitchain.live.logs.reader import Log, read_log
from gaitchain.live.messages import (
    EmergencyStop,
    Event,
    Note,
    Request,
    Reset,
    Shutdown,
    Start,
    Stop,
    Telemetry,
)
from gaitchain.service.channel import LoopEnd
from gaitchain.service.settings import load_settings

if TYPE_CHECKING:
    from gaitchain.live.loop import LoopPort

_STILL_S = 0.04  # between rows while it is paused
_LONGEST_S = 1.0  # of a silence in the log that is kept
_LAG_S = 0.2  # a player that is later does not catch up
_LOOK_S = 0.01  # requests are answered within this


class Player:
    """A log that plays, pauses and begins again as it is asked to."""

    def __init__(
        self, log: Log, port: "LoopPort", now: Callable[[], float] = time.monotonic
    ) -> None:
        """Begin to play.

        Args:
            log: what to play.
            port: requests and telemetry.
            now: a clock [s].

        Raises:
            LogError: there is no telemetry in the log.
        """
        self._log, self._port, self._now = log, port, now
        self._notes: list[Note] = []
        self._playing, self._due_s = True, now()
        self._rewind()
        self.ended = False
        """Whether a shutdown was asked for."""

    def wait_s(self) -> float:
        """Return how long nothing is to be done, 10 ms at most [s]."""
        return min(max(self._due_s - self._now(), 0.0), _LOOK_S)

    def tick(self) -> None:
        """Answer requests, and publish the row that is due."""
        for request in self._port.requests():
            self._handle(request)
        now_s = self._now()
        if now_s < self._due_s:
            return
        self._publish()
        if self._playing:
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
            case Note():
                self._notes.append(request)
            case Shutdown():
                self.ended = True
            case _:
                pass  # nobody drives a log

    def _rewind(self) -> None:
        self._rows: Iterator[Telemetry] = self._log.telemetries()
        self._over = False
        first = next(self._rows, None)
        if first is None:
            raise LogError(f"{self._log.path}: no telemetry in it to play")
        self._row, self._due_s = first, self._now()

    def _advance(self, now_s: float) -> None:
        """Make the next row due; pause at the last one."""
        following = next(self._rows, None)
        if following is None:
            self._playing, self._over = False, True
            self._due_s = now_s + _STILL_S
            return
        gap_s = following.time_s - self._row.time_s
        self._row = following
        self._due_s += min(max(gap_s, 0.0), _LONGEST_S)
        if self._due_s < now_s - _LAG_S:
            self._due_s = now_s

    def _publish(self) -> None:
        row = self._row
        events = (row.events if self._playing else ()) + self._own_events()
        self._port.publish(
            replace(row, driver="", reason=self._reason(), events=events)
        )

    def _reason(self) -> str:
        row, log = self._row, self._log
        if self._playing:
            where = f"replay of {log.path.name}, {row.time_s:.1f} s"
            return f"{row.reason} ({where})" if row.reason else where
        place = f"replay of {log.path.name}, paused at {row.time_s:.1f} s"
        if not self._over:
            return place
        return f"{place}, its end" + (f"; {log.damage}" if log.damage else "")

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
    with closing(LoopEnd(folder)) as port:
        player = Player(log, port)
        while not player.ended and not ended.is_set():
            player.tick()
            ended.wait(player.wait_s())
