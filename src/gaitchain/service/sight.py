"""Whether the part that draws the 3-D view is alive, and which process it is.

A browser's socket to the view goes through the API and says nothing of why it is
silent; and viser opens it anew only while its frame has the focus. So the page is told.
"""

import os
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from gaitchain.service.pulse import Pulse

_FILE = "view"
_SILENT_S = 3.0  # it beats once a second at least, on a busy computer a little later


class SightBeat:
    """The end of the part that draws."""

    def __init__(self, folder: Path) -> None:
        """Say which process draws from now on."""
        self._pulse = Pulse(folder, _FILE)
        self._pulse.keep(str(os.getpid()))

    def beat(self) -> None:
        """Say that it still does, in a file that somebody may have removed."""
        with suppress(OSError):  # the folder as well
            self._pulse.put_back()
        self._pulse.beat()

    def close(self) -> None:
        """Say that it does no more."""
        self._pulse.keep("")
        self._pulse.close()


class Sight:
    """The end of the API, which may look at any time."""

    def __init__(self, folder: Path, now: Callable[[], float] = time.monotonic) -> None:
        """Begin to watch.

        Args:
            folder: of the service.
            now: a clock [s].
        """
        self._pulse, self._now = Pulse(folder, _FILE), now
        self._seen, self._seen_s = self._pulse.beats, -_SILENT_S

    @property
    def drawn_by(self) -> int | None:
        """Number of the process that draws; None while none does."""
        now_s = self._now()
        if now_s - self._seen_s >= _SILENT_S:
            with suppress(OSError):
                self._pulse.look_again()
        beats = self._pulse.beats
        if beats != self._seen:
            self._seen, self._seen_s = beats, now_s
        with suppress(ValueError):
            if now_s - self._seen_s < _SILENT_S:
                return int(self._pulse.kept)
        return None
