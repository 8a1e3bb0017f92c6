"""Packets of protocol 2.0, built and parsed by the SDK of ROBOTIS."""

from collections.abc import Mapping, Sequence
from importlib import import_module
from typing import Any

from gaitchain.backends.dynamixel.control_table import ALERT
from gaitchain.backends.servos.port import ServoPort
from gaitchain.backends.servos.table import Block
from gaitchain.backends.servos.wire import SUCCESS, Answer, answer_of
from gaitchain.errors import needed_by

_ID, _LENGTH, _KIND = 4, 5, 7  # indices of the fields in a packet
_ERROR, _DATA = 8, 9  # and in a status packet
_OTHERS = 4  # bytes of instruction, error and CRC, which count in the length field
_FAST_HEAD = 8  # bytes of the answer to a fast sync read before the first servo's part
_FAST_FRAME = 4  # and of a servo's part without data: error, id, a CRC of all so far
_CRC, _BEFORE_DATA = 2, 2
_PING, _PING_BYTES, _PING_LENGTH = 1, 10, 3
_MODEL = slice(0, 2)  # in the answer to a ping, before a byte of the firmware
_PINGED = 3  # bytes of data in it


class Protocol2:
    """DYNAMIXEL's protocol 2.0."""

    frame, request, timeout = 11, 14, -3001
    last_id = 252
    last_address, most_data = 2**16 - 1, 1020
    knows_ping_all = knows_fast = True

    def __init__(self, port: ServoPort) -> None:
        """Set the port.

        Raises:
            MissingExtraError: the SDK is not installed.
        """
        with needed_by("a DYNAMIXEL servo"):
            sdk = import_module("dynamixel_sdk")
        self._port = port
        self._packets: Any = sdk.Protocol2PacketHandler()

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

    @classmethod
    def fast_size(cls, count: int, block: Block) -> int:
        """Return the bytes of one packet in which so many servos answer."""
        return _FAST_HEAD + count * (_FAST_FRAME + block.size)

    def ask_fast(self, ids: Sequence[int], block: Block) -> None:
        """Request one packet in which all servos answer."""
        self._sync_read(ids, block, fast=True)

    def receive_fast(
        self, ids: Sequence[int], size: int
    ) -> tuple[dict[int, Answer], bool]:
        """Return the answers in such a packet up to its first bad byte."""
        packet, result = self._packets.rxPacket(self._port, True)
        heard: dict[int, Answer] = {}
        begin, covered, crc = _FAST_HEAD, 0, 0
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
