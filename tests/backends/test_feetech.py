"""STS servos on a pseudo-terminal: Feetech's SDK, the backend, what differs."""

from contextlib import contextmanager
from functools import partial

import numpy as np
import pytest
from servo_bench import PATIENT_S, STAND, TURN, Clock, few

from gaitchain.backends.feetech import control_table as table
from gaitchain.backends.feetech.emulator import (
    EmulatedSts,
    EmulatedStsBus,
    StsReader,
    encode,
)
from gaitchain.backends.servos import ServoBackend, ServoBusEmulator
from gaitchain.backends.servos.bus import ServoBus
from gaitchain.backends.servos.bus_load import TURN_S, BusLoad
from gaitchain.backends.servos.calibration import Calibration, plain_calibration
from gaitchain.backends.servos.calibration_file import (
    calibration_text,
    parse_calibration,
)
from gaitchain.backends.servos.make import make_named
from gaitchain.backends.servos.search import opened, parse_ids
from gaitchain.errors import BackendError, CalibrationError, CommandError
from gaitchain.robot.box_robot import load_box_robot

sdk = pytest.importorskip("scservo_sdk")
MAKE = make_named("feetech")


def robot_of(count=2, **changes):
    return TURN(few(count, **changes), make="feetech")


@contextmanager
def bench(calibration=None, watchdog_s=2.5):
    calibration, clock = calibration or robot_of(), Clock()
    with ServoBusEmulator.like(calibration, clock=clock) as bus:
        names = calibration.joint_names
        robot = ServoBackend(
            bus.port, calibration, names, PATIENT_S, watchdog_s=watchdog_s
        )
        try:
            yield bus, robot, clock
        finally:
            robot.close()


@contextmanager
def connected(**more):
    with bench(**more) as (bus, robot, clock):
        robot.connect(np.zeros(2))
        yield bus, robot, clock


def test_a_late_answer_to_a_read_is_no_answer_to_a_ping(monkeypatch):
    """As after a read that a busy computer gave up."""
    with bench() as (emulated, _, _):
        answers = emulated.bus.answer
        earlier = encode(1, 0, bytes([0, 1, 0, 1]))
        monkeypatch.setattr(
            emulated.bus, "answer", lambda data: earlier + answers(data)
        )
        bus = ServoBus(emulated.port, 1_000_000, PATIENT_S, make=MAKE)
        bus.open()
        try:
            assert bus.ping(1) == 777
        finally:
            bus.close()


def test_feetechs_own_tools_find_the_emulation_sound(monkeypatch):
    """Whoever wrote the emulation did not write these."""
    monkeypatch.setattr("scservo_sdk.port_handler.LATENCY_TIMER", 500)  # ms
    with ServoBusEmulator.like(robot_of(3)) as bus:
        port = sdk.PortHandler(bus.port)
        assert port.openPort()
        servos = sdk.sms_sts(port)
        try:
            assert servos.ping(2) == (777, sdk.COMM_SUCCESS, 0)
            assert servos.ReadPos(3)[:2] == (2048, sdk.COMM_SUCCESS)
            bus.turn(3, -5.0)
            assert servos.ReadPos(3)[0] == round(-5.0 * 4096 / 360)
            assert servos.WritePosEx(1, 1000, 0, 0) == (sdk.COMM_SUCCESS, 0)
            assert servos.read2ByteTxRx(1, sdk.SMS_STS_GOAL_POSITION_L)[0] == 1000
            group = sdk.GroupSyncRead(servos, sdk.SMS_STS_PRESENT_POSITION_L, 4)
            for number in (1, 2, 3):
                group.addParam(number)
            assert group.txRxPacket() == sdk.COMM_SUCCESS
            assert group.isAvailable(3, sdk.SMS_STS_PRESENT_POSITION_L, 2)[0]
            assert group.getData(2, sdk.SMS_STS_PRESENT_POSITION_L, 2) == 2048
        finally:
            port.closePort()


def test_joints_go_where_they_are_sent_and_stay_there():
    calibration = robot_of(2)
    joints = calibration.joints
    joints = joints | {"b": TURN(joints["b"], sign=-1, offset=100.0, lower=-20.0)}
    with bench(TURN(calibration, joints=joints)) as (bus, robot, clock):
        robot.connect(np.zeros(2))
        assert not any(servo.torque for servo in bus.servos.values())
        robot.engage()
        robot.write(np.radians([30.0, -10.0]))
        robot.read()  # the goals have arrived
        clock.now += 1.0
        seen = robot.read()
        assert np.degrees(seen.joint_position) == pytest.approx([30, -10], abs=0.1)
        assert bus.angle_deg(1) == pytest.approx(210.0, abs=0.1)
        assert bus.angle_deg(2) == pytest.approx(110.0, abs=0.1)
        robot.release()
        assert not any(servo.torque for servo in bus.servos.values())


def test_engaging_holds_still_at_the_torque_limit():
    with connected(calibration=robot_of(2, pwm_limit=40.0)) as (bus, robot, clock):
        bus.turn(1, 200.0)
        robot.engage()
        clock.now += 1.0
        robot.read()
        assert bus.angle_deg(1) == pytest.approx(200.0, abs=0.1)
        limits = [s.read(table.TORQUE_LIMIT)[1] for s in bus.servos.values()]
        assert [int.from_bytes(data, "little") for data in limits] == [400, 400]


def test_moving_joints_have_velocity_and_current():
    with connected() as (_, robot, clock):
        robot.engage()
        robot.write(np.radians([60.0, -60.0]))
        robot.read()
        clock.now += 0.05
        seen = robot.read()
    assert np.degrees(seen.joint_velocity) == pytest.approx([270.0, -270.0], rel=0.01)
    assert robot.loads()[0] > 0.1
    assert robot.loads()[1] < -0.1


def test_a_servo_that_is_missing_is_nan_and_the_others_answer():
    calibration = robot_of(4)
    with bench(calibration) as (bus, robot, _):
        robot.connect(np.zeros(4))
        bus.kill(2)
        for _ in range(2):
            seen = robot.read().joint_position
            assert np.isnan(seen).tolist() == [False, True, False, False]


def test_an_overload_is_a_fault_with_a_name():
    with connected() as (bus, robot, _):
        robot.engage()
        bus.servos[2].fail(1 << 5)
        for _ in range(6):
            robot.read()
        assert "b (id 2) has let go: overload" in robot.health().fault


def test_after_a_silence_the_program_refuses_goals_until_it_engages_again():
    """The servos have no watchdog; the one of the program is this."""
    with connected(watchdog_s=0.02) as (bus, robot, _):
        robot.engage()
        robot._bus.spoke_s -= 1.0  # as if nothing had been sent for a second
        with pytest.raises(BackendError, match="engage again"):
            robot.write(np.zeros(2))
        assert all(servo.torque for servo in bus.servos.values())  # they hold on


def test_servos_hold_on_when_nobody_speaks():
    """What is not safe: unlike DYNAMIXEL, nothing in the servo ends it."""
    servo = EmulatedSts(1)
    servo.write(table.GOAL.address, (2148).to_bytes(2, "little"))
    servo.write(table.TORQUE.address, b"\1")
    servo.advance(1000.0)
    assert servo.torque
    assert servo.angle_deg == pytest.approx(2148 * 360 / 4096, abs=0.1)


def test_another_mode_or_model_is_refused():
    with bench() as (bus, robot, _):
        bus.servos[1].put(table.MODE, 1)
        with pytest.raises(BackendError, match=r"a \(id 1\).* mode 1 \(speed\).*FD"):
            robot.connect(np.zeros(2))
        bus.servos[1].put(table.MODE, 0)
        bus.servos[2].put(table.MODEL, 1284)
        with pytest.raises(BackendError, match="model 1284, no feetech servo"):
            robot.connect(np.zeros(2))


def test_bytes_are_those_of_the_packets():
    ids = list(range(1, 13))
    bus = EmulatedStsBus([EmulatedSts(number) for number in ids])
    block = bytes([table.PRESENT.address, table.PRESENT.size])
    request = encode(254, 0x82, block + bytes(ids))
    size = len(request) + len(bus.answer(request))
    load = BusLoad(12, 1_000_000, make=MAKE)
    assert load.read_s == pytest.approx(1e-5 * size + TURN_S)
    goals = b"".join(bytes([number, 0, 8]) for number in ids)
    request = encode(254, 0x83, bytes([table.GOAL.address, 2]) + goals)
    assert load.write_s == pytest.approx(
        1e-5 * (len(request) + len(bus.answer(request)))
    )
    with pytest.raises(BackendError, match=r"Baud Rate\(6\)|would fit") as told:
        BusLoad(40, 1_000_000, make=MAKE).check(0.01, "bus")
    assert "fast sync" not in str(told.value)
    assert load.most_servos(0.01) == 21  # as docs/connect_servos.md says


def test_more_servos_than_one_packet_of_the_sdk_holds_are_written():
    with ServoBusEmulator.like(robot_of(26)) as emulator:
        bus = ServoBus(emulator.port, 1_000_000, 0.2, make=MAKE)
        bus.open()
        motion = bytes(table.MOTION.size - 2) + b"\x90\x01"
        try:
            left = bus.write_surely(table.MOTION, dict.fromkeys(range(1, 27), motion))
        finally:
            bus.close()
        servos = emulator.servos.values()
        limits = {servo.read(table.TORQUE_LIMIT)[1] for servo in servos}
    assert left == []
    assert limits == {b"\x90\x01"}


def test_the_bus_is_searched_by_rate_and_id():
    with ServoBusEmulator.like(robot_of(3)) as emulator:
        emulator.kill(2)
        with opened(emulator.port, None, [1, 2, 3], MAKE) as (_, baud, models):
            assert baud == 1_000_000
            assert models == {1: 777, 3: 777}


def test_packets_are_found_among_other_bytes():
    rng, reader = np.random.default_rng(3), StsReader()
    wanted = [encode(number, 2, rng.bytes(5)) for number in range(1, 40)]
    noise = [bytes(rng.integers(0, 0xFF, 4, dtype=np.uint8)) for _ in wanted]
    stream = b"".join(b for pair in zip(noise, wanted, strict=True) for b in pair)
    pieces = [stream[i : i + 1] for i in range(len(stream))]
    found = [packet for piece in pieces for packet in reader.feed(piece)]
    assert [encode(p.number, p.instruction, p.data) for p in found] == wanted


def test_the_file_says_which_make():
    calibration = plain_calibration(load_box_robot("res"), make="feetech")
    text = calibration_text(calibration)
    assert 'make = "feetech"' in text
    assert parse_calibration(text) == calibration
    older = text.replace('make = "feetech"\n', "").replace("sts3215", "xm430-w350")
    assert parse_calibration(older).make == "dynamixel"
    mixed = text.replace("sts3215", "xm430-w350", 1)
    with pytest.raises(CalibrationError, match="sts3215"):
        parse_calibration(mixed)
    with pytest.raises(CalibrationError, match="allowed"):
        parse_calibration(text.replace('"feetech"', '"futaba"'))


def test_the_highest_id_that_is_found_can_be_written():
    calibration = robot_of(2)
    joints = calibration.joints
    last = TURN(calibration, joints=joints | {"b": TURN(joints["b"], id=253)})
    with (
        ServoBusEmulator.like(last, clock=Clock()) as emulated,
        opened(emulated.port, [1_000_000], None, MAKE) as (_, _, models),
    ):
        assert list(models) == [1, 253]
    assert parse_calibration(calibration_text(last)) == last
    assert parse_ids("252-253", MAKE) == [252, 253]
    beyond = calibration_text(last).replace("id = 253", "id = 254")
    with pytest.raises(CalibrationError, match=r"b\.id = 254: .* feetech .* 0 to 253"):
        parse_calibration(beyond)
    with pytest.raises(CommandError, match="ids from 0 to 253"):
        parse_ids("254", MAKE)


def test_res_stands_on_emulated_sts_servos():
    calibration: Calibration = plain_calibration(load_box_robot("res"), make="feetech")
    make = partial(ServoBackend, period_s=PATIENT_S, watchdog_s=2.5)
    with ServoBusEmulator.like(calibration, STAND) as bus:
        robot = make(bus.port, calibration, calibration.joint_names)
        robot.connect(STAND)
        try:
            seen = robot.read().joint_position
            assert seen == pytest.approx(STAND, abs=0.001)
            robot.engage()
            robot.write(STAND)
            assert robot.health().fault == ""
        finally:
            robot.close()
