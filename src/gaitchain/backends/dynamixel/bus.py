"""Requests to the servos on one bus, each with a time limit."""

import contextlib
import math
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from gaitchain.backends.dynamixel.control_table import ALERT, Block
from gaitchain.backends.dynamixel.port import BITS, ServoPort, sdk
from gaitchain.errors import BackendError

try:
    import termios

    _LOST: tuple[type[Exception], ...] = (OSError, termios.error)
except ImportError:  # not on Windows
    _LOST = (OSError,)

_SUCCESS, _TIMEOUT = 0, -3001  # COMM_SUCCESS, COMM_RX_TIMEOUT of the SDK
_FRAME = 11  # bytes of a status packet without data
_ID, _LENGTH, _ERROR, _DATA = 4, 5, 8, 9  # indices of the fields in a status packet
_OTHERS = 4  # bytes of instruction, error and CRC, which count in the length field
_SYNC_READ = 14  # bytes of a sync read request without the ids
_TRIES = 4  # attempts at a request that must succeed
_BUDGET_S = 0.5  # time limit of each attempt
_SILENCES = 2  # after this many requests in a row without any answer, stop asking


@dataclass(frozen=True)
class Answer:
    """A servo's answer to a read."""

    data: bytes
    alert: bool
    """Whether the servo has a hardware error."""


class ServoBus:
    """The servos on a serial port; not thread-safe.

    The SDK's packet handler builds and parses the packets. Its `GroupSyncRead` stops at
    the first lost packet and then returns old values as new ones, so answers are
    collected here.
    """

    def __init__(
        self,
        name: str,
        baud: int,
        patience_s: float,
        ports: Callable[[str, int, float], ServoPort] = ServoPort,
    ) -> None:
        """Set up the bus; the port is not opened yet.

        Args:
            name: serial port, such as "/dev/ttyUSB0".
            baud: rate [bit/s].
            patience_s: longest silence before a packet, in addition to the
                transmission time of its bytes [s].
            ports: constructor of the port.
        """
        self.name = name
        self.return_delay_s = 5e-4
        """Largest return delay among the servos' settings [s]."""
        self.sent = 0
        """Number of requested answers."""
        self.lost = 0
        """Number of requested answers that did not arrive."""
        self.spoke_s = 0.0
        """Monotonic time of the last packet that was sent [s]."""
        self.patience_s = patience_s
        """Longest silence before a packet, beyond its transmission time [s]."""
        self._baud, self._ports = baud, ports
        self._wait_left_s = math.inf  # remaining time to wait for missing answers
        self._port: ServoPort | None = None
        self._packets: Any = None

    def line_s(self, count: int, block: Block) -> float:
        """Return how long a sync read of `count` servos keeps the line busy [s]."""
        sent = _SYNC_READ + count
        return (sent + count * (_FRAME + block.size)) * BITS / self._baud

    @property
    def is_open(self) -> bool:
        """Whether the port is open."""
        return self._port is not None

    def open(self) -> None:
        """Open the port; close it first if it is open.

        Raises:
            BackendError: the port cannot be opened.
        """
        self.close()
        self._port = self._ports(self.name, self._baud, self.patience_s)
        self._packets = sdk().Protocol2PacketHandler()

    def close(self) -> None:
        """Close the port; never raises."""
        if self._port is not None:
            self._port.close()
        self._port = None

    @contextlib.contextmanager
    def hurried(self, vain_s: float) -> Iterator[None]:
        """Limit the total wait for missing answers in a context.

        After `vain_s` of waiting no more requests are sent; writes still are. Answers
        that arrive do not count.
        """
        before, self._wait_left_s = self._wait_left_s, vain_s
        try:
            yield
        finally:
            self._wait_left_s = before

    def ping(self, number: int) -> int | None:
        """Return the model number of a servo, None if it does not answer.

        Raises:
            BackendError: the port is lost.
        """
        if self._wait_left_s <= 0.0:
            return None
        with self._connected_port() as port:
            model, result, _ = self._packets.ping(port, number)
            if result == _SUCCESS:
                return int(model)
            self._wait_left_s -= time.monotonic() - self.spoke_s
        return None

    def scan(self, ids: Iterable[int] | None = None) -> dict[int, int]:
        """Return the model numbers by id of all devices that answer.

        Args:
            ids: ids to ping, repeatedly if silent; by default one broadcast ping to
                all, which takes about a second.

        Raises:
            BackendError: the port is lost.
        """
        if ids is None:
            with self._connected_port() as port:
                found, _ = self._packets.broadcastPing(port)
            return {number: model for number, (model, _) in sorted(found.items())}
        models: dict[int, int | None] = dict.fromkeys(ids)
        for _ in range(_TRIES):
            silent = [number for number, model in models.items() if model is None]
            models |= {number: self.ping(number) for number in silent}
        return {number: model for number, model in models.items() if model is not None}

    def read(self, number: int, block: Block) -> Answer | None:
        """Read a block of one device's table; None if it does not answer.

        Raises:
            BackendError: the port is lost.
        """
        if self._wait_left_s <= 0.0:
            return None
        with self._connected_port() as port:
            self._packets.readTx(port, number, block.address, block.size)
            deadline = time.monotonic() + 2.0 * self._wait_s(port, block)
            heard = self._listen(port, [number], block, deadline)
        self.sent += 1
        self.lost += 1 - len(heard)
        return heard.get(number)

    def read_all(
        self, ids: Sequence[int], block: Block, budget_s: float
    ) -> dict[int, Answer]:
        """Read the same block of many servos' tables, of those that answer.

        Each servo answers after the one before it in the list, so all those after a
        dead servo are silent; they are asked again without it while time is left.

        Args:
            ids: ids of the servos, in this order.
            block: the block to read.
            budget_s: time limit of the whole read [s].

        Raises:
            BackendError: the port is lost.
        """
        self._connected()
        deadline = time.monotonic() + budget_s
        answers: dict[int, Answer] = {}
        asked, silences = list(ids), 0
        while asked and silences < _SILENCES and time.monotonic() < deadline:
            if self._wait_left_s <= 0.0:
                break
            heard = self._sync_read(asked, block, deadline)
            answers |= heard
            silences = 0 if heard else silences + 1
            last = max((asked.index(number) for number in heard), default=-1)
            asked = asked[last + 2 :]
        self.sent += len(ids)
        self.lost += len(ids) - len(answers)
        return answers

    def write_all(self, block: Block, values: Mapping[int, bytes]) -> None:
        """Write the same block of many servos' tables, without confirmation.

        Raises:
            BackendError: the port is lost.
        """
        # The SDK does no byte stuffing when it sends. None is needed: FF FF FD does not
        # occur, because ids end at 252 and no value has FF in its high byte.
        packed = [byte for number, data in values.items() for byte in (number, *data)]
        with self._connected_port() as port:
            result = self._packets.syncWriteTxOnly(
                port, block.address, block.size, packed, len(packed)
            )
            if result != _SUCCESS:
                raise OSError("not all bytes could be sent")

    def read_surely(self, ids: Sequence[int], block: Block) -> dict[int, bytes]:
        """Read a block of many tables, with retries for lost answers.

        Each attempt waits twice as long as the one before: on a busy computer an answer
        is late, not lost.

        Raises:
            BackendError: the port is lost.
        """
        found: dict[int, bytes] = {}
        for attempt in range(_TRIES):
            missing = [number for number in ids if number not in found]
            if not missing:
                break
            with self._as_patient(2**attempt):
                answers = self.read_all(missing, block, _BUDGET_S)
            found |= {number: answer.data for number, answer in answers.items()}
        return found

    def write_surely(self, block: Block, values: Mapping[int, bytes]) -> list[int]:
        """Write a block of many tables, read it back, and retry where it differs.

        Each attempt waits twice as long as the one before.

        Returns:
            The ids whose table still differs, or that do not answer.

        Raises:
            BackendError: the port is lost.
        """
        left = dict(values)
        for attempt in range(_TRIES):
            self.write_all(block, left)
            with self._as_patient(2**attempt):
                shown = self.read_all(list(left), block, _BUDGET_S)
            left = {
                number: data
                for number, data in left.items()
                if number not in shown or shown[number].data != data
            }
            if not left:
                break
        return list(left)

    @contextlib.contextmanager
    def _as_patient(self, times: int) -> Iterator[None]:
        """Wait so many times as long for each packet in a context."""
        before, self.patience_s = self.patience_s, times * self.patience_s
        try:
            yield
        finally:
            self.patience_s = before

    def _sync_read(
        self, ids: Sequence[int], block: Block, deadline: float
    ) -> dict[int, Answer]:
        with self._connected_port() as port:
            self._packets.syncReadTx(
                port, block.address, block.size, list(ids), len(ids), False
            )
            # The request itself is still being transmitted.
            head = (_SYNC_READ + len(ids)) * port.byte_s
            return self._listen(port, ids, block, deadline, head)

    def _listen(
        self,
        port: ServoPort,
        ids: Sequence[int],
        block: Block,
        deadline: float,
        head_s: float = 0.0,
    ) -> dict[int, Answer]:
        """Collect answers until that of the last servo, or until a timeout."""
        heard: dict[int, Answer] = {}
        while ids[-1] not in heard:
            begin = time.monotonic()
            left = deadline - begin
            if left <= 0.0:
                break
            port.wait_for(min(left, head_s + self._wait_s(port, block)))
            packet, result = self._packets.rxPacket(port, False)
            if result == _TIMEOUT:
                self._wait_left_s -= time.monotonic() - begin
                break
            if result == _SUCCESS and packet[_ID] in ids:
                answer = _unpacked(packet, block.size)
                if answer is not None:
                    heard[packet[_ID]] = answer
            head_s = 0.0
        return heard

    def _wait_s(self, port: ServoPort, block: Block) -> float:
        """Return the longest time to the end of the next answer [s]."""
        line = (_FRAME + block.size) * port.byte_s
        return line + self.return_delay_s + self.patience_s

    def _connected(self) -> ServoPort:
        if self._port is None:
            raise BackendError(f"{self.name}: not connected; connect first")
        return self._port

    @contextlib.contextmanager
    def _connected_port(self) -> Iterator[ServoPort]:
        """Yield the port; if it fails, close it and raise."""
        port = self._connected()
        port.is_using = False  # the SDK leaves it set if an answer is missing
        port.patience_s = self.patience_s
        self.spoke_s = time.monotonic()
        try:
            yield port
        except _LOST as error:
            self.close()
            raise BackendError(
                f"{self.name}: lost ({error}); plug it in and connect again"
            ) from None


def _unpacked(packet: Sequence[int], size: int) -> Answer | None:
    """Parse a status packet.

    Args:
        packet: the packet as received by the SDK, without byte stuffing.
        size: number of requested data bytes.

    Returns:
        The answer; None for an error, or for a late answer to another request.
    """
    length = packet[_LENGTH] + 256 * packet[_LENGTH + 1]
    error = packet[_ERROR]
    if length != size + _OTHERS or error & ~ALERT:
        return None
    return Answer(bytes(packet[_DATA : _DATA + size]), bool(error & ALERT))
