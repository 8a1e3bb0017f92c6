"""A file of finished results, with which an interrupted run can be resumed."""

import hashlib
import json
from contextlib import AbstractContextManager, suppress
from functools import cache
from glob import escape
from importlib.metadata import version
from importlib.resources import files
from itertools import count
from pathlib import Path
from typing import Any
from weakref import finalize

from filelock import FileLock, Timeout

from gaitchain.errors import JournalError, file_errors
from gaitchain.robot.whole_file import replace_file

PACKAGES = ("gaitchain", "mujoco", "numpy", "numba", "scipy", "cmaes")
"""Packages that determine results: another version of one may give other digits."""
# Subpackages and modules that do not affect the result of a build or of a walk.
_APART = {
    *("cli", "figures", "live", "service", "bench.py"),
    *("servos", "dynamixel", "feetech", "ros"),
}


class Journal:
    """Results of a run in a file beside its output; the first line identifies the run.

    An incomplete last line is dropped. Numbers are restored to the last bit. A file of
    another run stays, under another name, if it has results; the criteria by which
    the same was judged there are remembered. One that goes on beside this one is not
    disturbed: its file is locked.
    """

    def __init__(
        self,
        path: Path,
        *subject: object,
        criterion: Any = None,
        about: bytes | None = None,
    ) -> None:
        """Read an existing file, unless it is of another subject or other code.

        Args:
            path: the file.
            subject: everything that determines the results; its `repr` is compared.
            criterion: by which they are judged, in plain values; the file remembers it.
            about: what is judged, by default the subject: the criteria of runs of
                another subject or of other code that judged it, too, are remembered.

        Raises:
            JournalError: the file cannot be read, or another run writes to it.
        """
        # A run that is refused before the file is begun leaves no lock, either.
        self._unlock = finalize(self, _unlock, _locked(path))
        digest = hashlib.sha256(code_digest().encode())
        for part in subject:
            digest.update(part if isinstance(part, bytes) else f"{part!r}".encode())
        self.path, self._of, self._criterion = path, digest.hexdigest(), criterion
        self._about = self._of
        if about is not None:
            self._about = hashlib.sha256(about).hexdigest()
        self.criteria: list[Any] = []
        """By which earlier runs judged what they saw, but for that of this run."""
        self.found: list[Any] = []
        """Results of an earlier run, in the order in which they were added."""
        self.greeting = f"{path}: finished work is kept here until the end"
        self._ends: list[int] = []
        self._aside: Path | None = None
        if path.exists():
            self._read()
        if criterion is not None:
            self.criteria = self._tried()

    def _read(self) -> None:
        with file_errors(self.path, "read", JournalError):
            lines = self.path.read_bytes().splitlines(keepends=True)
        header = _parsed(lines[0]) if lines else None
        if not isinstance(header, dict) or header.get("of") != self._of:
            self.greeting = f"{self.path}: of other work or code; starting anew"
            if len(lines) > 1:
                self._aside = self._unused()
                self.greeting += f", what it has is kept in {self._aside.name}; "
                self.greeting += _way_back(header)
            return
        self._ends.append(len(lines[0]))
        for line in lines[1:]:
            piece = _parsed(line)
            if piece is None:
                break
            self.found.append(piece)
            self._ends.append(self._ends[-1] + len(line))
        if self.found:
            many = len(self.found)
            self.greeting = f"{self.path}: going on after {many} finished pieces"

    def _unused(self) -> Path:
        """Return the first of the names for files of other runs that no file has."""
        names = (f"{self.path.name}.old{number}" for number in count(1))
        paths = map(self.path.with_name, names)
        return next(path for path in paths if not path.exists())

    def _tried(self) -> list[Any]:
        """Return the other criteria by which this file's runs, and others, judged.

        Files of before, under other names, may be put back; so they count, too.
        """
        others = self.path.parent.glob(f"{escape(self.path.name)}.old*")
        tried: list[Any] = []
        for path in (*sorted(others), self.path):
            for one in _criteria(path, self._about):
                if one not in (*tried, self._criterion):
                    tried.append(one)
        return tried

    def __enter__(self) -> "Journal":
        """Open the file; drop what cannot be used, but for results of another run.

        Raises:
            JournalError: the file cannot be written, as in all that follows.
        """
        try:
            self._begin()
        except JournalError:
            self._unlock()
            raise
        return self

    def _begin(self) -> None:
        with self._writing():
            if self._aside is not None:
                self.path.rename(self._aside)
            self._head()
            self._file = self.path.open("r+b")
        self.keep(len(self.found))

    def _head(self) -> None:
        """Write the first line, which has the criterion of this run, too."""
        own = {"about": self._about, "criterion": self._criterion}
        header = _line(
            {"of": self._of, "code": code_digest(), "criteria": self.criteria} | own
        )
        ends = self._ends or [0]
        rest = self.path.read_bytes()[ends[0] :] if self._ends else b""
        replace_file(self.path, header + rest)
        self._ends = [end - ends[0] + len(header) for end in ends]

    def __exit__(self, *unused: object) -> None:
        """Close the file without deleting it."""
        try:
            with self._writing():  # the last piece once more, where it found no room
                self._file.close()
        finally:
            self._unlock()

    def keep(self, pieces: int) -> None:
        """Drop all results but the first `pieces`, and continue after them."""
        del self.found[pieces:]
        with self._writing():
            self._file.truncate(self._ends[pieces])
            self._file.seek(self._ends[pieces])

    def add(self, piece: object) -> None:
        """Append a result of plain values and flush it to the file."""
        self._write(piece)

    def remove(self) -> None:
        """Delete the file after the run is complete."""
        with file_errors(self.path, "removed", JournalError):
            self.path.unlink(missing_ok=True)

    def _write(self, value: object) -> None:
        with self._writing():
            self._file.write(_line(value))
            self._file.flush()

    def _writing(self) -> AbstractContextManager[None]:
        return file_errors(self.path, "written", JournalError)


def _locked(path: Path) -> FileLock:
    """Return a lock of a journal, which ends with this process."""
    lock = FileLock(f"{path}.lock")
    with file_errors(path, "written", JournalError):
        path.parent.stat()  # the lock would make a folder that is missing
        try:
            lock.acquire(blocking=False)
        except Timeout:
            if not Path(lock.lock_file).exists():  # as in /proc
                raise FileNotFoundError("no file can be made in that folder") from None
            raise JournalError(
                f"{path}: another run writes to it; wait for its end, or give another "
                "-o"
            ) from None
    return lock


def _unlock(lock: FileLock) -> None:
    """Remove a lock's file, and only then release it: nobody else has it by then."""
    with suppress(OSError):  # Windows keeps a file that is open
        Path(lock.lock_file).unlink()
    lock.release()


@cache
def code_digest() -> str:
    """Return a digest of all code and data that determine the result of a build."""
    versions = [(name, version(name)) for name in PACKAGES]
    digest, root = hashlib.sha256(f"{versions}".encode()), files("gaitchain")
    for path in sorted(Path(str(root)).rglob("*")):
        parts = path.relative_to(str(root)).parts
        if path.suffix in (".py", ".toml") and not set(parts) & _APART:
            digest.update(f"{parts}".encode() + path.read_bytes())
    return digest.hexdigest()


def _way_back(header: Any) -> str:
    """Say what would go on from a file of other work."""
    code = header.get("code") if isinstance(header, dict) else None
    if code == code_digest():
        return "renamed back, the command that began it goes on from there"
    return "only the code that began it would go on from there"


def _criteria(path: Path, about: str) -> list[Any]:
    """Return by what a file's runs judged something, if its results were seen."""
    try:
        with path.open("rb") as file:
            header, first = _parsed(file.readline()), _parsed(file.readline())
    except OSError:
        return []
    if not isinstance(header, dict) or header.get("about") != about:
        return []
    kept = header.get("criteria")
    known = kept if isinstance(kept, list) else []  # else it is damaged
    own = header.get("criterion")
    return known if first is None or own is None else [*known, own]


def _line(value: object) -> bytes:
    return json.dumps(value).encode() + b"\n"


def _parsed(line: bytes) -> Any:
    """Parse a line; None if it is incomplete or damaged."""
    try:
        return json.loads(line) if line.endswith(b"\n") else None
    except (ValueError, RecursionError):
        return None
