"""A bus of emulated servos: request bytes in, answer bytes out. No port, no thread."""

import random
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

BROADCAST = 0xFE
"""Id of a packet for all devices."""


@dataclass(frozen=True)
class Packet:
    """A packet that has arrived completely."""

    number: int
    """Id of the receiver, or of the sender of a status packet."""
    instruction: int
    data: bytes
    """Parameters; in a status packet the error comes first."""


class Reader(Protocol):
    """What finds packets in a stream of bytes."""

    def feed(self, data: bytes) -> Iterator[Packet]:
        """Append bytes, and yield each packet that they complete."""

    def drop(self) -> None:
        """Discard an incomplete packet."""


class EmulatedBus(ABC):
    """Emulated devices on a bus with random transmission faults.

    Makes differ in their packets, and in what they answer.
    """

    reader: ClassVar[type[Reader]]
    """What finds the packets in a stream of bytes."""

    def __init__(
        self,
        devices: Iterable[Any],
        seed: int = 0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Connect devices to the bus.

        Args:
            devices: servos and IMU.
            seed: seed of the random faults.
            clock: clock of the servos' motion and watchdogs [s].
        """
        self.devices: dict[int, Any] = {device.number: device for device in devices}
        self.drop = 0.0
        """Probability that a request or an answer is lost."""
        self.lose_next = 0
        """Number of the next requests and answers that are lost."""
        self.corrupt = 0.0
        """Probability that a byte of a request or an answer is changed."""
        self.cut = False
        """Whether the data line is cut; the servos keep their supply."""
        self.fast = True
        """Whether the servos' firmware knows fast sync reads, where their make does."""
        self.dead: set[int] = set()
        """Ids of devices that neither receive nor answer."""
        self.clock = clock
        self.lock = threading.RLock()
        """Held while a packet is executed."""
        self._random = random.Random(seed)
        self._reader = self.reader()

    def answer(self, data: bytes) -> bytes:
        """Receive bytes and return the answers to the packets that they complete."""
        with self.lock:
            now, noisy = self.clock(), self._passed(data)
            return b"".join(
                answer
                for packet in self._reader.feed(noisy)
                for answer in self._answers(packet, now)
            )

    def pause(self) -> None:
        """Discard an incomplete packet, as servos do after a pause."""
        with self.lock:
            self._reader.drop()

    def _passed(self, packet: bytes) -> bytes:
        """Return a packet after transmission, with faults; empty if it is lost."""
        if self.cut or self._random.random() < self.drop or not packet:
            return b""
        if self.lose_next:
            self.lose_next -= 1
            return b""
        if self._random.random() < self.corrupt:
            changed = bytearray(packet)
            changed[self._random.randrange(len(packet))] ^= self._random.randint(1, 255)
            return bytes(changed)
        return packet

    @abstractmethod
    def _answers(self, packet: Packet, now: float) -> Iterator[bytes]:
        """Yield what arrives of the answers to a packet."""

    def _alive(self, numbers: Iterable[int]) -> Iterator[Any]:
        for number in numbers:
            if number in self.devices and number not in self.dead:
                yield self.devices[number]
