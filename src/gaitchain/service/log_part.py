"""The part that logs the loop's telemetry."""

import threading
import time
from collections import deque
from contextlib import closing
from pathlib import Path

import msgspec

from gaitchain.errors import CommandError
from gaitchain.gait.library_file import load_library
from gaitchain.live.logs.logger import Logger, Room
from gaitchain.live.messages import Note
from gaitchain.service.channel import Asker, Listener
from gaitchain.service.pulse import part_pulse
from gaitchain.service.settings import load_settings

LEDGER = "log.json"
"""File in the service's folder that says which files the log has."""
_WAIT_S = 0.1
_BACKLOG = 20_000  # rows, 80 s of a loop at 250 Hz: a disk may be held up so long
_LAST = 1000  # rows that have come, or are on the way, when the end is asked for
_ON_THE_WAY_S = 0.05  # between two of those
_NOTES = 100  # that wait for the loop; older ones are dropped
_LATEST_S = 0.2  # after the end was asked for: then only those that have come


def run(folder: Path, ended: threading.Event) -> None:
    """Log until the end of the service, then finish the file.

    Args:
        folder: of the service.
        ended: ends it when it is set.

    Raises:
        CommandError: no log was asked for.
        LibraryError: the library cannot be read.
    """
    settings = load_settings(folder)
    if settings.log is None:
        raise CommandError("no log was asked for; give --log FILE.mcap")
    library, path = load_library(settings.library), Path(settings.log)
    room = Room(round(1e6 * settings.log_mb), settings.log_files)
    with (
        closing(Listener(folder, logs=True, backlog=_BACKLOG)) as listener,
        closing(Asker(folder)) as asker,
        closing(_Notes(asker)) as notes,
        closing(part_pulse(folder, "log")) as pulse,
        closing(
            Logger(path, library, notes.tell, room=room, ledger=folder / LEDGER)
        ) as logger,
    ):
        while not ended.is_set():
            pulse.beat()
            notes.send()
            _log_next(listener, logger, _WAIT_S)
        _log_last(listener, logger)


class _Notes:
    """What the loop is told of the log, kept until the loop takes it."""

    def __init__(self, asker: Asker) -> None:
        self._asker = asker
        self._left: deque[Note] = deque(maxlen=_NOTES)

    def tell(self, text: str) -> None:
        self._left.append(Note("log", text))
        self.send()

    def send(self) -> None:
        while self._left and self._asker.ask(self._left[0]):
            self._left.popleft()

    def close(self) -> None:
        self.send()


def _log_next(listener: Listener, logger: Logger, wait_s: float) -> bool:
    """Log what comes within a time; return whether anything did."""
    try:
        telemetry = listener.next(wait_s)
    except msgspec.DecodeError:
        return True
    if telemetry is None:
        logger.sync()
        return False
    logger.write(telemetry)
    return True


def _log_last(listener: Listener, logger: Logger) -> None:
    """Log what the loop said before the end was asked for, though it may go on."""
    latest_s = time.monotonic() + _LATEST_S
    for _ in range(_LAST):
        wait_s = _ON_THE_WAY_S if time.monotonic() < latest_s else 0.0
        if not _log_next(listener, logger, wait_s):
            break
