"""A bus of emulated X-series servos, which answer packets of protocol 2.0."""

from collections.abc import Iterator

from gaitchain.backends.dynamixel.emulator.packets import (
    MOST,
    STATUS,
    PacketReader,
    crc16,
    encode,
    head,
)
from gaitchain.backends.dynamixel.emulator.servo import LENGTH, OK, Device
from gaitchain.backends.servos.emulator.bus import BROADCAST, EmulatedBus, Packet
from gaitchain.backends.servos.table import Block

_PING, _READ, _WRITE, _REG_WRITE, _ACTION, _REBOOT = 1, 2, 3, 4, 5, 8
_SYNC_READ, _SYNC_WRITE, _BULK_READ, _BULK_WRITE = 0x82, 0x83, 0x92, 0x93
_FAST_SYNC_READ = 0x8A
_INSTRUCTION_ERROR = 2
_HEAD = 4  # bytes of address and length in a request
_PART = 4  # error, id and CRC of a servo's part of the answer to a fast sync read


_Status = tuple[Device, int, bytes]


class EmulatedXSeriesBus(EmulatedBus):
    """Emulated X-series servos on a bus with random transmission faults."""

    reader = PacketReader

    def _answers(self, packet: Packet, now: float) -> Iterator[bytes]:
        """Yield what arrives of the answers to a packet."""
        if packet.instruction == _FAST_SYNC_READ:
            yield from self._fast_sync_read(packet.data, now)
            return
        yield from map(self._passed, self._carry_out(packet, now))

    def _fast_sync_read(self, data: bytes, now: float) -> Iterator[bytes]:
        """Yield the parts of one packet; a servo waits for the part before its own."""
        for device in self._alive(self.devices):
            device.hear(now)
        found = list(self._sync_read(data))
        size = sum(_PART + len(values) for _, _, values in found[:1]) * len(
            data[_HEAD:]
        )
        refused = any(error for _, error, _ in found) or size > MOST
        if not (self.fast and found) or refused:
            return
        sent = arrived = head(BROADCAST, size) + bytes([STATUS])
        for device, error, values in found:
            part = bytes([error | device.alert, device.number])
            part += values
            part += crc16(sent + part).to_bytes(2, "little")
            sent += part
            part = self._passed(arrived + part)
            if not part:
                return
            arrived = b""
            yield part

    def _carry_out(self, packet: Packet, now: float) -> Iterator[bytes]:
        if packet.instruction == STATUS:
            return
        for device in self._alive(self.devices):
            device.hear(now)
        for device, error, data in self._statuses(packet):
            status = bytes([error | device.alert]) + data
            yield encode(device.number, STATUS, status)

    def _statuses(self, packet: Packet) -> Iterator[_Status]:
        kind = packet.instruction
        if kind == _SYNC_READ:
            yield from self._sync_read(packet.data)
        elif kind == _BULK_READ:
            yield from self._bulk_read(packet.data)
        elif kind == _SYNC_WRITE:
            self._sync_write(packet.data)
        elif kind == _BULK_WRITE:
            self._bulk_write(packet.data)
        else:
            everyone = packet.number == BROADCAST
            for device in self._alive(self.devices if everyone else [packet.number]):
                error, data = self._single(device, kind, packet.data)
                least = {_PING: 0, _READ: 1}.get(kind, 2)
                if device.status_level >= least and (kind == _PING or not everyone):
                    yield device, error, data

    def _single(self, device: Device, kind: int, data: bytes) -> tuple[int, bytes]:
        """Execute an instruction to one device; return the error and the answer."""
        if kind == _PING:
            return OK, device.ping_data
        if kind in (_READ, _WRITE, _REG_WRITE):
            return self._access(device, kind, data)
        if kind == _ACTION and device.registered is not None:
            registered, device.registered = device.registered, None
            return device.write(*registered), b""
        if kind == _REBOOT:
            device.reboot()
            return OK, b""
        return _INSTRUCTION_ERROR, b""

    def _access(self, device: Device, kind: int, data: bytes) -> tuple[int, bytes]:
        """Read or write a device's table, or register a write for later."""
        if len(data) <= 2 or (kind == _READ and len(data) != _HEAD):
            return LENGTH, b""
        if kind == _READ:
            return device.read(_block(data))
        address = int.from_bytes(data[:2], "little")
        if kind == _WRITE:
            return device.write(address, data[2:]), b""
        device.registered = address, data[2:]
        return OK, b""

    def _sync_read(self, data: bytes) -> Iterator[_Status]:
        if len(data) > _HEAD:
            block = _block(data)
            yield from self._in_turn([(number, block) for number in data[_HEAD:]])

    def _bulk_read(self, data: bytes) -> Iterator[_Status]:
        parts = [data[i : i + 5] for i in range(0, len(data), 5)]
        if all(len(part) == 5 for part in parts):
            yield from self._in_turn([(part[0], _block(part[1:])) for part in parts])

    def _in_turn(self, asked: list[tuple[int, Block]]) -> Iterator[_Status]:
        """Yield the answers in order, up to the first device that does not answer."""
        for number, block in asked:
            for device in self._alive([number]):
                if device.status_level >= 1:
                    yield device, *device.read(block)
                    break
            else:
                return

    def _sync_write(self, data: bytes) -> None:
        if len(data) < _HEAD:
            return
        block = _block(data)
        step = 1 + block.size
        for at in range(_HEAD, len(data) - block.size, step):
            for device in self._alive([data[at]]):
                device.write(block.address, data[at + 1 : at + step])

    def _bulk_write(self, data: bytes) -> None:
        while len(data) > _HEAD:
            block = _block(data[1:])
            end = _HEAD + 1 + block.size
            for device in self._alive([data[0]]) if len(data) >= end else ():
                device.write(block.address, data[_HEAD + 1 : end])
            data = data[end:]


def _block(data: bytes) -> Block:
    """Parse address and length."""
    parts = data[:2], data[2:_HEAD]
    return Block(*(int.from_bytes(part, "little") for part in parts))
