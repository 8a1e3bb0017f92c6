"""Requests to the servos on one bus, each with a time limit."""

import contextlib
import math
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from statistics import median
from typing import NamedTuple

from gaitchain.backends.servos.make import Make
from gaitchain.backends.servos.port import ServoPort
from gaitchain.backends.servos.table import Block
from gaitchain.backends.servos.wire import SUCCESS, Answer, Wire
from gaitchain.errors import BackendError

try:
    import termios

    _LOST: tuple[type[Exception], ...] = (OSError, termios.error)
except ImportError:  # not on Windows
    _LOST = (OSError,)

_FAST_TRIES = 3
_TRIES = 4  # attempts at a request that must succeed
_BUDGET_S = 0.5  # time limit of each attempt
_SILENCES = 2  # after this many requests in a row without any answer, stop asking


class Heard(NamedTuple):
    """What came of a read of many servos."""

    answers: dict[int, Answer]
    """By id, of those that answered."""
    silent: frozenset[int]
    """Ids that did not, though it was their turn; all others had no turn."""

    def in_order(self, ids: Iterable[int]) -> list[int]:
        """Return ids as to be asked next: none behind one that was silent."""
        return sorted(ids, key=lambda n: (n in self.silent) - (n in self.answers))


class ServoBus:
    """The servos on a serial port; not thread-safe.

    The packet handler of the make's SDK builds and parses the packets. ROBOTIS'
    `GroupSyncRead` stops at the first lost packet and then returns old values as new
    ones, so answers are collected here.
    """

    def __init__(
        self,
        name: str,
        baud: int,
        patience_s: float,
        ports: Callable[[str, int, float], ServoPort] = ServoPort,
        *,
        make: Make,
    ) -> None:
        """Set up the bus; the port is not opened yet.

        Args:
            name: serial port, such as "/dev/ttyUSB0".
            baud: rate [bit/s].
            patience_s: longest silence before a packet, in addition to the
                transmission time of its bytes [s].
            ports: constructor of the port.
            make: make of the servos.
        """
        self.name, self.make = name, make
        self.return_delay_s = 5e-4
        """Largest return delay among the servos' settings [s]."""
        self.sent = 0
        """Number of requested answers."""
        self.lost = 0
        """Number of requested answers that did not arrive."""
        self._answered_s = dict[int, float]()  # last answers by id
        self.spoke_s = 0.0
        """Monotonic time of the last packet that was sent [s]."""
        self.patience_s = patience_s
        """Longest silence before a packet, beyond its transmission time [s]."""
        self.fast = False
        """Whether `read_all` asks for one packet from all; see `try_fast`."""
        self._baud, self._ports = baud, ports
        self._wait_left_s = math.inf  # remaining time to wait for missing answers
        self._port: ServoPort | None = None
        self._wire: Wire | None = None

    @property
    def baud(self) -> int:
        """Rate [bit/s]."""
        return self._baud

    @property
    def late_bytes(self) -> int:
        """Number of bytes that came after the wait for them had ended."""
        return 0 if self._port is None else self._port.late_bytes

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
        self._wire = self.make.wire(self._port)

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
        return self._timed_ping(number)[0]

    def _timed_ping(self, number: int) -> tuple[int | None, float]:
        """Return the model number of a servo, None without, and how long it took."""
        if self._wait_left_s <= 0.0:
            return None, math.inf
        with self._connected_port() as (port, wire):
            begin = port.now()
            model = wire.ping(number)
            took_s = port.now() - begin
            if model is None:
                self._wait_left_s -= took_s
        return model, took_s

    def turn_s(self, ids: Iterable[int]) -> float:
        """Return how long servos take to answer a ping, beyond its bytes [s].

        It is the median of those that answer: a busy computer delays some. NaN if none
        does.

        Args:
            ids: ids to ping, one after the other.

        Raises:
            BackendError: the port is lost.
        """
        pings = [self._timed_ping(number) for number in ids]
        came_s = [took_s for model, took_s in pings if model is not None]
        if not came_s:
            return math.nan
        wire, port = self._connected_wire(), self._connected()
        line_s = (wire.request + wire.frame) * port.byte_s
        return max(median(came_s) - line_s, 0.0)

    def scan(self, ids: Iterable[int] | None = None) -> dict[int, int]:
        """Return the model numbers by id of all devices that answer.

        Args:
            ids: ids to ping, repeatedly if silent; by default one broadcast ping to
                all, which takes about a second.

        Raises:
            BackendError: the port is lost.
        """
        if ids is None:
            with self._connected_port() as (_, wire):
                return wire.ping_all()
        models: dict[int, int | None] = dict.fromkeys(ids)
        for _ in range(_TRIES):
            silent = [number for number, model in models.items() if model is None]
            models |= {number: self.ping(number) for number in silent}
        return {number: model for number, model in models.items() if model is not None}

    def find(self, ids: Iterable[int]) -> dict[int, int]:
        """Return the model numbers by id of those of some devices that answer.

        Each attempt waits twice as long as the one before: on a busy computer an answer
        is late, not lost. Where some answer and others do not, there is one more.

        Raises:
            BackendError: the port is lost.
        """
        wanted, models = list(ids), dict[int, int]()
        for attempt in range(_TRIES + 1):
            if attempt == _TRIES and not models:
                break
            with self._as_patient(2**attempt):
                found = {n: self.ping(n) for n in wanted if n not in models}
            models |= {n: model for n, model in found.items() if model is not None}
        return models

    def read(self, number: int, block: Block) -> Answer | None:
        """Read a block of one device's table; None if it does not answer.

        Raises:
            BackendError: the port is lost.
        """
        if self._wait_left_s <= 0.0:
            return None
        with self._connected_port() as (port, wire):
            wire.ask(number, block)
            deadline = port.now() + 2.0 * self._wait_s(port, block)
            heard = self._listen(port, [number], block, deadline)
        self.sent += 1
        self.lost += 1 - len(heard)
        return heard.get(number)

    def read_all(self, ids: Sequence[int], block: Block, budget_s: float) -> Heard:
        """Read the same block of many servos' tables, of those that answer.

        Each servo answers after the one before it in the list, so all those after a
        dead servo are silent; they are asked again without it while time is left, and
        should be asked before it in the next read (`Heard.in_order`).

        Args:
            ids: ids of the servos, in this order.
            block: the block to read.
            budget_s: time limit of the whole read [s].

        Raises:
            BackendError: the port is lost.
        """
        port = self._connected()
        deadline = port.now() + budget_s
        answers, silent = dict[int, Answer](), set[int]()
        asked, silences, fast = list(ids), 0, self.fast
        while asked and silences < _SILENCES and port.now() < deadline:
            if self._wait_left_s <= 0.0:
                break
            # Servos missing in the one packet are asked again for packets of their own.
            request = self._fast_read if fast else self._sync_read
            heard, fast = request(asked, block, deadline), False
            answers |= heard
            silences = 0 if heard else silences + 1
            last = max((asked.index(number) for number in heard), default=-1)
            # A later request that the time limit ended is no silence of the next one.
            waited = len(asked) == len(ids) or port.now() < deadline
            silent.update(asked[: last + 1 + waited])
            asked = asked[last + 2 :]
            if not heard:
                # Neighbours fall silent together, where their cable ends.
                middle = len(asked) // 2
                asked = asked[middle:] + asked[:middle]
        self.sent += len(ids)
        self.lost += len(ids) - len(answers)
        return Heard(answers, frozenset(silent - answers.keys()))

    def try_fast(self, ids: Sequence[int]) -> None:
        """Find out whether all servos know fast sync reads, and use them if so.

        Which firmware does is not in the servos' tables, so they are asked.

        Raises:
            BackendError: the port is lost.
        """
        self.fast = False
        if self._wire is None or not self._wire.knows_fast:
            return
        for _ in range(_FAST_TRIES):
            if self._wait_left_s <= 0.0:
                return
            heard = self._fast_read(
                ids, self.make.present, self._connected().now() + _BUDGET_S
            )
            if len(heard) == len(ids):
                self.fast = True
                return

    def write_all(self, block: Block, values: Mapping[int, bytes]) -> None:
        """Write the same block of many servos' tables, without confirmation.

        Raises:
            BackendError: the port is lost.
        """
        with self._connected_port() as (_, wire):
            if not wire.write_all(block, values):
                raise OSError("not all bytes could be sent")

    def read_surely(self, ids: Sequence[int], block: Block) -> dict[int, bytes]:
        """Read a block of many tables, with retries for lost answers.

        Each attempt waits twice as long as the one before: on a busy computer an answer
        is late, not lost.

        Raises:
            BackendError: the port is lost.
        """
        found, missing = dict[int, bytes](), self._latest_first(ids)
        for attempt in range(_TRIES):
            if not missing:
                break
            with self._as_patient(2**attempt):
                heard = self.read_all(missing, block, _BUDGET_S)
            found |= {number: answer.data for number, answer in heard.answers.items()}
            left = (n for n in heard.in_order(missing) if n not in found)
            missing = self._latest_first(left)
        return found

    def write_surely(self, block: Block, values: Mapping[int, bytes]) -> list[int]:
        """Write a block of many tables, read it back, and retry where it differs.

        Each attempt waits twice as long as the one before.

        Returns:
            The ids whose table still differs, or that do not answer.

        Raises:
            BackendError: the port is lost.
        """
        left = self._latest_first(values)
        for attempt in range(_TRIES):
            self.write_all(block, {number: values[number] for number in left})
            with self._as_patient(2**attempt):
                heard = self.read_all(left, block, _BUDGET_S)
            shown = {number: answer.data for number, answer in heard.answers.items()}
            wrong = (n for n in heard.in_order(left) if shown.get(n) != values[n])
            left = self._latest_first(wrong)
            if not left:
                break
        return [number for number in values if number in left]

    def _latest_first(self, ids: Iterable[int]) -> list[int]:
        """Return ids in the order of their last answers, the latest one first.

        Behind some that are dead there may be no time for one that was late once.
        """
        return sorted(ids, key=lambda n: -self._answered_s.get(n, -math.inf))

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
        with self._connected_port() as (port, wire):
            wire.ask_all(ids, block)
            # The request itself is still being transmitted.
            head = (wire.request + len(ids)) * port.byte_s
            return self._listen(port, ids, block, deadline, head)

    def _fast_read(
        self, ids: Sequence[int], block: Block, deadline: float
    ) -> dict[int, Answer]:
        """Ask for one packet from all servos; return its sound parts."""
        with self._connected_port() as (port, wire):
            wire.ask_fast(ids, block)
            begin = port.now()
            size = wire.request + len(ids) + wire.fast_size(len(ids), block)
            longest = len(ids) * self.return_delay_s + self.patience_s
            left = max(deadline - begin, 0.0)
            port.wait_for(min(left, size * port.byte_s + longest))
            heard, complete = wire.receive_fast(ids, block.size)
            if not complete:
                self._wait_left_s -= port.now() - begin
        return heard

    def _listen(
        self,
        port: ServoPort,
        ids: Sequence[int],
        block: Block,
        deadline: float,
        head_s: float = 0.0,
    ) -> dict[int, Answer]:
        """Collect answers until that of the last servo, or until a timeout.

        Packets do not say which request they answer: a late one of the same size passes
        for a fresh one. What came before this request was sent has been discarded.
        """
        heard: dict[int, Answer] = {}
        wire = self._connected_wire()
        while ids[-1] not in heard:
            begin = port.now()
            left = deadline - begin
            if left <= 0.0:
                break
            port.wait_for(min(left, head_s + self._wait_s(port, block)))
            packet, result = wire.receive()
            if result == wire.timeout:
                self._wait_left_s -= port.now() - begin
                break
            found = wire.unpack(packet, block.size) if result == SUCCESS else None
            if found is not None and found[0] in ids:
                heard[found[0]] = found[1]
                self._answered_s[found[0]] = port.now()
            head_s = 0.0
        return heard

    def _wait_s(self, port: ServoPort, block: Block) -> float:
        """Return the longest time to the end of the next answer [s]."""
        line = (self._connected_wire().frame + block.size) * port.byte_s
        return line + self.return_delay_s + self.patience_s

    def _connected(self) -> ServoPort:
        if self._port is None:
            raise BackendError(f"{self.name}: not connected; connect first")
        return self._port

    def _connected_wire(self) -> Wire:
        self._connected()
        assert self._wire is not None  # made with the port
        return self._wire

    @contextlib.contextmanager
    def _connected_port(self) -> Iterator[tuple[ServoPort, Wire]]:
        """Yield the port and its packets; if it fails, close it and raise."""
        port, wire = self._connected(), self._connected_wire()
        port.is_using = False  # the SDK leaves it set if an answer is missing
        port.patience_s = self.patience_s
        self.spoke_s = time.monotonic()
        try:
            yield port, wire
        except _LOST as error:
            self.close()
            raise BackendError(
                f"{self.name}: lost ({error}); plug it in and connect again"
            ) from None
