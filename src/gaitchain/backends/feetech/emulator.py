"""An emulated STS servo and its packets, implemented without Feetech's SDK."""

from collections.abc import Iterator

from gaitchain.backends.feetech import control_table as table
from gaitchain.backends.servos.emulator.bus import BROADCAST, EmulatedBus, Packet
from gaitchain.backends.servos.emulator.motor import Motor
from gaitchain.backends.servos.emulator.port import Kinds
from gaitchain.backends.servos.emulator.servo import TableServo
from gaitchain.backends.servos.table import COUNTS, Block

HEADER = b"\xff\xff"
_PING, _READ, _WRITE, _SYNC_READ, _SYNC_WRITE = 1, 2, 3, 0x82, 0x83
_HEAD = 4  # bytes of header, id and length
_SHORTEST = 2  # length field: instruction and checksum
_PER_COUNT = 0.12  # of a lag's current [0.0065 A]
_MOST_CURRENT = 2000
_READ_ONLY = {*range(table.ID.address), *range(56, table.SIZE)}


def encode(number: int, kind: int, data: bytes = b"") -> bytes:
    """Return the bytes of a packet.

    Args:
        number: id of the receiver, or of the sender of an answer.
        kind: instruction, or error byte of an answer.
        data: parameters.
    """
    body = bytes([number, len(data) + 2, kind]) + data
    return HEADER + body + bytes([~sum(body) & 0xFF])


class StsReader:
    """A parser that finds packets in a stream of arbitrary bytes."""

    def __init__(self) -> None:
        """Start with an empty buffer."""
        self._heard = bytearray()

    def feed(self, data: bytes) -> Iterator[Packet]:
        """Append bytes, and yield each packet that they complete."""
        self._heard += data
        while len(self._heard) >= _HEAD:
            size = self._heard[3]
            begins = self._heard.startswith(HEADER) and self._heard[2] != 0xFF
            if not begins or size < _SHORTEST:
                del self._heard[0]
                continue
            end = _HEAD + size
            if len(self._heard) < end:
                return
            packet = bytes(self._heard[:end])
            if ~sum(packet[2:-1]) & 0xFF != packet[-1]:
                del self._heard[0]  # a packet may begin inside the invalid one
                continue
            del self._heard[:end]
            yield Packet(packet[2], packet[4], packet[5:-1])

    def drop(self) -> None:
        """Discard an incomplete packet."""
        self._heard.clear()


class EmulatedSts(TableServo):
    """An STS servo; without torque its motor is free, without a word it holds on.

    It answers pings and reads, and with status level 1 all instructions.
    """

    torque_at, status_level_at = table.TORQUE, table.STATUS_LEVEL
    errors_at = table.STATUS

    def __init__(
        self,
        number: int,
        model: int = 777,
        angle_deg: float = 180.0,
        speed_deg_s: float = 270.0,
        lag_s: float = 0.02,
    ) -> None:
        """Power the servo on; see `EmulatedXSeries`."""
        super().__init__(number, table.SIZE, Motor(angle_deg, speed_deg_s, lag_s))
        self._now = 0.0
        self.put(table.MODEL, model)
        self.put(table.ID, number)
        self.put(table.STATUS_LEVEL, 1)
        self.put(table.HIGHEST_POSITION, COUNTS - 1)
        self.put(table.TEMPERATURE_LIMIT, 70)
        self.reboot()

    def reboot(self) -> None:
        """Restart the servo: torque off, no error, RAM reset."""
        self._table[table.TORQUE.address :] = bytes(table.SIZE - table.TORQUE.address)
        self.put(table.TORQUE_LIMIT, 1000)
        self.put(table.VOLTAGE, 74)
        self.put(table.TEMPERATURE, 35)
        self.put(table.GOAL, round(self._motor.position) % COUNTS)

    @property
    def alert(self) -> int:
        """Error byte of every answer."""
        return self._get(table.STATUS)

    def hear(self, now: float) -> None:
        """Move on to the time of a packet [s]."""
        self.advance(now)

    def advance(self, now: float) -> None:
        """Advance the motion to a time [s]; it goes on also without any packet."""
        if self.torque:
            self._motor.follow(table.signed(self._get(table.GOAL)), now - self._now)
        else:
            self._motor.velocity = 0.0
        self._now = now

    def read(self, block: Block) -> tuple[int, bytes]:
        """Return the error, always 0, and the data; 0 beyond the table."""
        self._refresh()
        whole = bytes(self._table) + bytes(max(0, block.end - table.SIZE))
        return 0, whole[block.address : block.end]

    def write(self, address: int, data: bytes) -> int:
        """Write bytes from an address on, those that may be; return the error, 0."""
        for place, byte in enumerate(data, start=address):
            if place < table.SIZE and place not in _READ_ONLY:
                self._table[place] = byte
        limits = table.LOWEST_POSITION, table.HIGHEST_POSITION
        low, high = map(self._get, limits)
        goal = self._get(table.GOAL)
        self.put(table.GOAL, max(low, min(high, goal)))
        if self._get(table.STATUS):
            self.put(table.TORQUE, 0)
        self.torque_seen |= self.torque
        return 0

    def _refresh(self) -> None:
        """Write the measurements to the table."""
        motor = self._motor
        error = self._get(table.GOAL) - motor.position if self.torque else 0.0
        current = max(-_MOST_CURRENT, min(_MOST_CURRENT, round(_PER_COUNT * error)))
        for block, value in (
            (table.POSITION, round(motor.position)),
            (table.VELOCITY, round(motor.velocity)),
            (table.CURRENT, current),
        ):
            sign = 1 << table.SIGN if value < 0 else 0
            self.put(block, abs(value) | sign)


class EmulatedStsBus(EmulatedBus):
    """Emulated STS servos on a bus with random transmission faults.

    In a sync read each servo answers after the one before it; those after a servo that
    is missing are taken to be silent, as those of DYNAMIXEL are.
    """

    reader = StsReader

    def _answers(self, packet: Packet, now: float) -> Iterator[bytes]:
        """Yield what arrives of the answers to a packet."""
        for device in self._alive(self.devices):
            device.hear(now)
        for number, error, data in self._replies(packet):
            yield self._passed(encode(number, error, data))

    def _replies(self, packet: Packet) -> Iterator[tuple[int, int, bytes]]:
        kind, data = packet.instruction, packet.data
        if kind == _SYNC_READ and len(data) > 2:
            yield from self._sync_replies(Block(data[0], data[1]), data[2:])
        elif kind == _SYNC_WRITE and len(data) > 2:
            step = 1 + data[1]
            for at in range(2, len(data) - data[1], step):
                for device in self._alive([data[at]]):
                    device.write(data[0], data[at + 1 : at + step])
        elif packet.number != BROADCAST:
            for device in self._alive([packet.number]):
                if kind == _PING:
                    yield device.number, device.alert, b""
                elif kind == _READ and len(data) == 2:
                    yield device.number, device.alert, device.read(Block(*data))[1]
                elif kind == _WRITE and data:
                    device.write(data[0], data[1:])
                    if device.status_level:
                        yield device.number, device.alert, b""

    def _sync_replies(
        self, block: Block, ids: bytes
    ) -> Iterator[tuple[int, int, bytes]]:
        for number in ids:
            for device in self._alive([number]):
                yield number, device.alert, device.read(block)[1]
                break
            else:
                return


KINDS = Kinds(EmulatedSts, EmulatedStsBus)
