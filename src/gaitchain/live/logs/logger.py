"""A log that survives errors: after a full disk it goes on in a new file."""

import logging
import time
from collections.abc import Callable
from pathlib import Path

from gaitchain.errors import LogError
from gaitchain.gait.library import GaitLibrary
from gaitchain.live.logs.writer import LogFile
from gaitchain.live.messages import Telemetry

SYNC_S = 0.5
"""What is older is on the disk [s]."""
AGAIN_S = 10.0
"""After an error another file is begun so late [s]."""
_LOG = logging.getLogger(__name__)


class Logger:
    """Writes telemetry to a file, or to the next one; reports errors, raises none."""

    def __init__(
        self,
        path: Path,
        library: GaitLibrary,
        report: Callable[[str], None],
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        """Begin a log.

        Args:
            path: the file; where it is there already, one with a number after its name.
            library: what is walked.
            report: called once when the log cannot be written, and when it goes on.
            now: a clock [s].
        """
        self._path, self._library, self._report, self._now = path, library, report, now
        self._file: LogFile | None = None
        self._failed = False
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
        if self._file is not None:
            try:
                self._file.write(telemetry)
            except LogError as error:
                self._leave(error)
        self.sync()

    def sync(self) -> None:
        """Put what is there on the disk, if it is time to."""
        if self._file is None or self._now() < self._due_s:
            return
        try:
            self._file.sync()
        except LogError as error:
            self._leave(error)
        self._due_s = self._now() + SYNC_S

    def close(self) -> None:
        """End the file."""
        file, self._file = self._file, None
        if file is not None:
            try:
                file.close()
            except LogError as error:
                _LOG.error("%s", error)

    def _open(self) -> None:
        try:
            self._file = LogFile(_free(self._path), self._library)
        except LogError as error:
            self._leave(error)
            return
        self._due_s = self._now() + SYNC_S
        if self._failed:
            self._failed = False
            self._report(f"the log goes on in {self._file.path}")

    def _leave(self, error: LogError) -> None:
        """Give up the file; report why, unless that was done before."""
        if self._file is not None:
            self._file.abandon()
        self._file = None
        self._again_s = self._now() + AGAIN_S
        if not self._failed:
            self._failed = True
            self._report(f"{error}; nothing is logged, next try in {AGAIN_S:g} s")


def _free(path: Path) -> Path:
    """Return the path, or the first with a number that is not there yet."""
    free, number = path, 1
    while free.exists():
        number += 1
        free = path.with_name(f"{path.stem}-{number}{path.suffix}")
    return free
