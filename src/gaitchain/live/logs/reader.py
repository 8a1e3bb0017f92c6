"""Reads a log back, however it ended: what is whole of it, and what is missing."""

import os
from bisect import bisect_right
from collections.abc import Iterator
from io import BufferedReader
from operator import attrgetter
from pathlib import Path
from typing import NamedTuple

from mcap import records as mcap
from mcap.exceptions import InvalidMagic
from mcap.stream_reader import MAGIC_SIZE, StreamReader
from msgspec.structs import replace

from gaitchain.backends.base import truth_sizes
from gaitchain.errors import LibraryError, LogError, file_errors
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.library_file import parse_library
from gaitchain.live.logs import chunks, writer
from gaitchain.live.logs.gaps import Gaps
from gaitchain.live.logs.packing import unpack
from gaitchain.live.logs.writer import TYPED_TROUBLE
from gaitchain.live.messages import Mode, Telemetry, TroubleKind
from gaitchain.robot.whole_file import open_file

SUFFIX = ".mcap"
_LARGEST = 64 << 20  # bytes of a record; none of ours comes near
_AXES = 3
_JOINT_ARRAYS = "joint_velocity", "joint_target", "joint_load"


class Mark(NamedTuple):
    """Where a chunk of a log begins."""

    rows: int
    """Before it."""
    place: int
    """In the file [bytes]."""


BEGINNING = Mark(0, 0)
"""Of every log."""


class Log:
    """A log: the robot and its library, and the loop's telemetry."""

    def __init__(
        self, path: Path, data: bytes, library: GaitLibrary, facts: dict[str, str]
    ) -> None:
        """Put together what `read_log` found at the file's beginning."""
        self.path = path
        self.library_bytes = data
        """The library's file."""
        self.library = library
        self.version = facts.get("version", "")
        """Of the gaitchain that wrote it."""
        self.rows = 0
        """Up to the latest one that was read, from the log's beginning."""
        self.damage = ""
        """What the latest whole pass missed in it, in words; empty if nothing."""
        self.lost = 0
        """Rows of the loop that are not in it: before its first and between others."""
        before = facts.get(writer.ROW_BEFORE, "")
        self.row_before = int(before) if before.isdecimal() else None
        """Number of the row that the file before it ended with; 0 for a log's first
        file, None where nobody knows."""
        channel = facts.get(writer.CHANNEL, "")
        # Kept, as who begins in the middle may not come by their descriptions.
        self._channels = {int(channel)} if channel.isdecimal() else set[int]()
        self._marks = [BEGINNING]
        self._is_old = facts.get(writer.SCHEMA) != TYPED_TROUBLE

    def mark(self, row: int) -> Mark:
        """Return where the chunk of a row begins, or one before it.

        Args:
            row: 0 for the first. Only chunks that were read by now are known.
        """
        return self._marks[bisect_right(self._marks, row, key=attrgetter("rows")) - 1]

    def telemetries(self, mark: Mark = BEGINNING) -> Iterator[Telemetry]:
        """Yield all telemetry in the order in which it was written.

        What is damaged is left out; `rows` and `damage` say so at the end.

        Args:
            mark: where to begin, of this log.

        Raises:
            LogError: the file cannot be read, or there is telemetry in it and this
                version can read none of it.
        """
        self.rows, begins = mark.rows, mark.place
        ended, damaged, unread = False, 0, 0
        gaps, joints = Gaps(self.row_before), len(self.library.robot.legs.joint_names)
        with _opened(self.path) as file:
            file.seek(mark.place)
            for record in _records(file):
                ended = ended or isinstance(record, mcap.Footer)
                place, begins = begins, file.tell()
                if not isinstance(record, mcap.Chunk):
                    continue
                self._note(Mark(self.rows, place))
                found = _messages(record, self._channels)
                damaged += found is None
                for data in found or ():
                    try:
                        telemetry = unpack(data)
                        _check_sizes(telemetry, joints)
                    except ValueError:
                        unread += 1
                        continue
                    self.rows += 1
                    gaps.take(telemetry)
                    yield _typed(telemetry) if self._is_old else telemetry
            beyond = os.fstat(file.fileno()).st_size - file.tell() if ended else None
        if mark == BEGINNING:
            self.lost = gaps.lost
            self.damage = _in_words(self.rows, beyond, damaged, unread, gaps)
        if unread and not self.rows:
            raise LogError(
                f"{self.path}: none of its {unread} rows can be read; gaitchain "
                f"{self.version or 'unknown'} wrote it"
            )

    def _note(self, mark: Mark) -> None:
        """Keep a mark for each chunk that has rows, once."""
        if mark.rows > self._marks[-1].rows:
            self._marks.append(mark)


def read_log(path: Path) -> Log:
    """Open a log.

    Args:
        path: an MCAP file that `gaitchain serve --log` wrote, whole or cut short.

    Returns:
        The log.

    Raises:
        LogError: the file cannot be read, is no log, or its library is damaged.
    """
    facts: dict[str, str] = {}
    with _opened(path) as file:
        for record in _records(file):
            if isinstance(record, mcap.Metadata) and record.name == writer.FACTS:
                facts = record.metadata
            if isinstance(record, mcap.Attachment) and record.name == writer.LIBRARY:
                return Log(path, record.data, _library(path, record.data), facts)
            if isinstance(record, mcap.Chunk | mcap.Footer):
                break
    raise LogError(
        f"{path}: no gait library at its beginning: cut off there, or an MCAP file "
        "that is no log of gaitchain"
    )


def _library(path: Path, data: bytes) -> GaitLibrary:
    try:
        return parse_library(data, f"{path}: {writer.LIBRARY} in it")
    except LibraryError as error:
        raise LogError(str(error)) from None


def _opened(path: Path) -> BufferedReader:
    with file_errors(path, "read", LogError):
        return open_file(path)


def _records(file: BufferedReader) -> Iterator[mcap.McapRecord]:
    """Yield the records from here on, chunks unopened, as far as the file goes."""
    reader = StreamReader(
        file,
        skip_magic=file.tell() > 0,  # which is at its beginning alone
        emit_chunks=True,
        record_size_limit=_LARGEST,
    )
    try:
        yield from reader.records
    except InvalidMagic:
        if file.tell() > MAGIC_SIZE:
            return
        raise LogError(f"{file.name}: no MCAP file") from None
    except OSError as error:
        raise LogError(f"{file.name}: cannot be read: {error.strerror}") from None
    except Exception:  # whatever a cut or a damaged record makes the parser raise
        return


def _messages(chunk: mcap.Chunk, channels: set[int]) -> list[bytes] | None:
    """Return the telemetry in a chunk; None if it is damaged.

    Args:
        chunk: of the file.
        channels: on which telemetry comes; those that the chunk describes are added.
    """
    try:
        return chunks.messages(chunk, writer.TELEMETRY, channels)
    except ValueError:
        return None


def _check_sizes(telemetry: Telemetry, joints: int) -> None:
    """Refuse a row whose arrays are not those of the log's robot.

    Raises:
        ValueError: one has another length; empty ones were not measured.
    """
    wanted = dict.fromkeys(_JOINT_ARRAYS, joints)
    wanted |= {"angular_velocity": _AXES, "acceleration": _AXES}
    sizes = {name: len(getattr(telemetry, name)) for name in wanted}
    odd = any(size not in (0, wanted[name]) for name, size in sizes.items())
    if odd or len(telemetry.joint_position) != joints:
        raise ValueError(f"arrays of {sizes} numbers, for {joints} joints")
    truth = telemetry.truth
    if truth is None:
        return
    for name, size in truth_sizes(joints).items():
        if len(getattr(truth, name)) != size:
            raise ValueError(f"{name} of the simulator's truth: not {size} numbers")


def _typed(telemetry: Telemetry) -> Telemetry:
    """Return a row of a log from before trouble was typed, a fall marked as one.

    There a fall was a stop whose reason began with "fell".
    """
    if telemetry.mode is Mode.STOPPED and telemetry.reason.startswith("fell"):
        return replace(telemetry, trouble=TroubleKind.FALL)
    return telemetry


def _in_words(
    rows: int, beyond: int | None, damaged: int, unread: int, gaps: Gaps
) -> str:
    """Say what is missing.

    Args:
        rows: that were read.
        beyond: bytes after its end; None if the end is missing.
        damaged: chunks.
        unread: rows that cannot be read.
        gaps: between the rows.
    """
    found = []
    if gaps.lost:
        found.append(gaps.in_words)
    if damaged:
        are = "is" if damaged == 1 else "are"
        found.append(f"{damaged} of its chunks {are} damaged and left out")
    if unread:
        found.append(f"{unread} of its rows cannot be read")
    if beyond is None:
        found.append(f"the end is missing, after {rows} rows")
    elif beyond:
        found.append(
            f"{beyond} bytes after its end are not read: play each file of a log alone"
        )
    return "; ".join(found)
