"""Standard output and error of which nobody reads on, or that have no room left."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path
from typing import TextIO

from gaitchain.errors import CommandError, file_errors

_lost: ContextVar[CommandError | None] = ContextVar("lost", default=None)


def open_missing() -> None:
    """Open /dev/null as each standard stream that this process was started without.

    Others call their methods, and the next file would get the number of the stream: in
    it would be what this process or one that it starts prints.
    """
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            # In this order each gets its own number, the least that is free.
            stream = Path(os.devnull).open(  # noqa: SIM115 - for good
                mode, encoding="utf-8", errors="backslashreplace"
            )
            os.set_inheritable(stream.fileno(), True)
            setattr(sys, name, stream)


@contextmanager
def written_to(stream: TextIO | None) -> Iterator[None]:
    """Let work go on where its text cannot be written to a standard stream.

    What else is written to that stream is dropped. A reader that has ended, as in
    `gaitchain inspect res | head -1`, wants no more; other troubles of standard output
    are told by `told_of_lost` at the end, when the files of the command are written.

    Args:
        stream: standard output or error; None where the process has none.
    """
    try:
        yield
        if stream is not None:
            stream.flush()  # else it would fail when the interpreter ends
    except OSError as error:
        _drop(stream)
        if stream is sys.stdout and not isinstance(error, BrokenPipeError):
            _lost.set(_told(error))


@contextmanager
def told_of_lost() -> Iterator[None]:
    """Say at the end of a context that standard output could not be written.

    Raises:
        CommandError: it could not, though somebody wants it, as on a full disk.
    """
    token = _lost.set(None)
    try:
        try:
            yield
        except SystemExit:  # after help
            if _lost.get() is None:
                raise
        if error := _lost.get():
            raise error
    finally:
        _lost.reset(token)


def say_aside(text: str) -> None:
    """Print a line on standard error."""
    with written_to(sys.stderr):
        print(text, file=sys.stderr)


def _told(error: OSError) -> CommandError:
    try:
        with file_errors("standard output", "written", CommandError):
            raise error
    except CommandError as told:
        return told


def _drop(stream: TextIO | None) -> None:
    """Lead a stream nowhere, as the documentation of Python's `signal` recommends."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        with suppress(OSError, ValueError, AttributeError):  # it is no file
            os.dup2(nowhere, stream.fileno())  # type: ignore[union-attr]
    finally:
        os.close(nowhere)
