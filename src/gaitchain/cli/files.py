"""Checks of the files that a verb reads and writes, before it does any work."""

import os
from collections.abc import Iterable
from pathlib import Path

from gaitchain.errors import CommandError, file_errors
from gaitchain.gait.file_kind import Kind, kind_of
from gaitchain.robot.whole_file import resolved, try_replacing

STDOUT = Path("-")
"""What an option says for standard output."""
_PICTURE, _TABLE = ".png", ".toml"


def check_writable(path: Path) -> None:
    """Check that a file can be written, before any work is done for it.

    Raises:
        CommandError: the file cannot be written.
    """
    try:
        _try_writing(path)
    except OSError as error:
        raise CommandError(
            f"{path}: cannot be written: {error.strerror}; name another file"
        ) from None


def _try_writing(path: Path) -> None:
    """Do all that writing a file begins with, and leave no file of it."""
    if path.is_dir():
        raise CommandError(
            f"{path}: cannot be written, as it is a folder; name a file in it"
        )
    if path.exists() and not os.access(path, os.W_OK):
        raise CommandError(f"{path}: cannot be written; name a file in your own folder")
    if path.is_file() or not path.exists():  # no pipe, nor /dev/null
        make_folder(path.parent)
        try_replacing(path)


def check_picture(path: Path) -> None:
    """Check the same of a picture, and that its name says what it will be.

    Raises:
        CommandError: the file cannot be written, is not named as a PNG, or is there and
            no picture.
    """
    check_writable(path)
    check_replaced(path, "the picture")
    if path.suffix.lower() != _PICTURE:
        raise CommandError(f"{path}: pictures are PNG; name it {path.stem}{_PICTURE}")


def check_files(written: Iterable[Path | None], read: Iterable[Path | None]) -> None:
    """Check that files can be written, and that each is another one than the rest.

    Args:
        written: by a command; None where there is none.
        read: by the same command.

    Raises:
        CommandError: a file cannot be written, or the command would write over it.
    """
    taken = {file_of(path) for path in read if path is not None}
    for path in written:
        if path is None or path == STDOUT:
            continue
        check_writable(path)
        if file_of(path) in taken:
            raise CommandError(
                f"{path}: named twice: this command would write over it; name another "
                "file"
            )
        taken.add(file_of(path))


def file_of(path: Path) -> Path:
    """Return the absolute path of the file that links lead to.

    Raises:
        CommandError: they lead in a ring.
    """
    with file_errors(path, "found", CommandError):
        return resolved(path)


def check_replaced(path: Path | None, what: str, wanted: Kind | None = None) -> None:
    """Refuse to replace a file of the package or a TOML file by something else.

    Args:
        path: to be written; None where nothing is.
        what: will be in it, for the message.
        wanted: what of the package's files it may replace, and then nothing else but an
            empty file.

    Raises:
        CommandError: the file is there, and something else.
    """
    if path is None or not path.is_file() or not path.stat().st_size:  # or a pipe
        return
    known = kind_of(path)
    found: str | None = "a robot's TOML file" if path.suffix == _TABLE else known
    if found is None and wanted is not None:
        found = f"it is there, and not {wanted} that can be read"
    if found not in (None, wanted):
        raise CommandError(f"{path}: {found}; name another file for {what}")


def make_folder(path: Path) -> Path:
    """Create a folder and check that it is writable, before any work is done.

    Raises:
        CommandError: the folder cannot be created or written to.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError):
        raise CommandError(
            f"{path}: no such folder can be made: there is a file of that name; name "
            "another folder"
        ) from None
    except OSError as error:
        raise CommandError(
            f"{path}: no such folder can be made: {error.strerror}; name one in your "
            "own folder"
        ) from None
    if not os.access(path, os.W_OK):
        raise CommandError(f"{path}: cannot be written to; name a folder of your own")
    return path
