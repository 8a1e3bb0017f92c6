"""Packets of servos of any make: what the bus asks of a make's SDK."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from gaitchain.backends.servos.port import ServoPort
from gaitchain.backends.servos.table import Block

SUCCESS = 0
"""Result of an SDK's functions: the packet is sound."""


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

    @classmethod
    def fast_size(cls, count: int, block: Block) -> int:
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
