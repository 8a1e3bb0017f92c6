"""Requests on the bus: the SDK against the emulation, lost packets, fuzz."""

import random
import struct
import subprocess
import sys
import time

import numpy as np
import pytest
from servo_bench import TURN, few

from gaitchain.backends.dynamixel.control_table import (
    GOAL,
    POSITION,
    PRESENT,
    PRESENT_FORMAT,
    TORQUE,
)
from gaitchain.backends.dynamixel.emulator.packets import STATUS, encode
from gaitchain.backends.dynamixel.make import MAKE
from gaitchain.backends.makes import MAKES
from gaitchain.backends.servos import ServoBusEmulator
from gaitchain.backends.servos.bus import ServoBus
from gaitchain.backends.servos.make import make_named
from gaitchain.backends.servos.port import ServoPort
from gaitchain.backends.servos.search import opened, parse_ids
from gaitchain.backends.servos.table import Block
from gaitchain.errors import BackendError, CommandError, MissingExtraError

PATIENT_S, BUDGET_S = 0.2, 3.0
sdk = pytest.importorskip("dynamixel_sdk")


@pytest.fixture
def emulator():
    with ServoBusEmulator.like(few(4)) as emulator:
        yield emulator


@pytest.fixture
def bus(emulator):
    bus = ServoBus(emulator.port, 1_000_000, PATIENT_S, make=MAKE)
    bus.open()
    yield bus
    bus.close()


def counts(answers):
    return {
        number: int.from_bytes(answer.data, "little")
        for number, answer in answers.items()
    }


def test_the_sdks_own_tools_find_the_emulation_sound(emulator, monkeypatch):
    """Whoever wrote the emulation did not write these."""
    monkeypatch.setattr("dynamixel_sdk.port_handler.LATENCY_TIMER", 500)  # ms
    port = sdk.PortHandler(emulator.port)
    packets = sdk.PacketHandler(2.0)
    assert port.openPort()
    try:
        assert packets.ping(port, 2) == (1020, sdk.COMM_SUCCESS, 0)
        assert packets.write4ByteTxRx(port, 1, 116, 2000) == (sdk.COMM_SUCCESS, 0)
        assert packets.read4ByteTxRx(port, 1, 116) == (2000, sdk.COMM_SUCCESS, 0)
        assert packets.write4ByteTxRx(port, 1, 116, 5000)[1] == 4
        writer = sdk.GroupSyncWrite(port, packets, 116, 4)
        for number in (1, 2, 3, 4):
            writer.addParam(number, [number, 1, 0, 0])
        assert writer.txPacket() == sdk.COMM_SUCCESS
        reader = sdk.GroupSyncRead(port, packets, 116, 4)
        for number in (4, 2, 1, 3):
            reader.addParam(number)
        assert reader.txRxPacket() == sdk.COMM_SUCCESS
        goals = [reader.getData(n, 116, 4) for n in (1, 2, 3, 4)]
        assert goals == [257, 258, 259, 260]
        bulk = sdk.GroupBulkRead(port, packets)
        bulk.addParam(1, 116, 4)
        bulk.addParam(3, 146, 1)
        assert bulk.txRxPacket() == sdk.COMM_SUCCESS
        assert (bulk.getData(1, 116, 4), bulk.getData(3, 146, 1)) == (257, 35)
        assert packets.regWriteTxRx(port, 2, 65, 1, [1]) == (sdk.COMM_SUCCESS, 0)
        packets.action(port, 254)  # one servo would answer, and the SDK not listen
        assert packets.read1ByteTxRx(port, 2, 65)[0] == 1
        assert packets.reboot(port, 2) == (sdk.COMM_SUCCESS, 0)
        assert packets.read1ByteTxRx(port, 2, 65)[0] == 0
    finally:
        port.closePort()


@pytest.mark.parametrize("late", [1, 2])
def test_a_late_answer_to_a_read_is_no_answer_to_a_ping(
    emulator, bus, monkeypatch, late
):
    """As after a read that a busy computer gave up; the SDK takes it for one."""
    answers = emulator.bus.answer
    earlier = encode(late, STATUS, bytes([0, 0, 0, 1, 0, 0, 0, 0]))
    monkeypatch.setattr(emulator.bus, "answer", lambda data: earlier + answers(data))
    assert bus.ping(1) == 1020


def test_answers_come_by_id(bus):
    bus.write_all(GOAL, {n: (1000 + n).to_bytes(4, "little") for n in (1, 2, 3, 4)})
    answers = bus.read_all([3, 1, 4, 2], GOAL, BUDGET_S).answers
    assert counts(answers) == {1: 1001, 2: 1002, 3: 1003, 4: 1004}
    assert counts({7: bus.read(2, GOAL)}) == {7: 1002}
    assert (bus.sent, bus.lost) == (5, 0)


def test_stuffed_answers_are_read(emulator, bus):
    """FF FF FD in an answer, as a slow backward turn has it, would be a header."""
    present = struct.pack(PRESENT_FORMAT, -1, -3, 100)
    assert b"\xff\xff\xfd" in present
    servo = emulator.servos[1]
    servo.put(Block(80, 4), 0xFDFFFF)  # gains, which it does not compute
    assert bus.read(1, Block(80, 4)).data == b"\xff\xff\xfd\0"


@pytest.mark.parametrize("dead", [1, 2, 4])
def test_those_behind_a_dead_servo_are_asked_again(emulator, bus, dead):
    emulator.kill(dead)
    answers = bus.read_all([1, 2, 3, 4], POSITION, BUDGET_S).answers
    assert set(answers) == {1, 2, 3, 4} - {dead}
    assert (bus.sent, bus.lost) == (4, 1)


@pytest.mark.parametrize("make", MAKES)
@pytest.mark.parametrize("dead", [{3, 4}, {1, 2, 3, 4}, {1, 2, 5, 6}, {1, 2, 7, 8}])
def test_nobody_is_asked_in_vain_for_those_before(make, dead):
    """A cable that is pulled midway, or a leg of two without supply."""
    with ServoBusEmulator.like(TURN(few(8), make=make)) as emulator:
        bus = ServoBus(emulator.port, 1_000_000, 0.02, make=make_named(make))
        bus.open()
        try:
            goal, ids = bus.make.goal, range(1, 9)
            values = {n: bus.make.goal_data(1000 + n) for n in ids}
            for number in dead:
                emulator.kill(number)
            assert bus.write_surely(goal, values) == sorted(dead)
            alive = {n: values[n] for n in ids if n not in dead}
            assert bus.read_surely(list(ids), goal) == alive
        finally:
            bus.close()


def test_only_who_had_a_turn_is_known_to_be_silent(emulator, bus):
    bus.patience_s = 0.02
    emulator.cut()
    answers, silent = bus.read_all([1, 2, 3, 4], POSITION, BUDGET_S)
    assert (answers, len(silent)) == ({}, 2)  # asked twice, who came first
    emulator.restore()
    emulator.kill(2)
    answers, silent = bus.read_all([1, 2, 3, 4], POSITION, BUDGET_S)
    assert (set(answers), silent) == ({1, 3, 4}, {2})


def test_a_silent_bus_is_given_up(emulator, bus):
    emulator.cut()
    bus.patience_s = 0.01
    assert bus.read_all([1, 2, 3, 4], POSITION, 0.1).answers == {}
    assert bus.read(1, POSITION) is None
    assert bus.ping(1) is None
    emulator.restore()
    bus.patience_s = PATIENT_S
    assert len(bus.read_all([1, 2, 3, 4], POSITION, BUDGET_S).answers) == 4


def test_late_answers_of_another_request_are_not_taken(emulator, bus):
    """An answer of another length is of another request."""
    emulator.cut()
    bus.patience_s = 0.0
    bus.read_all([1], Block(132, 4), 0.01)
    late = encode(2, STATUS, b"\0" + b"\7\7")
    emulator.restore()
    answer = emulator.bus.answer
    emulator.bus.answer = lambda data: late + answer(data)
    bus.patience_s = PATIENT_S
    assert counts(bus.read_all([1, 2], POSITION, BUDGET_S).answers) == {
        1: 2048,
        2: 2048,
    }


def test_a_scan_finds_who_is_there(emulator, bus):
    assert bus.scan() == dict.fromkeys((1, 2, 3, 4), 1020)
    emulator.kill(2)
    assert bus.scan(range(1, 4)) == {1: 1020, 3: 1020}


def test_a_lost_port_is_said_and_closed(emulator, bus):
    emulator.unplug()
    with pytest.raises(BackendError, match=r"lost .*connect again"):
        bus.read_all([1], POSITION, BUDGET_S)
    assert not bus.is_open
    with pytest.raises(BackendError, match="not connected"):
        bus.write_all(TORQUE, {1: b"\0"})
    with pytest.raises(BackendError, match="cannot be opened"):
        bus.open()
    emulator.replug()
    bus.open()
    assert bus.ping(1) == 1020


def test_a_port_is_for_one_program(emulator, bus):
    second = ServoBus(emulator.port, 1_000_000, PATIENT_S, make=MAKE)
    with pytest.raises(BackendError, match="no other program has it"):
        second.open()


def test_without_the_sdk_it_says_what_to_install(emulator, monkeypatch):
    monkeypatch.setitem(sys.modules, "dynamixel_sdk", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'gaitchain\[servos\]'"):
        ServoBus(emulator.port, 1_000_000, PATIENT_S, make=MAKE).open()


def test_the_sdk_is_loaded_only_when_a_port_is_opened():
    code = (
        "import sys, gaitchain.backends.servos; "
        "assert not {'serial', 'dynamixel_sdk', 'mujoco'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_a_bus_is_searched_at_the_usual_rates(emulator):
    with opened(emulator.port, [57_600], [2, 9], MAKE) as (bus, baud, models):
        assert (baud, models) == (57_600, {2: 1020})
        assert bus.is_open
    assert not bus.is_open
    emulator.cut()
    with (
        pytest.raises(
            BackendError,
            match=r"nobody answers at 9600, 57600 bit/s; .* make \(--make\)",
        ),
        opened(emulator.port, [9600, 57_600], [1], MAKE),
    ):
        pass


def test_ids_are_read():
    assert parse_ids("1-3, 200", MAKE) == [1, 2, 3, 200]
    for text in ("", "a", "3-1", "253", "1-", "-1", "1-2-3", "²"):
        with pytest.raises(CommandError, match="--ids"):
            parse_ids(text, MAKE)


class Memory(ServoPort):
    """A port whose other end is a list of bytes; it never waits."""

    now = staticmethod(time.monotonic)

    def __init__(self, name, baud, patience_s):
        self.patience_s, self._baud = patience_s, baud
        self.arrived = b""
        self.next = b""

    def close(self):
        pass

    def clearPort(self):
        pass

    def writePort(self, packet):
        self.arrived = self.next
        return len(packet)

    def readPort(self, length):
        taken, self.arrived = (
            self.arrived[: max(length, 0)],
            self.arrived[max(length, 0) :],
        )
        return taken

    def isPacketTimeout(self):
        return not self.arrived


class Late(Memory):
    """A port at which an answer arrives only for who waits long enough."""

    late_s = 0.0

    def writePort(self, packet):
        self.arrived = self.next if self.patience_s >= self.late_s else b""
        return len(packet)


class LateFor(Late):
    """The same; how long depends on the device that is asked."""

    def writePort(self, packet):
        asked = packet[4]
        self.late_s = {1: 0.01, 2: 0.1, 3: 0.2}[asked]
        self.next = encode(asked, STATUS, b"\0" + (1020).to_bytes(2, "little") + b"\0")
        return super().writePort(packet)


def test_a_device_is_asked_once_more_where_another_one_answers():
    """With the supply off all are silent: nobody waits longer for that."""
    bus = ServoBus(
        "late", 1_000_000, 0.01, lambda *_: LateFor("late", 1_000_000, 0.01), make=MAKE
    )
    bus.open()
    assert bus.find([1, 2, 3]) == {1: 1020, 2: 1020}
    assert bus.find([2]) == {}


@pytest.mark.parametrize(
    ("late_s", "found"), [(0.01, True), (0.08, True), (0.1, False)]
)
def test_what_must_succeed_waits_twice_as_long_at_each_attempt(late_s, found):
    """On a busy computer answers are late, not lost."""
    port = Late("late", 1_000_000, 0.01)
    port.late_s, value = late_s, bytes(GOAL.size)
    port.next = encode(1, STATUS, b"\0" + value)
    bus = ServoBus("late", 1_000_000, 0.01, lambda *_: port, make=MAKE)
    bus.open()
    assert bus.read_surely([1], GOAL) == ({1: value} if found else {})
    port.next = encode(1, STATUS, b"\0" + (1020).to_bytes(2, "little") + b"\0")
    assert bus.find([1]) == ({1: 1020} if found else {})
    port.next = encode(1, STATUS, b"\0" + value)
    assert bus.write_surely(GOAL, {1: value}) == ([] if found else [1])
    assert bus.patience_s == 0.01


@pytest.mark.slow
def test_a_hundred_thousand_odd_answers_do_no_harm():
    """What survives its CRC is right; nothing raises, nothing hangs."""
    rng = random.Random(11)
    made = []
    bus = ServoBus(
        "memory",
        1_000_000,
        0.0,
        lambda *a: made.append(Memory(*a)) or made[0],
        make=MAKE,
    )
    bus.open()
    memory, packets, whole = made[0], 0, 0
    present = bytes(range(PRESENT.size))
    sound = {n: encode(n, STATUS, b"\0" + present) for n in range(1, 13)}
    while packets < 100_000:
        stream = b""
        for number in range(1, 13):
            chance = rng.random()
            packet = sound[number]
            if chance < 0.2:
                changed = bytearray(packet)
                changed[rng.randrange(len(changed))] ^= rng.randint(1, 255)
                packet = bytes(changed)
            elif chance < 0.3:
                packet = packet[: rng.randrange(len(packet))]
            elif chance < 0.4:
                packet = rng.randbytes(rng.randrange(40))
            elif chance < 0.5:
                data = rng.randbytes(rng.randrange(16))
                packet = encode(rng.choice([1, 5, 12, 200]), STATUS, data)
            stream += packet
            packets += 1
        memory.next = stream
        answers = bus.read_all(list(range(1, 13)), PRESENT, 10.0).answers
        assert set(answers) <= set(range(1, 13))
        whole += sum(answer.data == present for answer in answers.values())
    assert whole > 0.3 * packets  # the sound ones among them are found
    assert np.isfinite(bus.lost)


def test_the_sdks_own_fast_sync_read_finds_the_emulation_sound(emulator, monkeypatch):
    monkeypatch.setattr("dynamixel_sdk.port_handler.LATENCY_TIMER", 500)  # ms
    port, packets = sdk.PortHandler(emulator.port), sdk.PacketHandler(2.0)
    assert port.openPort()
    group = sdk.GroupSyncRead(port, packets, POSITION.address, POSITION.size)
    try:
        for number in (3, 1, 4):
            group.addParam(number)
            emulator.turn(number, 90.0 * number % 360.0)
        assert group.fastSyncRead() == sdk.COMM_SUCCESS
        for number in (3, 1, 4):
            counts = group.getData(number, POSITION.address, POSITION.size)
            assert counts == 1024 * number % 4096
    finally:
        port.closePort()


def test_a_fast_sync_read_says_what_single_answers_say(emulator, bus):
    for number in (1, 2, 3, 4):
        emulator.turn(number, 40.0 * number)
    ids = [4, 2, 1, 3]
    plain = bus.read_all(ids, PRESENT, BUDGET_S).answers
    bus.try_fast(ids)
    assert bus.fast
    assert bus.read_all(ids, PRESENT, BUDGET_S).answers == plain
    assert set(plain) == set(ids)


def test_servos_without_fast_sync_read_are_read_one_by_one(emulator, bus):
    emulator.bus.fast = False
    bus.patience_s = 0.02
    bus.try_fast([1, 2])
    assert not bus.fast
    assert set(bus.read_all([1, 2], POSITION, BUDGET_S).answers) == {1, 2}


def test_behind_a_dead_servo_fast_sync_reads_still_find_the_others(emulator, bus):
    bus.try_fast([1, 2, 3, 4])
    emulator.kill(2)
    bus.patience_s = 0.02
    assert set(bus.read_all([1, 2, 3, 4], POSITION, BUDGET_S).answers) == {1, 3, 4}


@pytest.mark.parametrize("seed", range(3))
def test_no_byte_of_a_corrupted_fast_answer_is_believed(seed):
    with ServoBusEmulator.like(few(4), seed=seed) as emulator:
        bus = ServoBus(emulator.port, 1_000_000, 0.02, make=MAKE)
        bus.open()
        try:
            bus.try_fast([1, 2, 3, 4])
            emulator.bus.corrupt = 0.3
            heard = [
                counts(bus.read_all([1, 2, 3, 4], POSITION, 1.0).answers)
                for _ in range(30)
            ]
        finally:
            bus.close()
    assert bus.fast
    assert any(len(answers) < 4 for answers in heard)
    assert {count for answers in heard for count in answers.values()} == {2048}
