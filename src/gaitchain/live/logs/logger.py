"""A log that survives errors: after a full disk it goes on in a new file.

A file that is full is followed by another one, and the oldest of too many is removed.
"""

import logging
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import msgspec

from gaitchain.errors import LogError
from gaitchain.gait.library import GaitLibrary
from gaitchain.live.logs.gaps import Gaps, rows_missing
from gaitchain.live.logs.names import next_free
from gaitchain.live.logs.writer import LogFile
from gaitchain.live.messages import Telemetry
from gaitchain.robot.whole_file import replace_file

SYNC_S = 0.5
"""What is older is on the disk [s]."""
AGAIN_S = 10.0
"""After an error another file is begun so late [s]."""
SAID_S = 10.0
"""Lost rows are said at most this often [s]."""
_LOG = logging.getLogger(__name__)


@dataclass(frozen=True)
class Room:
    """How much of the disk a log may take."""

    file_bytes: int = 512 << 20
    """Size from which a file is followed by the next one."""
    files: int = 8
    """Of one log; the oldest one goes. Those of logs before it do not count."""


class _Ledger(msgspec.Struct):
    """The files of a log."""

    number: int = 0
    """Of the latest one."""
    files: list[str] = []
    """Those that are still there, oldest first."""
    row: int | None = None
    """Number of the loop's row that was put on the disk last."""


def _read_ledger(path: Path | None) -> _Ledger:
    """Read which files a log has; none where that was not noted."""
    if path is None or not path.exists():
        return _Ledger()
    try:
        return msgspec.json.decode(path.read_bytes(), type=_Ledger)
    except (OSError, msgspec.MsgspecError):
        return _Ledger()


class Logger:
    """Writes telemetry to a file, or to the next one; reports errors, raises none."""

    def __init__(
        self,
        path: Path,
        library: GaitLibrary,
        report: Callable[[str], None],
        now: Callable[[], float] = time.monotonic,
        room: Room | None = None,
        ledger: Path | None = None,
    ) -> None:
        """Begin a log.

        Args:
            path: the file; where there are some of that name, one with a higher number.
            library: what is walked.
            report: called once when the log cannot be written, when it goes on, and
                when rows are lost.
            now: a clock [s].
            room: how much of the disk it may take.
            ledger: file in which the log's files are noted, so that a logger that is
                started again goes on with them; none by default.
        """
        self._path, self._library, self._report, self._now = path, library, report, now
        self._file: LogFile | None = None
        self._room, self._ledger = room or Room(), ledger
        self._said, self._say_s, self._failed = 0, now(), False
        before = _read_ledger(ledger)
        self._gaps = Gaps(before.row if before.files else 0)
        self._lost_before = 0  # up to the end of the file before
        self._number, self._written = before.number, deque(map(Path, before.files))
        self._due_s = self._again_s = now()
        self._open()

    @property
    def path(self) -> Path | None:
        """The file that is being written; None while none can be."""
        return None if self._file is None else self._file.path

    def write(self, telemetry: Telemetry) -> None:
        """Add a row, as far as it can be written."""
        if self._file is None and self._now() >= self._again_s:
            self._open()
        if self._file is None:
            self._gaps.pass_over(telemetry)
        else:
            self._add(self._file, telemetry)
        self.sync()

    def sync(self) -> None:
        """Put what is there on the disk, if it is time to."""
        if self._file is None or self._now() < self._due_s:
            return
        try:
            self._file.sync()
        except LogError as error:
            self._leave(error)
        else:
            self._gaps.keep()
            self._note_files()
        self._due_s = self._now() + SYNC_S
        if self._file is not None and self._file.size >= self._room.file_bytes:
            self.close()
            self._open()

    def close(self) -> None:
        """End the file."""
        file, self._file = self._file, None
        if file is not None:
            lost = self._gaps.lost - self._lost_before
            self._lost_before = self._gaps.lost
            try:
                file.close(lost)
            except LogError as error:
                _LOG.error("%s", error)

    def _add(self, file: LogFile, telemetry: Telemetry) -> None:
        self._gaps.take(telemetry)
        self._tell(file)
        try:
            file.write(telemetry)
        except LogError as error:
            self._leave(error)

    def _tell(self, file: LogFile) -> None:
        """Report that the log goes on, or that rows are lost, if it is time to."""
        if self._failed:
            missing = self._gaps.lost_since_kept
            without = f"; {rows_missing(missing)}" if missing else ""
            text = f"the log goes on in {file.path}{without}"
        elif self._gaps.lost > self._said and self._now() >= self._say_s:
            text = self._gaps.in_words
        else:
            return
        self._failed = False
        self._said, self._say_s = self._gaps.lost, self._now() + SAID_S
        self._report(text)

    def _open(self) -> None:
        try:
            self._file = LogFile(self._free(), self._library, self._gaps.number)
        except LogError as error:
            self._number -= 1
            self._leave(error)
            return
        self._written.append(self._file.path)
        while len(self._written) > self._room.files:
            with suppress(OSError):  # somebody else removed it
                self._written.popleft().unlink()
        self._note_files()
        self._due_s = self._now() + SYNC_S

    def _note_files(self) -> None:
        """Note files and latest row for a logger that is started again."""
        if self._ledger is not None:
            files = [str(path) for path in self._written]
            noted = _Ledger(self._number, files, self._gaps.number)
            with suppress(OSError):  # the log itself is what matters
                replace_file(self._ledger, msgspec.json.encode(noted))

    def _free(self) -> Path:
        """Return the path, or the one with the next number."""
        free, self._number = next_free(self._path, self._number)
        return free

    def _leave(self, error: LogError) -> None:
        """Give up the file; report why, unless that was done before."""
        if self._file is not None:
            self._file.abandon()
            self._gaps.drop()
            self._lost_before = self._gaps.lost
        self._file = None
        self._again_s = self._now() + AGAIN_S
        if not self._failed:
            self._failed = True
            self._report(f"{error}; nothing is logged, next try in {AGAIN_S:g} s")
