"""Names of a log's files: NAME.mcap, then NAME-2.mcap, NAME-3.mcap and so on."""

import glob
import re
from collections.abc import Sequence
from pathlib import Path


def files_of(path: Path) -> list[Path]:
    """Return the files that are there of the logs of a name, in order.

    Args:
        path: of the log, which its first file has.
    """
    found = path.parent.glob(f"{glob.escape(path.stem)}*{path.suffix}")
    return sorted(
        (f for f in found if _number(f, path)), key=lambda f: _number(f, path)
    )


def next_free(path: Path, number: int = 0) -> tuple[Path, int]:
    """Return where a log goes on and that file's number, which is above all others.

    Lower ones may be free as the oldest files go; numbers tell the order in which files
    were written, so those are not used again.

    Args:
        path: of the log, which its first file has.
        number: of the latest file; 0 before the first.
    """
    number = 1 + max([number, *(_number(file, path) for file in files_of(path))])
    if number == 1:
        return path, number
    return path.with_name(f"{path.stem}-{number}{path.suffix}"), number


def in_words(files: Sequence[Path]) -> str:
    """Return the names of some files of a log; of many the first and the last."""
    first, *more = files
    if not more:
        return f"{first}"
    return f"{first} {'and' if len(more) == 1 else 'to'} {more[-1].name}"


def missing(path: Path) -> str:
    """Say that there is no such file, and which others of that log there are."""
    others = files_of(path)
    return f"no such file, only {in_words(others)}" if others else "no such file"


def _number(file: Path, path: Path) -> int:
    """Return the number of a log's file; 0 if it is none of that log."""
    if file.name == path.name:
        return 1
    found = re.fullmatch(r"-([0-9]+)", file.stem.removeprefix(path.stem))
    return int(found[1]) if found else 0
