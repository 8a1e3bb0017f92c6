"""The loop's telemetry as an MCAP file that a crash cannot spoil.

The library comes first, then chunk after chunk; what `sync` has put on the disk can be
read without the end of the file.
"""

import errno
import os
from contextlib import AbstractContextManager, suppress
from importlib.metadata import version
from pathlib import Path
from typing import Any

from mcap.writer import CompressionType, Writer

from gaitchain.backends.ros.cdr import definition, encode
from gaitchain.errors import LogError, file_errors
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.library_file import library_bytes
from gaitchain.live.logs.packing import pack, rounded
from gaitchain.live.logs.ros_messages import TOPICS, TopicBuilder
from gaitchain.live.messages import Telemetry

TELEMETRY = "/gaitchain/telemetry"
LIBRARY = "library.gait"
"""Name of the attachment that makes a log need no other file."""
FACTS = "gaitchain"
"""Name of the metadata: version of gaitchain, robot, fingerprint."""
CHANNEL = "telemetry_channel"
"""The fact by which telemetry is found where the description of channels is lost."""
LOST = "rows_lost"
"""Name of the metadata at the end: how many rows of the loop never came."""
ROW_BEFORE = "row_before"
"""The fact that says which row of the loop came before the file's first one."""
SCHEMA, TYPED_TROUBLE = "schema", "2"
"""The fact that telemetry has a typed trouble; logs from before lack it."""
_CHUNK = 4 << 20  # bytes; `sync` ends a chunk long before
_ROOM = 1 << 20  # bytes that must be free, or a log is not worth beginning
_LATEST_NS = 2**63 - 1


class LogFile:
    """One MCAP file, from its library to its end."""

    def __init__(
        self, path: Path, library: GaitLibrary, row_before: int | None = None
    ) -> None:
        """Begin a new file with all that is needed to understand it.

        Args:
            path: the file; one that is there is left alone.
            library: what is walked.
            row_before: number of the loop's row before the first one here, 0 before the
                loop's first; None where nobody knows.

        Raises:
            LogError: the file is there already, or cannot be written.
        """
        self.path = path
        self._topics = TopicBuilder(library.robot)
        self._channels: dict[str, int] = {}
        with self._writing():
            path.parent.mkdir(parents=True, exist_ok=True)
            self._stream = path.open("xb")
        try:
            with self._writing():
                _want_room(self._stream.fileno())
                self._begin(library, row_before)
            self.sync()
        except LogError:
            self.abandon()
            path.unlink(missing_ok=True)
            raise

    def write(self, telemetry: Telemetry) -> None:
        """Add a row.

        Raises:
            LogError: it cannot be written.
        """
        row = rounded(telemetry)
        stamp_ns = min(max(row.stamp_ns, 0), _LATEST_NS)
        with self._writing():
            self._add(TELEMETRY, stamp_ns, pack(row))
            for topic, message in self._topics.build(row):
                self._add(topic, stamp_ns, encode(message))

    @property
    def size(self) -> int:
        """Bytes that are in the file by now."""
        return int(self._stream.tell())

    def sync(self) -> None:
        """Finish the chunk, and wait until it is on the disk.

        Raises:
            LogError: it cannot be written.
        """
        with self._writing():
            self._writer.flush()
            os.fsync(self._stream.fileno())
            self._check_there()

    def _check_there(self) -> None:
        """Raise OSError if what is written is no more where it was begun."""
        with suppress(FileNotFoundError):
            found = self.path.stat(), os.fstat(self._stream.fileno())
            if os.path.samestat(*found):
                return
        raise FileNotFoundError(errno.ENOENT, "somebody has removed or replaced it")

    def close(self, lost: int = 0) -> None:
        """End the file with its index.

        Args:
            lost: rows of the loop that never came; that is noted in the file.

        Raises:
            LogError: it cannot be written.
        """
        try:
            with self._writing():
                if lost:
                    self._writer.add_metadata(LOST, {"rows": str(lost)})
                self._writer.finish()
                self._stream.close()
        finally:
            self.abandon()

    def abandon(self) -> None:
        """Leave the file as it is."""
        with suppress(OSError):
            self._stream.close()

    def _writing(self) -> AbstractContextManager[None]:
        return file_errors(self.path, "written", LogError)

    def _begin(self, library: GaitLibrary, row_before: int | None) -> None:
        self._writer: Any = Writer(  # not all of it is typed
            self._stream, chunk_size=_CHUNK, compression=CompressionType.ZSTD
        )
        written_by = version("gaitchain")
        self._writer.start(profile="ros2", library=f"gaitchain {written_by}")
        # A schema without text: readers that know no MessagePack pass it over.
        nothing = self._writer.register_schema("gaitchain.Telemetry", "", b"")
        self._channels[TELEMETRY] = self._writer.register_channel(
            TELEMETRY, "msgpack", nothing
        )
        schemas = {
            kind.type_name: self._writer.register_schema(
                kind.type_name, "ros2msg", definition(kind.type_name).encode()
            )
            for kind in dict.fromkeys(TOPICS.values())
        }
        for topic, kind in TOPICS.items():
            self._channels[topic] = self._writer.register_channel(
                topic, "cdr", schemas[kind.type_name]
            )
        facts = {
            "version": written_by,
            SCHEMA: TYPED_TROUBLE,
            "robot": library.robot.name,
            "fingerprint": library.robot.fingerprint,
            CHANNEL: str(self._channels[TELEMETRY]),
        }
        if row_before is not None:
            facts[ROW_BEFORE] = str(row_before)
        self._writer.add_metadata(FACTS, facts)
        data = library_bytes(library)
        self._writer.add_attachment(0, 0, LIBRARY, "application/octet-stream", data)

    def _add(self, topic: str, stamp_ns: int, data: bytes) -> None:
        self._writer.add_message(self._channels[topic], stamp_ns, data, stamp_ns)


def _want_room(file: int) -> None:
    """Raise OSError if the disk has no room for the first seconds of a log."""
    if not hasattr(os, "posix_fallocate"):  # not on macOS
        return
    try:
        os.posix_fallocate(file, 0, _ROOM)
    except OSError as error:
        if error.errno not in (errno.EOPNOTSUPP, errno.EINVAL):
            raise
    os.ftruncate(file, 0)
