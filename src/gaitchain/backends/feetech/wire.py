"""Packets of the STS series, built and parsed by Feetech's SDK."""

from collections.abc import Mapping, Sequence
from importlib import import_module
from typing import Any

from gaitchain.backends.feetech.control_table import MODEL
from gaitchain.backends.servos.port import ServoPort
from gaitchain.backends.servos.table import Block
from gaitchain.backends.servos.wire import SUCCESS, Answer, answer_of
from gaitchain.errors import needed_by

_ID, _LENGTH, _ERROR, _DATA = 2, 3, 4, 5  # indices of the fields in a status packet
_OTHERS = 2  # bytes of error and checksum, which count in the length field
_LONGEST = 250  # bytes of a packet that the SDK sends
_STS_END = 0  # byte order: low byte first


class StsProtocol:
    """Feetech's protocol with little-endian numbers and sync reads.

    The SDK's `GroupSyncRead` believes nothing of a read from which one servo is
    missing, so answers are collected one by one.
    """

    frame, request, timeout = 6, 8, -6
    last_id = 253
    last_address, most_data = 255, 248
    knows_ping_all = knows_fast = False

    def __init__(self, port: ServoPort) -> None:
        """Set the port.

        Raises:
            MissingExtraError: the SDK is not installed.
        """
        with needed_by("a Feetech servo"):
            sdk = import_module("scservo_sdk")
        self._port = port
        self._packets: Any = sdk.protocol_packet_handler(port, _STS_END)

    def ping(self, number: int) -> int | None:
        """Return the model number of a servo, None if it does not answer."""
        # The SDK's own takes any answer of the servo for that to the ping.
        self.ask(number, MODEL)
        data = answer_of(self, number, MODEL.size)
        return None if data is None else int.from_bytes(data, "little")

    def ping_all(self) -> dict[int, int]:
        """Return the model numbers by id of all that answer, asked one by one."""
        found = {}
        for number in range(self.last_id + 1):
            self._port.is_using = False
            model = self.ping(number)
            if model is not None:
                found[number] = model
        return found

    def ask(self, number: int, block: Block) -> None:
        """Request a block of one table."""
        self._packets.readTx(number, block.address, block.size)

    def ask_all(self, ids: Sequence[int], block: Block) -> None:
        """Request a block of many tables, in packets one after the other."""
        self._packets.syncReadTx(block.address, block.size, list(ids), len(ids))

    def receive(self) -> tuple[Sequence[int], int]:
        """Return the next packet, and the SDK's result."""
        packet, result = self._packets.rxPacket()
        return packet, int(result)

    def unpack(self, packet: Sequence[int], size: int) -> tuple[int, Answer] | None:
        """Return an answer and its id; None for another request's answer."""
        if packet[_LENGTH] != size + _OTHERS:
            return None
        data = bytes(packet[_DATA : _DATA + size])
        return packet[_ID], Answer(data, bool(packet[_ERROR]))

    @classmethod
    def fast_size(cls, count: int, block: Block) -> int:
        """Return the bytes of all answers: there is no packet of many."""
        return count * (cls.frame + block.size)

    def ask_fast(self, ids: Sequence[int], block: Block) -> None:
        """Request a block of many tables."""
        self.ask_all(ids, block)

    def receive_fast(
        self, ids: Sequence[int], size: int
    ) -> tuple[dict[int, Answer], bool]:
        """Return nothing: there is no packet of many."""
        return {}, False

    def write_all(self, block: Block, values: Mapping[int, bytes]) -> bool:
        """Write a block of many tables; return whether all bytes were sent."""
        parts = [bytes([number]) + data for number, data in values.items()]
        most = (_LONGEST - self.request) // (1 + block.size)
        for first in range(0, len(parts), most):
            packed = list(b"".join(parts[first : first + most]))
            result = self._packets.syncWriteTxOnly(
                block.address, block.size, packed, len(packed)
            )
            if result != SUCCESS:
                return False
        return True
