"""The backend against emulated servos on a real pseudo-terminal."""

import subprocess
import sys
import threading
import time
from contextlib import ExitStack, nullcontext
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from patience import PATIENCE_S, Deadline
from servo_bench import (
    PATIENT_S,
    STAND,
    TURN,
    angles_deg,
    bench,
    few,
    mounted_oddly,
    patient_bus,
)

from gaitchain.backends.dynamixel.control_table import (
    GOAL,
    GOAL_PWM,
    HIGHEST_POSITION,
    OPERATING_MODE,
    PROFILE,
    PWM_LIMIT,
    RETURN_DELAY,
    STATUS_LEVEL,
    TEMPERATURE,
    VOLTAGE,
    WATCHDOG_TRIPPED,
)
from gaitchain.backends.makes import MAKES
from gaitchain.backends.servos import ServoBackend, ServoBusEmulator
from gaitchain.backends.servos.calibration import ImuCalibration
from gaitchain.backends.servos.table import Block
from gaitchain.errors import BackendError, CalibrationError

pytest.importorskip("dynamixel_sdk")
STEP = np.radians(0.1)  # more than a count
IMU = ImuCalibration(200, 38, 44, 0.001, 0.002, axes=("-y", "x", "z"))


def read_until(robot, done, reads=400):
    """Read until something is so; the last sensors, or a failure.

    A busy machine may answer too late several times in a row.
    """
    for _ in range(reads):
        try:
            sensors = robot.read()
        except BackendError as silence:
            assert "no servo has answered for" in str(silence)
            continue
        if done(sensors):
            return sensors
    raise AssertionError(f"not after {reads} reads: {robot.health()}")


def wait(robot, clock, seconds):
    """Let the servos' time pass once all that was sent has arrived."""
    robot.read()
    clock.now += seconds


def read_until_error(robot, reads=4000):
    for _ in range(reads):
        robot.read()


def test_angles_come_and_go_through_signs_and_offsets():
    calibration = mounted_oddly()
    # Nothing is lost where all that is late is waited for: the machine may be busy.
    unhurried = partial(patient_bus, late_s=PATIENCE_S)
    with bench(calibration, STAND, patiently=unhurried) as (bus, robot, clock):
        assert np.abs(robot.read().joint_position - STAND).max() < STEP
        robot.engage()
        for seed in range(5):
            target = STAND + np.random.default_rng(seed).uniform(-0.3, 0.3, 12)
            robot.write(target)
            wait(robot, clock, 2.0)
            sensors = robot.read()
            assert np.abs(sensors.joint_position - target).max() < STEP
            assert np.abs(sensors.joint_velocity).max() < 0.05
        for joint, angle in zip(calibration.joints.values(), target, strict=True):
            there = joint.offset + joint.sign * np.degrees(angle)
            assert bus.angle_deg(joint.id) == pytest.approx(there, abs=0.1)
        assert (robot.health().lost, robot.health().note) == (0, "")


def test_velocities_are_those_of_the_joints():
    with bench(few(2, sign=-1)) as (_, robot, clock):
        robot.engage()
        robot.write(np.array([0.5, -0.5]))
        wait(robot, clock, 0.02)
        velocity = robot.read().joint_velocity
        assert velocity == pytest.approx(np.radians([300.0, -300.0]), rel=0.01)


def test_the_joints_come_in_the_walkers_order():
    calibration = few(3)
    emulated = ServoBusEmulator.like(calibration, np.array([0.1, 0.2, 0.3]))
    with patient_bus(), emulated as bus:
        robot = ServoBackend(bus.port, calibration, ("c", "a"), PATIENT_S)
        robot.connect(np.zeros(2))
        assert robot.read().joint_position == pytest.approx([0.3, 0.1], abs=STEP)
        robot.close()


@pytest.mark.slow
def test_a_walk_goes_on_with_a_twentieth_of_all_packets_lost():
    calibration = mounted_oddly()
    with bench(calibration, STAND, period_s=0.1) as (bus, robot, clock):
        robot.engage()
        bus.bus.drop = 0.05
        good, errors, gaps, silent = STAND, [], 0, 0
        for tick in range(100):
            try:
                measured = robot.read().joint_position
            except BackendError as silence:  # a busy machine answers late, too
                assert "no servo has answered for" in str(silence)
                measured, silent = np.full(len(STAND), np.nan), silent + 1
            known = np.isfinite(measured)
            gaps += int((~known).sum())
            good = np.where(known, measured, good)
            target = STAND + 0.2 * np.sin(0.025 * tick)
            robot.write(target)
            clock.now += 0.01
            errors.append(good - target)
        health = robot.health()
        assert np.sqrt(np.mean(np.square(errors[20:]))) < np.radians(2.0)
        assert gaps > 0
        assert silent < 20
        assert 0.02 < health.lost / health.sent < 0.4


def test_a_changed_packet_is_never_taken_for_an_answer():
    with bench(few(6), period_s=0.2) as (bus, robot, _):
        bus.bus.corrupt = 0.15
        seen = []
        for _ in range(40):
            try:
                seen.append(robot.read().joint_position)
            except BackendError as silence:  # several changed, or late, in a row
                assert "no servo has answered for" in str(silence)
        seen = np.array(seen)
        assert len(seen) > 20
        assert np.isnan(seen).any()
        assert np.nanmax(np.abs(seen)) < STEP
        bus.bus.corrupt = 0.0


def test_a_dead_servo_is_named_and_those_behind_it_are_read():
    with bench(few(4)) as (bus, robot, _):
        bus.kill(2)
        sensors = robot.read()
        assert np.isnan(sensors.joint_position).tolist() == [False, True, False, False]
        assert np.isnan(sensors.joint_velocity[1])
        assert np.isnan(robot.loads()[1])
        read_until(robot, lambda _: robot.health().note == "b (id 2) does not answer")
        before = robot.health().lost
        robot.read()
        assert robot.health().lost - before <= 1  # nobody waits for it every time
        bus.revive(2)
        read_until(robot, lambda s: np.isfinite(s.joint_position).all())
        assert robot.health().note == ""


@pytest.mark.parametrize(
    ("make", "dead"), [("dynamixel", (5, 6)), ("feetech", (1, 2, 3, 4, 5, 6))]
)
def test_only_dead_servos_are_named_and_all_others_are_read(make, dead):
    """A cable that is pulled in the middle of a chain, or at a leg."""
    healthy = [number for number in range(1, 13) if number not in dead]
    with bench(TURN(few(12), make=make), period_s=0.2) as (bus, robot, _):
        robot.engage()
        for number in dead:
            bus.kill(number)
        rows = np.array(healthy) - 1
        read_until(robot, lambda s: np.isfinite(s.joint_position[rows]).all(), 20)
        labels = [f"{name} (id {joint.id})" for name, joint in robot._joints.items()]
        named = "; ".join(f"{labels[n - 1]} does not answer" for n in dead)

        def all_named(sensors):
            note = robot.health().note
            assert not [n for n in healthy if f"{labels[n - 1]} does" in note]
            return note == named

        read_until(robot, all_named, 40)
        robot.release()
        assert robot.not_let_go == ", ".join(labels[n - 1] for n in dead)
        assert not any(bus.servos[n].torque for n in healthy)


def test_a_servo_that_comes_back_without_its_torque_is_named():
    with bench(few(3), period_s=0.2) as (bus, robot, _):
        robot.engage()
        bus.kill(2)
        read_until(robot, lambda _: "not answer" in robot.health().note)
        bus.revive(2)
        read_until(robot, lambda _: robot.health().note == "b (id 2) has let go")


def test_a_short_cut_of_the_bus_is_an_error_and_then_over():
    with bench(few(3), period_s=0.05) as (bus, robot, _):
        robot.engage()
        bus.cut()
        assert np.isnan(robot.read().joint_position).all()  # once is no error yet
        with pytest.raises(BackendError, match=r"no servo has answered for 0.*supply"):
            read_until_error(robot)
        with pytest.raises(BackendError, match="no servo has answered"):
            robot.read()
        assert robot.health().note == f"nobody answers on {bus.port}"
        bus.restore()
        read_until(robot, lambda s: np.isfinite(s.joint_position).all())
        robot.write(np.zeros(3))


@pytest.mark.parametrize("late", [7, 12])
def test_one_that_is_late_is_not_behind_the_dead(monkeypatch, late):
    """Twice it hears neither the order to let go nor the question whether it did."""
    dead = 1, 2, 3, 4, 5, 6
    with bench(TURN(few(12), make="feetech"), period_s=0.2) as (bus, robot, _):
        robot.engage()
        for number in dead:
            bus.kill(number)
        rows = np.arange(6, 12)
        read_until(robot, lambda s: np.isfinite(s.joint_position[rows]).all(), 20)
        alive, deaf = bus.bus._alive, [1] * 4

        def hears(numbers):
            for device in alive(numbers):
                if device.number == late and list(numbers) == [late] and deaf:
                    deaf.pop()
                else:
                    yield device

        monkeypatch.setattr(bus.bus, "_alive", hears)
        robot.release()
        assert not deaf
        labels = [f"{name} (id {joint.id})" for name, joint in robot._joints.items()]
        assert robot.not_let_go == ", ".join(labels[n - 1] for n in dead)


@pytest.mark.parametrize(
    ("physical", "said"),
    [(True, "set .*latency timer"), (False, "this computer emulates the servos")],
)
def test_a_bus_that_answers_too_late_is_not_taken_for_one_that_is_cut(physical, said):
    with bench(few(3), period_s=0.05) as (bus, robot, _):
        bus.delay_s, robot.physical = 0.15, physical
        serial, deadline = robot._bus._port._serial, Deadline()
        with pytest.raises(BackendError, match=rf"too late: {said}"):
            while not deadline.passed():
                robot.read()
                while not (serial.in_waiting or deadline.passed()):
                    pass  # as between two control periods


def test_servos_without_supply_are_not_waited_for_at_length():
    """A control loop connects, too, and it must not stand still for long."""
    hurried = bench(few(12), period_s=0.05, patiently=nullcontext)
    patience = ExitStack()
    patience.enter_context(patient_bus())  # a busy machine is late at first, too
    with patience, hurried as (bus, robot, _):
        robot.engage()
        patience.close()
        for number in bus.servos:
            bus.kill(number)
        heard, answer = [], bus.bus.answer
        bus.bus.answer = lambda data: heard.append(data) or answer(data)
        with pytest.raises(BackendError, match="does not answer"):
            robot.engage()
        robot.release()
        assert len(heard) < 40
        heard.clear()
        began_s = time.monotonic()
        with pytest.raises(BackendError, match=r"a .id 1..*l .id 12. .none answers"):
            robot.connect(np.zeros(12))
        # 0.03 s each, 0.4 s in all; asking all takes 48. Few are asked only where the
        # machine is so slow that the time was over.
        assert len(heard) < 30
        assert len(heard) >= 6 or time.monotonic() - began_s > 0.4


def test_a_leg_without_supply_is_told_from_the_other():
    with bench(few(6), period_s=0.05) as (bus, robot, _):
        for number in (1, 2, 3):
            bus.kill(number)
        with pytest.raises(BackendError, match=r"from a .id 1., b .id 2., c .id 3.;"):
            robot.connect(np.zeros(6))


@pytest.mark.slow
def test_what_can_be_reached_is_let_go_of_though_the_rest_is_missing():
    with bench(few(3)) as (bus, robot, _):
        robot.engage()
        bus.kill(1)
        follower = ServoBackend(bus.port, few(3), tuple("abc"), PATIENT_S)
        robot._bus.close()  # as when its program is killed
        with pytest.raises(BackendError, match=r"no answer from a \(id 1\)"):
            follower.connect(np.zeros(3))
        assert "NOT known to have let go" in follower.health().note
        follower.release()
        assert not any(bus.servos[n].torque for n in (2, 3))
        assert "a (id 1) NOT known to have let go" in follower.health().note
        assert follower.health().holds
        follower.close()


def test_a_servo_that_has_let_go_is_a_fault_one_that_is_hot_is_none():
    with bench(few(3)) as (bus, robot, _):
        bus.servos[2].put(TEMPERATURE, 79)
        robot.engage()
        read_until(robot, lambda _: "79 deg C" in robot.health().note)
        assert robot.health().fault == ""
        bus.servos[3].fail(0x20)
        read_until(robot, lambda _: robot.health().fault)
        assert robot.health().fault == "c (id 3) has let go: overload"
        robot.release()
        assert robot.health().fault == ""


def test_after_a_long_cut_the_servos_are_taken_to_have_stopped():
    """Though they cannot say so yet: these have not, as their clock stands still."""
    with bench(few(3), period_s=0.05, watchdog_s=0.1) as (bus, robot, _):
        robot.engage()
        bus.cut()
        with pytest.raises(BackendError, match="no servo has answered"):
            read_until_error(robot)
        bus.restore()
        read_until(robot, lambda s: np.isfinite(s.joint_position).all())
        with pytest.raises(BackendError, match=r"by themselves.*0\.1 s; engage again"):
            robot.write(np.zeros(3))


@pytest.mark.slow
def test_a_bus_that_is_cut_for_good_hangs_nothing():
    with bench(few(3), period_s=0.05) as (bus, robot, _):
        robot.engage()
        bus.cut()
        with pytest.raises(BackendError, match="no servo has answered"):
            read_until_error(robot)
        robot.write(np.zeros(3))  # nobody answers writes, so nobody misses them
        robot.release()
        with pytest.raises(BackendError, match="does not answer"):
            robot.engage()
        robot.close()
        with pytest.raises(BackendError, match=r"from a \(id 1\).*none answers"):
            robot.connect(np.zeros(3))


def test_servos_stop_by_themselves_when_nothing_is_sent():
    with bench(few(3)) as (bus, robot, clock):
        robot.engage()
        robot.write(np.full(3, 0.5))
        wait(robot, clock, 0.1)
        robot.read()
        robot.write(np.full(3, -0.5))
        clock.now += 3.0  # the program stands still
        at = angles_deg(bus)
        assert all(servo.watchdog == WATCHDOG_TRIPPED for servo in bus.servos.values())
        with pytest.raises(BackendError, match=r"by themselves.*2\.5 s; engage"):
            for _ in range(100):
                robot.read()
                robot.write(np.zeros(3))
        wait(robot, clock, 1.0)
        assert angles_deg(bus) == pytest.approx(at, abs=0.1)
        assert "stopped by its bus watchdog" in robot.health().note
        robot.engage()
        clock.now += 0.1
        assert angles_deg(bus) == pytest.approx(at, abs=0.1)
        robot.write(np.zeros(3))
        wait(robot, clock, 0.15)
        robot.read()
        assert robot.health().note == ""


def test_a_program_that_stood_still_notices_it_by_its_own_clock():
    with bench(few(2), watchdog_s=0.02) as (_, robot, _):
        robot.engage()
        threading.Event().wait(0.05)  # the stall itself
        with pytest.raises(BackendError, match="stopped by themselves"):
            robot.write(np.zeros(2))


def test_killing_the_program_stops_the_servos():
    """As `kill -9` does; only the servos themselves can."""
    program = (
        "import sys, numpy as np\n"
        "from gaitchain.backends.servos import ServoBackend\n"
        "from servo_bench import PATIENT_S, few, patient_bus\n"
        "with patient_bus():\n"
        "    robot = ServoBackend(sys.argv[1], few(2), ('a', 'b'), PATIENT_S)\n"
        "    robot.connect(np.zeros(2)); robot.engage()\n"
        "    while True:\n"
        "        robot.write(np.zeros(2)); robot.read(); print('walking', flush=True)\n"
    )
    with ServoBusEmulator.like(few(2)) as bus:
        walker = subprocess.Popen(
            [sys.executable, "-c", program, bus.port],
            stdout=subprocess.PIPE,
            text=True,
            cwd=Path(__file__).parents[1] / "support",
        )
        with walker:
            for _ in range(10):
                assert walker.stdout.readline() == "walking\n"
            assert all(servo.torque for servo in bus.servos.values())
            walker.kill()
        deadline = time.monotonic() + 10.0
        while time.monotonic() < deadline:
            angles_deg(bus)
            if all(s.watchdog == WATCHDOG_TRIPPED for s in bus.servos.values()):
                return
            threading.Event().wait(0.01)
        raise AssertionError("the servos went on")


@pytest.mark.parametrize("drop", [0.0, 0.2])
def test_engaging_moves_nothing(drop):
    """Old goals and profiles are in the servos, and packets may be lost."""
    with bench(few(4), np.array([0.1, -0.2, 0.3, 0.0]), seed=3) as (bus, robot, clock):
        before = angles_deg(bus)
        for servo in bus.servos.values():
            servo.put(GOAL, 300)
            servo.put(PROFILE, 7)
        bus.bus.drop = drop
        for _ in range(20):
            try:
                robot.engage()
                break
            except BackendError:
                assert drop
        bus.bus.drop = 0.0
        assert all(servo.torque for servo in bus.servos.values())
        clock.now += 1.0
        assert angles_deg(bus) == pytest.approx(before, abs=0.1)
        robot.write(np.zeros(4))
        wait(robot, clock, 1.0)
        assert list(angles_deg(bus).values()) == pytest.approx([180.0] * 4, abs=0.1)


def test_a_joint_outside_its_limits_is_not_engaged():
    with bench(few(2)) as (bus, robot, _):
        bus.turn(2, 320.0)
        with pytest.raises(BackendError, match=r"b is at 140\.0 deg, outside.*-90.*90"):
            robot.engage()
        assert not any(servo.torque_seen for servo in bus.servos.values())


@pytest.mark.parametrize("make", MAKES)
@pytest.mark.parametrize(
    ("angle_deg", "count"), [(357.0, 4062), (359.95, 4095), (363.0, 4130), (-2.0, -23)]
)
def test_a_joint_past_its_servos_zero_is_not_engaged(make, angle_deg, count):
    """In position mode the servo would turn back all the way round."""
    joints = few(2, lower=-60.0).joints
    joints["a"] = TURN(joints["a"], offset=60.0)
    with bench(TURN(few(2), joints=joints, make=make)) as (bus, robot, clock):
        bus.turn(1, angle_deg)
        at = (angle_deg - 60.0 + 180.0) % 360.0 - 180.0
        seen = np.degrees(robot.read().joint_position)
        assert seen == pytest.approx([at, 0.0], abs=0.1)
        said = rf"a \(id 1\) is beyond its servo's zero \(count {count}\), .*remount"
        with pytest.raises(BackendError, match=said):
            robot.engage()
        assert not any(servo.torque_seen for servo in bus.servos.values())
        bus.turn(1, 2.0)
        robot.engage()
        robot.write(robot.read().joint_position)
        wait(robot, clock, 1.0)
        assert bus.angle_deg(1) == pytest.approx(2.0, abs=0.1)


def test_a_servo_that_cannot_turn_its_torque_on_leaves_all_off():
    with bench(few(3)) as (bus, robot, _):
        bus.servos[2].fail(0x20)
        with pytest.raises(BackendError, match=r"b \(id 2\) does not obey; overload"):
            robot.engage()
        assert not any(servo.torque for servo in bus.servos.values())


@pytest.mark.parametrize("lost", range(4))
def test_releasing_turns_every_torque_off(lost):
    with bench(few(6)) as (bus, robot, _):
        robot.engage()
        bus.bus.lose_next = lost
        robot.release()
        assert bus.bus.lose_next == 0
        assert not any(servo.torque for servo in bus.servos.values())
        assert robot.health().note == ""


def test_closing_lets_go_and_frees_the_port():
    with bench(few(2)) as (bus, robot, _):
        robot.engage()
        robot.close()
        assert not any(servo.torque for servo in bus.servos.values())
        robot.close()
        robot.release()
        with pytest.raises(BackendError, match="not connected"):
            robot.read()
        robot.connect(np.zeros(2))


def test_connecting_turns_the_torque_off_and_clears_watchdogs():
    with bench(few(2)) as (bus, robot, clock):
        robot.engage()
        clock.now += 9.0
        angles_deg(bus)
        robot.connect(np.zeros(2))
        for servo in bus.servos.values():
            assert not servo.torque
            assert servo.watchdog == 0
        robot.engage()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda bus: bus.kill(2), r"no answer from b \(id 2\);"),
        (
            lambda bus: bus.servos[2].put(OPERATING_MODE, 4),
            r"b \(id 2\) is in operating mode 4 \(extended position\).*3",
        ),
        (
            lambda bus: bus.servos[2].put(STATUS_LEVEL, 0),
            r"b \(id 2\) answers pings but no reads.*Status Return Level\(68\) to 2",
        ),
        (
            lambda bus: bus.servos[3].put(RETURN_DELAY, 250),
            "",
        ),
    ],
)
def test_what_is_not_as_it_should_be_is_refused(change, said):
    with bench(few(3), period_s=0.3) as (bus, robot, _):
        change(bus)
        if not said:
            robot.connect(np.zeros(3))
            return
        with pytest.raises(BackendError, match=said):
            robot.connect(np.zeros(3))
        assert not any(servo.torque_seen for servo in bus.servos.values())


def test_another_model_than_the_calibrations_is_refused():
    with ServoBusEmulator.like(few(2)) as bus:
        calibration = few(2, model="xl430-w250")
        robot = ServoBackend(bus.port, calibration, ("a", "b"), PATIENT_S)
        with pytest.raises(BackendError, match=r"a \(id 1\) is a xm430.*says xl430"):
            robot.connect(np.zeros(2))


def test_a_servo_of_another_kind_is_refused():
    with bench(few(1)) as (bus, robot, _):
        bus.servos[1]._model = 350  # an XL-320 has another table
        with pytest.raises(
            BackendError, match="model 350, no dynamixel servo with a table"
        ):
            robot.connect(np.zeros(1))


def test_a_bus_too_slow_for_the_period_is_refused():
    with bench(few(6)) as (bus, _, _):
        calibration = TURN(few(6), baud=57_600)
        robot = ServoBackend(bus.port, calibration, tuple("abcdef"), 0.01)
        with pytest.raises(BackendError, match="has it"):
            robot.connect(np.zeros(6))
    with ServoBusEmulator.like(few(6)) as bus:
        robot = ServoBackend(bus.port, calibration, tuple("abcdef"), 0.01)
        with pytest.raises(BackendError, match=r"takes 3\d\.\d ms.*80% of.*10 ms"):
            robot.connect(np.zeros(6))


def test_a_joint_without_a_servo_is_refused():
    with pytest.raises(CalibrationError, match="z missing"):
        ServoBackend("port", few(2), ("a", "z"), 0.01)


def test_a_pulled_plug_is_said_and_connecting_again_recovers():
    with bench(few(2)) as (bus, robot, _):
        robot.engage()
        bus.unplug()
        with pytest.raises(BackendError, match=r"lost.*plug it in and connect again"):
            robot.read()
        with pytest.raises(BackendError, match="not connected"):
            robot.write(np.zeros(2))
        assert robot.health().note == f"{bus.port} is not connected"
        robot.release()
        with pytest.raises(BackendError, match="cannot be opened"):
            robot.connect(np.zeros(2))
        bus.replug()
        robot.connect(np.zeros(2))
        assert np.isfinite(robot.read().joint_position).all()
        robot.engage()


def test_goals_stay_within_the_limits_of_the_file_and_of_the_servo():
    calibration = few(2, lower=-30.0, upper=30.0)
    with bench(calibration) as (bus, robot, clock):
        bus.servos[2].put(HIGHEST_POSITION, 2100)
        robot.connect(np.zeros(2))
        robot.engage()
        robot.write(np.array([9.0, 9.0]))
        wait(robot, clock, 2.0)
        assert bus.angle_deg(1) == pytest.approx(210.0, abs=0.1)
        assert bus.angle_deg(2) == pytest.approx(2100 * 360 / 4096, abs=0.1)


def test_a_target_that_is_no_number_is_not_sent():
    with bench(few(2)) as (bus, robot, clock):
        robot.engage()
        with pytest.raises(BackendError, match="b: a target that is no number"):
            robot.write(np.array([0.5, np.nan]))
        wait(robot, clock, 1.0)
        assert angles_deg(bus) == pytest.approx({1: 180.0, 2: 180.0}, abs=0.1)


def test_profiles_and_the_limit_of_the_voltage_are_set():
    with bench(few(2, pwm_limit=40.0)) as (bus, robot, _):
        bus.servos[1].put(PROFILE, 99)
        robot.engage()
        for servo in bus.servos.values():
            assert servo.read(PROFILE)[1] == bytes(8)
            assert servo.read(GOAL_PWM)[1] == (354).to_bytes(2, "little")
        for most, counts in ((20.0, 177), (80.0, 354)):  # never above the calibration
            robot.release()
            robot.limit_torque(most)
            robot.engage()
            for servo in bus.servos.values():
                assert servo.read(GOAL_PWM)[1] == counts.to_bytes(2, "little")


def test_a_servo_is_not_asked_for_more_voltage_than_it_allows():
    with bench(few(2, pwm_limit=80.0)) as (bus, robot, _):
        bus.servos[2].put(PWM_LIMIT, 500)
        robot.connect(np.zeros(2))
        for most, counts in ((100.0, (708, 500)), (50.0, (442, 442))):
            robot.limit_torque(most)
            robot.engage()
            data = [bus.servos[n].read(GOAL_PWM)[1] for n in (1, 2)]
            assert [int.from_bytes(two, "little") for two in data] == list(counts)
            assert all(servo.torque for servo in bus.servos.values())


def test_the_end_lets_go_of_servos_whose_port_was_lost_and_is_back():
    with bench(few(2)) as (bus, robot, _):
        robot.engage()
        robot._bus.close()  # as it does itself when the port fails
        assert all(servo.torque for servo in bus.servos.values())
        robot.close()
        assert not any(servo.torque for servo in bus.servos.values())


def test_the_end_says_which_servos_may_still_hold(caplog):
    with bench(few(2)) as (bus, robot, _):
        robot.engage()
        bus.kill(2)
        robot.close()
        assert "b (id 2) NOT known to have let go" in caplog.text


def test_the_watchdog_is_armed_with_the_torque():
    with bench(few(1), watchdog_s=0.19) as (bus, robot, _):
        robot.engage()
        assert bus.servos[1].watchdog == 10
        robot.release()
        robot.read()
        assert bus.servos[1].watchdog == 0


def test_errors_and_heat_are_told():
    with bench(few(3)) as (bus, robot, _):
        robot.engage()
        bus.servos[3].put(TEMPERATURE, 77)
        read_until(robot, lambda _: "77 deg C" in robot.health().note)
        assert robot.health().note == "c (id 3) has 77 deg C, lets go at 80"
        assert np.nanmax(robot.temperatures()) == 77.0
        bus.servos[2].fail(0x24)
        read_until(robot, lambda _: "overload" in robot.health().note)
        assert robot.health().note.startswith("b (id 2): overheating, overload; ")


def test_what_is_wrong_with_each_servo_is_said_once():
    with bench(few(3)) as (bus, robot, _):
        robot.engage()
        for servo in bus.servos.values():
            servo.fail(0x24)
        wanted = "each servo: overheating, overload; each servo has let go"
        read_until(robot, lambda _: robot.health().note == wanted)


def test_the_supply_is_measured_and_a_low_one_is_said():
    with bench(few(3)) as (bus, robot, _):
        read_until(robot, lambda _: robot.health().supply_v == 12.0)
        assert robot.health().note == ""
        for servo in bus.servos.values():
            servo.put(VOLTAGE, 99)
        read_until(robot, lambda _: robot.health().supply_v == 9.9)
        assert robot.health().note.startswith("the supply has 9.9 V, and had 12.0 V: ")


def test_loads_are_currents_as_the_joints_turn():
    calibration = few(3, sign=-1)
    joints = calibration.joints
    joints["c"] = TURN(joints["c"], model="xl430-w250")  # measures no current
    with bench(calibration) as (_, robot, clock):
        robot.engage()
        robot.write(np.array([0.1, -0.1, 0.1]))
        wait(robot, clock, 0.001)
        robot.read()
        amperes = robot.loads()
        assert amperes[:2] == pytest.approx([1.9, -1.9], abs=0.3)
        assert np.isnan(amperes[2])


def test_servos_alone_measure_no_inertia():
    with bench(few(1)) as (_, robot, _):
        assert robot.physical
        assert not robot.has_imu
        sensors = robot.read()
        assert sensors.angular_velocity.tolist() == [0.0, 0.0, 0.0]
        assert sensors.acceleration.tolist() == [0.0, 0.0, 9.81]


@pytest.mark.parametrize("kind", ["int16", "float32"])
def test_an_imu_on_the_bus_is_read_in_the_trunks_axes(kind):
    imu = TURN(IMU, format=kind, accelerometer=60)
    with bench(TURN(few(2), imu=imu)) as (bus, robot, _):
        assert robot.has_imu
        device = bus.bus.devices[200]
        device.noise_factor = 0.0
        device.angular_velocity = np.array([0.1, -0.2, 0.3])
        device.acceleration = np.array([1.0, 2.0, 9.0])
        sensors = robot.read()
        assert sensors.angular_velocity == pytest.approx([0.1, -0.2, 0.3], abs=1e-3)
        assert sensors.acceleration == pytest.approx([1.0, 2.0, 9.0], abs=2e-3)
        bus.kill(200)
        sensors = robot.read()
        assert np.isnan(sensors.angular_velocity).all()
        assert np.isnan(sensors.acceleration).all()
        assert np.isfinite(sensors.joint_position).all()
        note = "imu (id 200) does not answer"
        read_until(robot, lambda _: robot.health().note == note)
        with pytest.raises(BackendError, match=r"no answer from the imu \(id 200\)"):
            robot.connect(np.zeros(2))


def test_an_imu_is_asked_though_the_wait_for_servos_is_used_up(monkeypatch):
    """By servos that do not know fast sync reads, on a bus that is slow to say so."""
    with bench(TURN(few(2), imu=IMU)) as (bus, robot, _):
        bus.bus.fast = False
        for name, wait_s in (("_IDLE_PATIENCE_S", 1.2), ("_MISSING_WAIT_S", 2.0)):
            monkeypatch.setattr(f"gaitchain.backends.servos.backend.{name}", wait_s)
        robot.connect(np.zeros(2))
        assert not robot.load.fast
        assert robot.health().note == ""


def test_the_table_of_a_servo_is_not_changed_by_reading_it():
    """`read` writes nothing: what a person set stays."""
    with bench(few(2)) as (bus, robot, _):
        before = [bus.servos[n].read(Block(0, 120))[1] for n in (1, 2)]
        for _ in range(10):
            robot.read()
        assert [bus.servos[n].read(Block(0, 120))[1] for n in (1, 2)] == before


def test_an_emulator_closes_more_than_once():
    bus = ServoBusEmulator.like(few(1))
    with bus:
        pass
    bus.close()


def test_a_servo_that_cannot_be_asked_any_more_may_hold(monkeypatch):
    """It did not confirm, and the port is lost before it answers."""
    with bench(few(2)) as (bus, robot, _):
        bus.kill(2)
        ping = robot._bus.ping

        def lost(number):
            bus.unplug()
            return ping(number)

        monkeypatch.setattr(robot._bus, "ping", lost)
        robot.release()
        assert robot.not_let_go == "b (id 2)"
        assert robot.may_hold == "b (id 2)"


def test_a_release_that_nobody_heard_is_told_and_can_be_repeated():
    with bench(few(2)) as (bus, robot, _):
        robot.engage()
        bus.unplug()
        robot.release()
        assert "not connected" in robot.health().note
        assert "a (id 1), b (id 2) NOT known to have let go" in robot.health().note
        bus.replug()
        robot.release()
        assert robot.health().note == ""
        assert not any(servo.torque for servo in bus.servos.values())
