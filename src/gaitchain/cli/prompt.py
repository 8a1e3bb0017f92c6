"""Read a person's answers line by line, with a callback while waiting."""

import contextlib
import os
import queue
import stat
import threading
from collections.abc import Callable
from importlib import import_module
from typing import Any, TextIO

from gaitchain.cli.console import print_line
from gaitchain.errors import CommandError

YES = "y", "yes"
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
            self._terminal = os.isatty(self._file)
            heard = self._terminal or any(is_kind(mode) for is_kind in _PIPES)
        except (OSError, ValueError, AttributeError):
            heard = False
        if not heard:
            raise _nobody()
        self._typed = b""
        # Windows can wait for sockets only, so that a thread waits here everywhere.
        self._chunks: queue.SimpleQueue[bytes] = queue.SimpleQueue()
        self._reader: threading.Thread | None = None
        # It reads only while an answer is waited for: what it had read before a
        # question, and not yet told, would be taken for the answer.
        self._wanted, self._waited_for = threading.Semaphore(0), False

    def ask(self, text: str, meanwhile: Callable[[], None] | None = None) -> str:
        """Print a request and wait for Enter; return the text typed before it.

        At a terminal only what is typed after the request counts: Enter that somebody
        pressed while the robot moved must not answer what is asked next.

        Args:
            text: the request or question.
            meanwhile: called every 20 ms while waiting.

        Raises:
            CommandError: the input has ended.
        """
        if self._terminal:
            self._forget()
        print_line(text)
        while b"\n" not in self._typed:
            if meanwhile is not None:
                meanwhile()
            try:
                chunk = self._read(None if meanwhile is None else _PAUSE_S)
            except queue.Empty:
                continue
            if not chunk:
                raise _nobody()
            self._typed += chunk
        line, _, self._typed = self._typed.partition(b"\n")
        return line.decode(errors="replace").strip()

    def choose(
        self, text: str, *words: str, meanwhile: Callable[[], None] | None = None
    ) -> str:
        """Ask until Enter alone or one of some words is typed; return the word.

        Whoever types "no" or "stop" starts nothing by it.

        Args:
            text: the request.
            words: what may be typed before Enter; yes counts as Enter alone.
            meanwhile: called every 20 ms while waiting.

        Raises:
            CommandError: the input has ended.
        """
        while (typed := self.ask(text, meanwhile).lower()) not in words:
            if typed in ("", *YES):
                return ""
            known = " or ".join(("nothing", *words))
            print_line(f"  type {known} before Enter; Ctrl-C ends it")
        return typed

    def _forget(self) -> None:
        """Drop what was typed so far, read or not."""
        _flush(self._file)
        with contextlib.suppress(queue.Empty):  # of a question that was given up
            self._chunks.get_nowait()
            self._waited_for = False
        self._typed = b""

    def _read(self, timeout_s: float | None) -> bytes:
        if self._reader is None:
            self._reader = threading.Thread(target=self._listen, daemon=True)
            self._reader.start()
        if not self._waited_for:
            self._waited_for = True
            self._wanted.release()
        chunk = self._chunks.get(timeout=timeout_s)
        self._waited_for = False
        return chunk

    def _listen(self) -> None:
        while True:
            self._wanted.acquire()
            try:
                chunk = os.read(self._file, _CHUNK)
            except OSError:  # the terminal has gone
                chunk = b""
            self._chunks.put(chunk)


def _flush(terminal: int) -> None:
    """Drop the keys that a terminal holds and that nobody has read."""
    if os.name == "nt":
        keys: Any = import_module("msvcrt")
        while keys.kbhit():
            keys.getwch()
        return
    modes: Any = import_module("termios")  # not on Windows
    with contextlib.suppress(modes.error):  # it has gone: reading says so
        modes.tcflush(terminal, modes.TCIFLUSH)


def _nobody() -> CommandError:
    return CommandError(
        "a person beside the robot is asked, and nobody answers: run it in a terminal, "
        "or pipe a line for each question"
    )
