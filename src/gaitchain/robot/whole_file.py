"""Read and write a file as a whole, and find the one that a link leads to."""

import contextlib
import errno
import os
import stat
from io import BufferedReader
from pathlib import Path

from gaitchain.errors import GaitchainError

_MEGABYTE = 1_000_000
_NO_FILE = "it is no regular file; give one, not a device or a pipe"


def given_path(path: object, what: str, kind: type[GaitchainError]) -> Path:
    """Return what was given as the path of a file.

    Args:
        path: what was given.
        what: the file, for the message.
        kind: the error to raise.

    Raises:
        GaitchainError: of that kind, where no file can have such a path.
    """
    if isinstance(path, str | os.PathLike) and "\0" not in str(path):
        return Path(path)
    raise kind(f"{path!r:.80} cannot be the path of {what}; give one as text")


def open_file(path: Path) -> BufferedReader:
    """Open a regular file to read it: a device may have no end, a pipe no writer.

    Raises:
        OSError: it cannot be opened, or is no regular file.
    """
    kind = path.stat().st_mode  # before it is opened, as that may wait for a writer
    if not stat.S_ISREG(kind) and not stat.S_ISDIR(kind):
        raise OSError(errno.EINVAL, _NO_FILE, str(path))
    return path.open("rb")


def read_file(path: Path, most: int) -> bytes:
    """Read a regular file of a limited size.

    Args:
        path: the file.
        most: how large it may be [bytes].

    Raises:
        OSError: it cannot be read, is no regular file, or larger.
    """
    with open_file(path) as file:
        size = os.fstat(file.fileno()).st_size
        if size > most:
            raise OSError(
                errno.EFBIG,
                f"it has {size / _MEGABYTE:.1f} MB, such a file at most "
                f"{most / _MEGABYTE:g}",
                str(path),
            )
        return file.read(most)


def resolved(path: Path) -> Path:
    """Return the absolute path of the file that links lead to.

    Raises:
        OSError: they lead in a ring.
    """
    try:
        return path.resolve()
    except RuntimeError:  # Python 3.13 returns it, and opening it fails
        raise OSError(errno.ELOOP, os.strerror(errno.ELOOP), str(path)) from None


def replace_file(path: Path, data: bytes) -> None:
    """Write a file: an existing one is replaced as a whole or kept.

    Args:
        path: the file; a link stays one, and what is no regular file is written to.
        data: its content.

    Raises:
        OSError: it cannot be written.
    """
    path = resolved(path)
    if path.exists() and not path.is_file():  # a pipe, /dev/null; a folder fails
        path.write_bytes(data)
        return
    part = _part_of(path)
    try:
        part.write_bytes(data)
        part.replace(path)
    finally:
        with contextlib.suppress(OSError):
            part.unlink()


def try_replacing(path: Path) -> None:
    """Begin as `replace_file` does, and leave nothing of it.

    Permissions do not tell whether a folder takes a new file: names may be too long,
    and those of the kernel's own are all taken.

    Args:
        path: a regular file, or none yet.

    Raises:
        OSError: it could not be written.
    """
    part = _part_of(resolved(path))
    try:
        part.touch()
    finally:
        with contextlib.suppress(OSError):
            part.unlink()


def _part_of(path: Path) -> Path:
    """Return the file beside another one in which that is written first."""
    return path.with_name(f".{path.name}.{os.getpid()}.part")
