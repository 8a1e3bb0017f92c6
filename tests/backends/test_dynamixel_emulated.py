"""The emulated servos and their bus, without a port: protocol, motion, watchdog."""

import random
import struct

import numpy as np
import pytest
from servo_bench import Clock

from gaitchain.backends.dynamixel.control_table import (
    GOAL,
    GOAL_PWM,
    HARDWARE_ERROR,
    OPERATING_MODE,
    POSITION,
    PRESENT,
    PRESENT_FORMAT,
    STATUS_LEVEL,
    TORQUE,
    WATCHDOG,
    WATCHDOG_TRIPPED,
)
from gaitchain.backends.dynamixel.emulator import EmulatedXSeries, EmulatedXSeriesBus
from gaitchain.backends.dynamixel.emulator.packets import (
    STATUS,
    PacketReader,
    crc16,
    encode,
)
from gaitchain.backends.servos.calibration import ImuCalibration
from gaitchain.backends.servos.emulator import EmulatedImu
from gaitchain.backends.servos.emulator.bus import BROADCAST, Packet
from gaitchain.backends.servos.table import Block

PING, READ, WRITE, REG_WRITE, ACTION, REBOOT = 1, 2, 3, 4, 5, 8
SYNC_READ, SYNC_WRITE, BULK_READ, BULK_WRITE = 0x82, 0x83, 0x92, 0x93
OK, RESULT_FAIL, UNKNOWN, RANGE, LENGTH, LIMIT, ACCESS = 0, 1, 2, 4, 5, 6, 7


def two(*numbers):
    return b"".join(number.to_bytes(2, "little") for number in numbers)


def four(number):
    return number.to_bytes(4, "little")


class Bench:
    """Servos 1 to 3 at 180 deg."""

    def __init__(self, **more):
        self.clock = Clock()
        self.servos = {n: EmulatedXSeries(n, **more) for n in (1, 2, 3)}
        self.bus = EmulatedXSeriesBus(self.servos.values(), clock=self.clock)

    def send(self, number, instruction, data=b""):
        """Return (id, error, data) of every answer."""
        sent = self.bus.answer(encode(number, instruction, data))
        packets = list(PacketReader().feed(sent))
        assert all(packet.instruction == STATUS for packet in packets)
        return [(f.number, f.data[0], f.data[1:]) for f in packets]

    def write(self, number, block, value):
        data = two(block.address) + value.to_bytes(block.size, "little")
        ((_, error, _),) = self.send(number, WRITE, data)
        return error

    def read(self, number, block):
        ((_, error, data),) = self.send(number, READ, two(block.address, block.size))
        return data if error == OK else error

    def wait(self, seconds):
        """Let time pass, and each servo notice."""
        self.clock.now += seconds
        for servo in self.servos.values():
            servo.advance(self.clock.now)


def test_packets_are_those_of_the_protocol_page():
    """Pings and reads as the e-Manual prints them."""
    assert encode(1, PING).hex() == "fffffd0001030001194e"
    assert encode(BROADCAST, PING).hex() == "fffffd00fe0300013142"
    status = encode(1, STATUS, bytes([0, 6, 4, 0x26]))
    assert status.hex() == "fffffd000107005500060426655d"
    assert encode(1, READ, two(132, 4)).hex() == "fffffd000107000284000400" + "1d15"


def test_what_looks_like_a_header_is_stuffed():
    rng = random.Random(0)
    reader = PacketReader()
    for _ in range(2000):
        data = bytes(rng.choices([0xFF, 0xFD, 0, 1], k=rng.randrange(20)))
        packet = encode(5, WRITE, data)
        heads = packet.count(b"\xff\xff\xfd")
        assert heads == 1 + packet.count(b"\xff\xff\xfd\xfd")  # the first is real
        assert list(reader.feed(packet)) == [Packet(5, WRITE, data)]


def test_packets_are_found_among_noise_and_in_pieces():
    rng = random.Random(1)
    wanted, stream = [], b""
    for number in range(200):
        wanted.append(Packet(number, READ, rng.randbytes(rng.randrange(12))))
        stream += rng.randbytes(rng.randrange(6)).replace(b"\xff", b"\xfe")
        stream += encode(number, READ, wanted[-1].data)
    reader, found = PacketReader(), []
    while stream:
        size = rng.randint(1, 30)
        found += reader.feed(stream[:size])
        stream = stream[size:]
    assert found == wanted


def test_a_changed_byte_is_noticed():
    packet = encode(3, WRITE, bytes(range(20)))
    for place in range(len(packet)):
        changed = bytearray(packet)
        changed[place] ^= 0x10
        assert list(PacketReader().feed(bytes(changed))) == []


def test_everyone_answers_a_broadcast_ping_in_turn():
    answers = Bench().send(BROADCAST, PING)
    assert answers == [(n, OK, two(1020) + bytes([45])) for n in (1, 2, 3)]


def test_reading_and_writing():
    bench = Bench()
    assert bench.read(2, POSITION) == four(2048)
    assert bench.write(2, GOAL, 2000) == OK
    assert bench.read(2, GOAL) == four(2000)
    assert bench.send(9, READ, two(132, 4)) == []
    assert bench.send(BROADCAST, WRITE, two(65) + b"\1") == []  # nobody answers
    assert bench.read(3, Block(65, 1)) == b"\1"


@pytest.mark.parametrize(
    ("data", "error"),
    [
        (two(GOAL.address) + four(4096), RANGE),
        (two(GOAL.address) + b"\0\0", LENGTH),
        (two(PRESENT.address) + b"\0\0", ACCESS),
        (two(GOAL.address + 1) + four(0), ACCESS),
        (two(700) + b"\0", ACCESS),
        (two(TORQUE.address) + b"\2", RANGE),
        (b"\1", LENGTH),
        (b"", LENGTH),
    ],
)
def test_what_cannot_be_written_is_answered_with_an_error(data, error):
    assert Bench().send(1, WRITE, data) == [(1, error, b"")]


def test_errors_of_reads_and_unknown_instructions():
    bench = Bench()
    assert bench.send(1, READ, two(600, 100)) == [(1, ACCESS, b"")]
    assert bench.send(1, READ, b"\0") == [(1, LENGTH, b"")]
    assert bench.send(1, 0x77) == [(1, UNKNOWN, b"")]
    assert bench.send(1, ACTION) == [(1, UNKNOWN, b"")]


def test_rom_is_locked_while_the_torque_is_on():
    bench = Bench()
    assert bench.write(1, OPERATING_MODE, 4) == OK
    bench.write(1, TORQUE, 1)
    assert bench.write(1, OPERATING_MODE, 3) == ACCESS


def test_what_is_registered_waits_for_its_action():
    bench = Bench()
    bench.send(1, REG_WRITE, two(GOAL.address) + four(100))
    assert bench.read(1, GOAL) == four(2048)
    assert bench.send(1, ACTION) == [(1, OK, b"")]
    assert bench.read(1, GOAL) == four(100)


def test_sync_read_goes_in_the_order_asked_and_ends_at_the_first_who_is_missing():
    bench = Bench()
    ask = two(POSITION.address, 4)
    data = four(2048)
    answers = bench.send(BROADCAST, SYNC_READ, ask + bytes([3, 1, 2]))
    assert answers == [(3, OK, data), (1, OK, data), (2, OK, data)]
    bench.bus.dead.add(1)
    answers = bench.send(BROADCAST, SYNC_READ, ask + bytes([3, 1, 2]))
    assert answers == [(3, OK, data)]


def test_sync_write_bulk_read_and_bulk_write():
    bench = Bench()
    goals = b"\1" + four(10) + b"\3" + four(30)
    assert bench.send(BROADCAST, SYNC_WRITE, two(GOAL.address, 4) + goals) == []
    parts = b"\2" + two(GOAL.address, 4) + four(20) + b"\1" + two(65, 1) + b"\1"
    assert bench.send(BROADCAST, BULK_WRITE, parts) == []
    ask = b"".join(bytes([n]) + two(GOAL.address, 4) for n in (1, 2, 3))
    answers = bench.send(BROADCAST, BULK_READ, ask + b"\1" + two(65, 1))
    assert [data for _, _, data in answers] == [four(10), four(20), four(30), b"\1"]


def test_a_servo_with_another_status_level_keeps_quiet():
    bench = Bench()
    bench.servos[1].put(STATUS_LEVEL, 1)
    assert bench.send(1, WRITE, two(65) + b"\1") == []
    assert bench.read(1, Block(65, 1)) == b"\1"
    bench.servos[1].put(STATUS_LEVEL, 0)
    assert bench.send(1, READ, two(65, 1)) == []
    assert len(bench.send(1, PING)) == 1


def test_a_servo_moves_only_with_its_torque_on_at_limited_speed_to_its_goal():
    bench = Bench(speed_deg_s=90.0, lag_s=0.05)
    bench.write(1, GOAL, 1024)  # 90 deg
    bench.wait(1.0)
    assert bench.servos[1].angle_deg == pytest.approx(180.0, abs=0.1)
    bench.write(1, TORQUE, 1)
    bench.wait(0.5)
    assert bench.servos[1].angle_deg == pytest.approx(135.0, abs=0.1)
    velocity = int.from_bytes(bench.read(1, PRESENT)[2:6], "little", signed=True)
    assert velocity == pytest.approx(-15.0 / 0.229, abs=1.0)  # 90 deg/s, 15 rev/min
    bench.wait(2.0)
    assert bench.servos[1].angle_deg == pytest.approx(90.0, abs=0.01)


def test_how_often_it_is_looked_at_makes_no_difference():
    seen = []
    for pieces in (1, 7, 400):
        bench = Bench(speed_deg_s=200.0, lag_s=0.1)
        bench.write(1, TORQUE, 1)
        bench.write(1, GOAL, 2400)
        for _ in range(pieces):
            bench.wait(0.3 / pieces)
        seen.append(bench.servos[1].angle_deg)
    assert seen == pytest.approx([seen[0]] * 3, abs=1e-9)


def test_the_watchdog_stops_a_servo_that_hears_nothing_and_refuses_goals():
    bench = Bench(speed_deg_s=100.0, lag_s=0.01)
    bench.write(1, WATCHDOG, 10)  # 0.2 s
    bench.wait(5.0)
    assert bench.servos[1].watchdog == 10  # its torque is off
    bench.send(2, PING)
    bench.write(1, TORQUE, 1)
    bench.write(1, GOAL, 0)
    for _ in range(5):  # any packet on the bus will do
        bench.wait(0.15)
        bench.send(3, PING)
    at = bench.servos[1].angle_deg
    assert at == pytest.approx(180.0 - 75.0, abs=0.5)
    bench.wait(10.0)
    assert bench.servos[1].angle_deg == pytest.approx(at - 20.0, abs=0.5)
    assert bench.servos[1].watchdog == WATCHDOG_TRIPPED
    assert bench.servos[1].torque
    assert bench.write(1, GOAL, 500) == RANGE
    assert bench.write(1, GOAL_PWM, 500) == RANGE
    assert bench.write(1, WATCHDOG, 10) == RANGE
    assert bench.write(1, WATCHDOG, 0) == OK
    assert bench.write(1, GOAL, 500) == OK


def test_a_hardware_error_lets_go_and_is_told_in_every_answer():
    bench = Bench()
    bench.write(1, TORQUE, 1)
    bench.servos[1].fail(0x20)
    assert bench.send(1, PING)[0][1] == 0x80
    assert not bench.servos[1].torque
    assert bench.write(1, TORQUE, 1) == RESULT_FAIL | 0x80
    bench.send(1, REBOOT)
    assert bench.read(1, HARDWARE_ERROR) == b"\0"
    assert bench.write(1, TORQUE, 1) == OK


def test_an_imu_measures_in_the_axes_that_it_is_mounted_in():
    mounted = ImuCalibration(200, 38, 44, 0.001, 0.01, axes=("-y", "x", "z"))
    imu = EmulatedImu(mounted)
    imu.noise_factor = 0.0
    imu.angular_velocity = np.array([1.0, 2.0, 3.0])
    error, data = imu.read(Block(38, 12))
    counts = np.frombuffer(data, "<i2")
    assert error == OK
    assert counts[:3].tolist() == [2000, -1000, 3000]  # x of the trunk is -y of the IMU
    assert counts[3:].tolist() == [0, 0, 981]
    assert imu.read(Block(1099, 9))[0] == imu.write(38, b"\0") == ACCESS


def test_faults_are_the_same_for_the_same_seed():
    def heard(seed):
        bench = Bench()
        bench.bus = EmulatedXSeriesBus(bench.servos.values(), seed, bench.clock)
        bench.bus.drop, bench.bus.corrupt = 0.2, 0.2
        ask = encode(BROADCAST, SYNC_READ, two(132, 4) + bytes([1, 2, 3]))
        return [bench.bus.answer(ask) for _ in range(50)]

    assert heard(1) == heard(1) != heard(2)


@pytest.mark.slow
def test_a_hundred_thousand_odd_messages_do_no_harm():
    bench = Bench()
    imu = EmulatedImu(ImuCalibration(200, 38, 44, 0.001, 0.01))
    bus = EmulatedXSeriesBus([*bench.servos.values(), imu], clock=bench.clock)
    rng = random.Random(7)
    kinds = [1, 2, 3, 4, 5, 6, 8, 16, 0x55, 0x82, 0x83, 0x8A, 0x92, 0x93]
    for _ in range(100_000):
        chance = rng.random()
        if chance < 0.3:
            message = rng.randbytes(rng.randrange(16))
        else:
            number = rng.choice([1, 2, 3, 200, 253, BROADCAST])
            data = bytes(rng.choices(b"\0\1\2@bt\xff", k=rng.randrange(14)))
            message = encode(number, rng.choice(kinds), data)
            if chance < 0.6:
                changed = bytearray(message)
                changed[rng.randrange(len(changed))] ^= rng.randint(1, 255)
                message = bytes(changed)
        bus.answer(message)
        bench.clock.now += 0.03 if chance > 0.95 else 0.0
    bench.clock.now += 1.0
    for servo in bench.servos.values():
        servo.reboot()
        servo.put(STATUS_LEVEL, 2)
    assert len(bench.send(BROADCAST, PING)) == 3


def test_the_crc_is_that_of_the_sdk():
    sdk = pytest.importorskip("dynamixel_sdk")
    rng = random.Random(3)
    for size in range(60):
        data = rng.randbytes(size)
        assert crc16(data) == sdk.Protocol2PacketHandler().updateCRC(0, data, size)


@pytest.mark.parametrize(
    ("model", "counts"),
    [(1020, 228), (1310, 228), (1200, 614), (1060, 0), (9999, 0)],
)
def test_a_current_is_in_the_unit_of_the_model(model, counts):
    """20 A/rad times 20 of 4096 counts; two models have no known unit."""
    servo = EmulatedXSeries(1, model, angle_deg=180.0)
    assert not servo.write(TORQUE.address, b"\1")
    assert not servo.write(GOAL.address, four(2048 + 20))
    _, data = servo.read(PRESENT)
    assert struct.unpack(PRESENT_FORMAT, data)[0] == counts
