"""Packets of protocol 2.0, built and parsed by the SDK of ROBOTIS."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from gaitchain.backends.dynamixel.control_table import ALERT, Block
from gaitchain.backends.dynamixel.port import ServoPort, sdk

SUCCESS = 0
"""Result of an SDK's functions: the packet is sound."""
_ID, _LENGTH, _KIND = 4, 5, 7  # indices of the fields in a packet
_ERROR, _DATA = 8, 9  # and in a status packet
_OTHERS = 4  # bytes of instruction, error and CRC, which count in the length field
FAST_HEAD = 8
"""Bytes of the answer to a fast sync read before the first servo's part."""
FAST_FRAME = 4
"""Bytes of a servo's part without data: error, id, and a CRC of all bytes so far."""
_CRC, _BEFORE_DATA = 2, 2
_PING, _PING_BYTES, _PING_LENGTH = 1, 10, 3
_MODEL = slice(0, 2)  # in the answer to a ping, before a byte of the firmware
_PINGED = 3  # bytes of data in it


@dataclass(frozen=True)
class Answer:
    """A servo's answer to a read."""

    data: bytes
    alert: bool
    """Whether the servo has a hardware error."""


class Wire(Protocol):
    """A make's packets on an open port."""

    frame: int
    """Bytes of a status packet without data."""
    request: int
    """Bytes of a read, and of a sync read without the ids."""
    timeout: int
    """Result of the SDK for a packet of which no byte came."""
    last_id: int
    """Highest id that a servo may have."""
    last_address: int
    """Last byte of a table that can be asked for."""
    most_data: int
    """Most bytes of a table in one answer."""
    knows_ping_all: bool
    """Whether one broadcast finds all servos."""
    knows_fast: bool
    """Whether there is one packet in which all servos answer."""

    def __init__(self, port: ServoPort) -> None:
        """Set the port."""

    def ping(self, number: int) -> int | None:
        """Return the model number of a servo, None if it does not answer."""

    def ping_all(self) -> dict[int, int]:
        """Return the model numbers by id of all that answer."""

    def ask(self, number: int, block: Block) -> None:
        """Request a block of one table."""

    def ask_all(self, ids: Sequence[int], block: Block) -> None:
        """Request a block of many tables, in packets one after the other."""

    def receive(self) -> tuple[Sequence[int], int]:
        """Return the next packet, and the SDK's result."""

    def unpack(self, packet: Sequence[int], size: int) -> tuple[int, Answer] | None:
        """Return an answer and its id; None for an error, or another request's."""

    def fast_size(self, count: int, block: Block) -> int:
        """Return the bytes of one packet in which so many servos answer."""

    def ask_fast(self, ids: Sequence[int], block: Block) -> None:
        """Request one packet in which all servos answer."""

    def receive_fast(
        self, ids: Sequence[int], size: int
    ) -> tuple[dict[int, Answer], bool]:
        """Return the sound answers in such a packet, and whether it is complete."""

    def write_all(self, block: Block, values: Mapping[int, bytes]) -> bool:
        """Write a block of many tables; return whether all bytes were sent."""


def answer_of(wire: Wire, number: int, size: int) -> bytes | None:
    """Return the data of one servo's answer, None if none comes in time.

    Passes over late answers to earlier requests, which have data of another size.

    Args:
        wire: packets of the port that the request was sent to.
        number: id of the servo.
        size: bytes of data that were requested.
    """
    while True:
        packet, result = wire.receive()
        if result != SUCCESS:
            return None
        found = wire.unpack(packet, size)
        if found is not None and found[0] == number:
            return found[1].data


class Protocol2:
    """DYNAMIXEL's protocol 2.0."""

    frame, request, timeout = 11, 14, -3001
    last_id = 252
    last_address, most_data = 2**16 - 1, 1020
    knows_ping_all = knows_fast = True

    def __init__(self, port: ServoPort) -> None:
        """Set the port."""
        self._port = port
        self._packets: Any = sdk().Protocol2PacketHandler()

    def ping(self, number: int) -> int | None:
        """Return the model number of a servo, None if it does not answer."""
        # The SDK's own takes any answer of the servo for that to the ping.
        packet = [0] * _PING_BYTES
        packet[_ID], packet[_LENGTH], packet[_KIND] = number, _PING_LENGTH, _PING
        if self._packets.txPacket(self._port, packet) != SUCCESS:
            return None
        self._port.setPacketTimeout(self.frame + _PINGED)
        data = answer_of(self, number, _PINGED)
        return None if data is None else int.from_bytes(data[_MODEL], "little")

    def ping_all(self) -> dict[int, int]:
        """Return the model numbers by id of all that answer, by one broadcast."""
        found, _ = self._packets.broadcastPing(self._port)
        return {number: model for number, (model, _) in sorted(found.items())}

    def ask(self, number: int, block: Block) -> None:
        """Request a block of one table."""
        self._packets.readTx(self._port, number, block.address, block.size)

    def ask_all(self, ids: Sequence[int], block: Block) -> None:
        """Request a block of many tables, in packets one after the other."""
        self._sync_read(ids, block, fast=False)

    def receive(self) -> tuple[Sequence[int], int]:
        """Return the next packet, without byte stuffing, and the SDK's result."""
        packet, result = self._packets.rxPacket(self._port, False)
        return packet, int(result)

    def unpack(self, packet: Sequence[int], size: int) -> tuple[int, Answer] | None:
        """Return an answer and its id; None for an error, or another request's."""
        length = packet[_LENGTH] + 256 * packet[_LENGTH + 1]
        error = packet[_ERROR]
        if length != size + _OTHERS or error & ~ALERT:
            return None
        data = bytes(packet[_DATA : _DATA + size])
        return packet[_ID], Answer(data, bool(error & ALERT))

    def fast_size(self, count: int, block: Block) -> int:
        """Return the bytes of one packet in which so many servos answer."""
        return FAST_HEAD + count * (FAST_FRAME + block.size)

    def ask_fast(self, ids: Sequence[int], block: Block) -> None:
        """Request one packet in which all servos answer."""
        self._sync_read(ids, block, fast=True)

    def receive_fast(
        self, ids: Sequence[int], size: int
    ) -> tuple[dict[int, Answer], bool]:
        """Return the answers in such a packet up to its first bad byte."""
        packet, result = self._packets.rxPacket(self._port, True)
        heard: dict[int, Answer] = {}
        begin, covered, crc = FAST_HEAD, 0, 0
        for number in ids:
            end = begin + _BEFORE_DATA + size
            if len(packet) < end + _CRC:
                break
            crc = self._packets.updateCRC(crc, packet[covered:end], end - covered)
            check = int.from_bytes(bytes(packet[end : end + _CRC]), "little")
            if crc != check or packet[begin + 1] != number:
                break
            covered, error = end, packet[begin]
            if not error & ~ALERT:
                data = bytes(packet[begin + _BEFORE_DATA : end])
                heard[number] = Answer(data, bool(error & ALERT))
            begin = end + _CRC
        return heard, result == SUCCESS

    def write_all(self, block: Block, values: Mapping[int, bytes]) -> bool:
        """Write a block of many tables; return whether all bytes were sent."""
        # The SDK does no byte stuffing when it sends. None is needed: FF FF FD does not
        # occur, because ids end at 252 and no value has FF in its high byte.
        packed = [byte for number, data in values.items() for byte in (number, *data)]
        result = self._packets.syncWriteTxOnly(
            self._port, block.address, block.size, packed, len(packed)
        )
        return bool(result == SUCCESS)

    def _sync_read(self, ids: Sequence[int], block: Block, *, fast: bool) -> None:
        self._packets.syncReadTx(
            self._port, block.address, block.size, list(ids), len(ids), fast
        )
