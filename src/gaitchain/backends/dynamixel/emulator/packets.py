"""Protocol 2.0 packets of the emulated servos, implemented without the SDK's code."""

from collections.abc import Iterator

from gaitchain.backends.servos.emulator.bus import Packet

HEADER = b"\xff\xff\xfd"
STATUS = 0x55
_HEAD = 7  # bytes of header, reserved, id and length
MOST = 1024
"""Largest length field, the size of a servo's buffer."""
_LEAST = 3  # instruction and CRC
_STUFFED = b"\xff\xff\xfd\xfd"
_POLYNOMIAL = 0x8005


def _crc_table() -> tuple[int, ...]:
    table = []
    for byte in range(256):
        crc = byte << 8
        for _ in range(8):
            crc = (crc << 1) ^ (_POLYNOMIAL if crc & 0x8000 else 0)
        table.append(crc & 0xFFFF)
    return tuple(table)


_TABLE = _crc_table()


def crc16(data: bytes) -> int:
    """Return the protocol's CRC-16: polynomial x^16 + x^15 + x^2 + 1, initially 0."""
    crc = 0
    for byte in data:
        crc = (crc << 8 & 0xFF00) ^ _TABLE[crc >> 8 ^ byte]
    return crc


def encode(number: int, instruction: int, data: bytes = b"") -> bytes:
    """Return the bytes of a packet."""
    body = bytes([instruction]) + data
    stuffed = body.replace(HEADER, _STUFFED)
    packet = head(number, len(stuffed) + 1) + stuffed
    return packet + crc16(packet).to_bytes(2, "little")


def head(number: int, size: int) -> bytes:
    """Return the first bytes of a packet, up to its length.

    Args:
        number: id of the receiver, or of the sender of a status packet.
        size: bytes of the packet after these and its instruction, with the last CRC.
    """
    return HEADER + b"\0" + bytes([number]) + (size + 1).to_bytes(2, "little")


class PacketReader:
    """A parser that finds packets in a stream of arbitrary bytes."""

    def __init__(self) -> None:
        """Start with an empty buffer."""
        self._heard = bytearray()

    def feed(self, data: bytes) -> Iterator[Packet]:
        """Append bytes, and yield each packet that they complete."""
        self._heard += data
        while self._find_header():
            size = int.from_bytes(self._heard[5:7], "little")
            end = _HEAD + size
            if not (self._heard[3] == 0 and _LEAST <= size <= MOST):
                del self._heard[0]
                continue
            if len(self._heard) < end:
                return
            packet = bytes(self._heard[:end])
            if crc16(packet[:-2]) != int.from_bytes(packet[-2:], "little"):
                del self._heard[0]  # a packet may begin inside the invalid one
                continue
            del self._heard[:end]
            body = packet[_HEAD:-2].replace(_STUFFED, HEADER)
            yield Packet(packet[4], body[0], body[1:])

    def _find_header(self) -> bool:
        """Discard bytes before a header; return whether a packet's head is complete."""
        start = self._heard.find(HEADER)
        if start < 0:
            # Keep the last bytes, which may begin a header.
            del self._heard[: max(0, len(self._heard) - len(HEADER) + 1)]
            return False
        del self._heard[:start]
        return len(self._heard) >= _HEAD

    def drop(self) -> None:
        """Discard an incomplete packet."""
        self._heard.clear()
