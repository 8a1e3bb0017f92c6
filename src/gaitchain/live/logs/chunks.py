"""Opens the chunks of a log, whatever they say about themselves."""

import struct
import zlib
from collections.abc import Iterator

import zstandard
from mcap.opcode import Opcode
from mcap.records import Chunk

LARGEST = 32 << 20
"""Bytes of an opened chunk: of ours there are 4 MiB, and one row more."""
MOST_RECORDS = 200_000
"""In a chunk: of ours each has a hundred bytes or so, so there are 50 000 at most."""
_RECORD = struct.Struct("<BQ")  # opcode, bytes
_CHANNEL = struct.Struct("<HHI")  # its number, the schema's, bytes of the topic
_MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, two times
_LEAST = {Opcode.SCHEMA: 14, Opcode.CHANNEL: 16, Opcode.MESSAGE: _MESSAGE.size}
"""Bytes of a record without its texts and data."""


def messages(chunk: Chunk, topic: str, channels: set[int]) -> list[bytes]:
    """Return the messages of a topic in a chunk.

    Args:
        chunk: of the file.
        topic: whose messages are wanted.
        channels: on which they come; those that the chunk describes are added.

    Raises:
        ValueError: the chunk is damaged, too large, or holds what no chunk may.
    """
    data, found = memoryview(_opened(chunk)), []
    try:
        for kind, record in _records(data):
            if kind == Opcode.CHANNEL:
                number, _, size = _CHANNEL.unpack_from(record)
                named = bytes(record[_CHANNEL.size : _CHANNEL.size + size])
                if named == topic.encode():
                    channels.add(number)
            elif kind == Opcode.MESSAGE:
                number = _MESSAGE.unpack_from(record)[0]
                if number in channels:
                    found.append(bytes(record[_MESSAGE.size :]))
    except struct.error as error:
        raise ValueError(f"a record is cut: {error}") from None
    return found


def _records(data: memoryview) -> Iterator[tuple[int, memoryview]]:
    """Yield kind and content of each; a list of millions of tiny ones took 1 GB."""
    place = count = 0
    while place < len(data):
        kind, size = _RECORD.unpack_from(data, place)
        place, count = place + _RECORD.size, count + 1
        if kind not in _LEAST or size > len(data) - place:
            raise ValueError(f"record {kind} of {size} bytes in a chunk")
        if size < _LEAST[kind]:
            least = f"at least {_LEAST[kind]} of this kind"
            raise ValueError(f"record {kind} of {size} bytes, {least}")
        if count > MOST_RECORDS:
            raise ValueError(f"more than {MOST_RECORDS} records in a chunk")
        yield kind, data[place : place + size]
        place += size


def _opened(chunk: Chunk) -> bytes:
    """Return the data, read no further than they may be; their size is not believed."""
    if chunk.compression == "zstd":
        try:
            with zstandard.ZstdDecompressor().stream_reader(chunk.data) as reader:
                data = reader.read(LARGEST + 1)
        except (zstandard.ZstdError, MemoryError) as error:
            raise ValueError(f"cannot be decompressed: {error}") from None
    elif not chunk.compression:
        data = chunk.data
    else:
        raise ValueError(f"compression {chunk.compression:.20}, which is none of ours")
    if len(data) > LARGEST:
        raise ValueError(f"more than {LARGEST} bytes")
    if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
        raise ValueError("its checksum is another one")
    return bytes(data)
