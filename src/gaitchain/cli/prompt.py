"""Read a person's answers line by line, with a callback while waiting."""

import os
import select
import stat
from collections.abc import Callable
from typing import TextIO

from gaitchain.cli.console import print_line
from gaitchain.errors import CommandError

_CHUNK = 4096
_PAUSE_S = 0.02
_PIPES = stat.S_ISFIFO, stat.S_ISREG, stat.S_ISSOCK


class Answers:
    """Lines from a terminal or a pipe."""

    def __init__(self, stream: TextIO) -> None:
        """Set the input stream.

        Raises:
            CommandError: the stream is neither a terminal nor a pipe or file.
        """
        try:
            self._file = stream.fileno()
            mode = os.fstat(self._file).st_mode
            heard = os.isatty(self._file) or any(is_kind(mode) for is_kind in _PIPES)
        except (OSError, ValueError, AttributeError):
            heard = False
        if not heard:
            raise _nobody()
        self._typed = b""

    def ask(self, text: str, meanwhile: Callable[[], None] | None = None) -> str:
        """Print a request and wait for Enter; return the text typed before it.

        Args:
            text: the request or question.
            meanwhile: called every 20 ms while waiting.

        Raises:
            CommandError: the input has ended.
        """
        print_line(text)
        while b"\n" not in self._typed:
            if meanwhile is not None:
                meanwhile()
                ready, _, _ = select.select([self._file], [], [], _PAUSE_S)
                if not ready:
                    continue
            chunk = os.read(self._file, _CHUNK)
            if not chunk:
                raise _nobody()
            self._typed += chunk
        line, _, self._typed = self._typed.partition(b"\n")
        return line.decode(errors="replace").strip()


def _nobody() -> CommandError:
    return CommandError(
        "calibrate asks a person to move the robot, and nobody answers: run it in a "
        "terminal, or pipe a line for each question"
    )
