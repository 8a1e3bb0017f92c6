"""Each stage of commissioning against emulated servos, sound ones and bad ones."""

import random
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from commission_bench import CHANGED, IMU, LATE_S, Somebody, library, plain, robot
from scipy.spatial.transform import Rotation

from gaitchain.backends.dynamixel.control_table import FULL_PWM, GOAL_PWM, TORQUE
from gaitchain.backends.dynamixel.emulator import EmulatedXSeries
from gaitchain.backends.dynamixel.make import MAKE
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.backends.servos import plain_calibration
from gaitchain.backends.servos.bus_load import BusLoad
from gaitchain.backends.servos.calibration import LOW_PWM
from gaitchain.commission.bench import Bench
from gaitchain.commission.imu import check_imu
from gaitchain.commission.lateness import Lateness, lateness
from gaitchain.commission.servos import check_bus, check_directions, check_offsets
from gaitchain.commission.stages import STAGES, Stage
from gaitchain.commission.timing import (
    Timing,
    check_timing,
    judge,
    qualified_delay_s,
)
from gaitchain.commission.walking import MeanTrackingError, check_hung
from gaitchain.errors import BackendError
from gaitchain.gait.qualification import CellReport, GridReport, Qualification
from gaitchain.live.exercise import exercise
from gaitchain.robot.identified import Identified
from gaitchain.sim.world import World

pytest.importorskip("dynamixel_sdk")
LATE, IN_TIME = (
    Lateness(BusLoad(12, 1_000_000, turn_s=turn_s, make=MAKE), 0.01, "")
    for turn_s in (0.008, 0.001)
)
STAGE = {stage.name: stage for stage in STAGES}


def weak(bus):
    """Whether the torque of all servos that were on was limited."""
    limits = [
        int.from_bytes(servo.read(GOAL_PWM)[1], "little")
        for servo in bus.servos.values()
        if servo.torque_seen
    ]
    assert limits
    return max(limits) <= LOW_PWM / 100.0 * FULL_PWM


def test_a_sound_bus_is_found_and_nothing_moves():
    with robot() as (bench, bus):
        verdict = check_bus(bench)
        assert not any(servo.torque_seen for servo in bus.servos.values())
    assert verdict.outcome == "go"
    assert verdict.measured["servos"] == 12


def test_a_wrong_id_is_named_and_the_stranger_too():
    knee = library().robot.legs.joint_names[3]
    joints = plain().joints
    wrong = CHANGED(plain(), joints=joints | {knee: CHANGED(joints[knee], id=77)})
    with robot(calibration=wrong) as (bench, _):
        verdict = check_bus(bench)
    assert verdict.outcome == "no-go"
    assert f"no answer from {knee} (id 77)" in verdict.said
    assert f"id {joints[knee].id} answers, which no joint has" in verdict.said


def test_a_dead_servo_is_named():
    with robot() as (bench, bus):
        bus.kill(5)
        verdict = check_bus(bench)
    assert verdict.outcome == "no-go"
    assert "(id 5)" in verdict.said


def stubborn(bus, number):
    """Let a servo keep its torque, as one does whose program crashed."""
    servo, write = bus.servos[number], bus.servos[number].write

    def kept(address, data):
        if address == TORQUE.address and data[0] == 0:
            servo.put(TORQUE, 1)
            return 0
        return write(address, data)

    servo.write = kept
    return servo, write


def test_a_servo_that_holds_on_though_nothing_was_moved_is_named():
    with robot() as (bench, bus):
        servo, write = stubborn(bus, 4)
        verdict = STAGE["bus"].run(bench)
        servo.write = write
        servo.put(TORQUE, 0)
    assert verdict.outcome == "no-go"
    assert verdict.todo.startswith("SWITCH THE SUPPLY OFF: left_knee (id 4) did not")
    assert "the torque is off" not in verdict.todo


def test_of_servos_that_do_not_answer_nothing_is_claimed():
    with robot() as (bench, bus):
        bus.kill(5)
        verdict = STAGE["bus"].run(bench)
    assert "SWITCH" not in verdict.todo
    assert "whether all torque is off is not known" in verdict.todo


def late_bus():
    """Answers that come ten times as late as a period of 10 ms has room for."""
    return robot(rate_hz=100.0, delay_s=0.02)


def test_a_bus_whose_answers_come_late_is_no_go_whatever_their_bytes_take():
    with late_bus() as (bench, _):
        verdict = check_bus(bench)
    assert verdict.outcome == "no-go"
    assert verdict.measured["bus_ms"] < 10.0
    assert verdict.measured["answer_ms"] > 2.0, "a busy computer counts less"
    assert "answers come late" in verdict.said
    for word in ("latency_timer", "Return Delay Time(9)", "adapter"):
        assert word in verdict.todo
    assert "cable" not in verdict.todo


def test_the_latency_timer_is_that_of_the_port():
    load = BusLoad(12, 1_000_000, turn_s=0.016, make=MAKE)
    assert "/ttyUSB3/latency_timer" in Lateness(load, 0.01, "/dev/ttyUSB3").todo
    assert "/ttyUSB0/latency_timer" in Lateness(load, 0.01, "/dev/ttyACM3").todo


@pytest.mark.parametrize(
    ("turn_ms", "full", "explains"),
    [
        (0.2, False, False),
        (1.0, False, False),
        (1.6, False, False),
        (2.1, True, True),
        (3.0, True, True),
    ],
)
def test_how_late_answers_may_come(turn_ms, full, explains):
    """Twelve servos take 3.6 ms of ten by their bytes, and three turns."""
    late = Lateness(
        BusLoad(12, 1_000_000, imu_bytes=12, turn_s=1e-3 * turn_ms, make=MAKE), 0.01, ""
    )
    assert (late.full, late.explains) == (full, explains)


def dead_stage(said):
    def fail(bench):
        raise BackendError(said)

    return Stage("dead", "ends", fail)


def test_what_fails_on_a_late_bus_is_said_to_be_late():
    stage = dead_stage("left_knee has not answered for 0.25 s")
    with late_bus() as (bench, _):
        late = stage.run(bench)
    with robot() as (bench, _):
        sound = stage.run(bench)
    assert late.said.startswith("answers come late")
    assert "left_knee has not answered" in late.said
    assert "latency_timer" in late.todo
    assert sound.said == "left_knee has not answered for 0.25 s"
    assert "latency" not in sound.todo


def test_nobody_who_answers_is_not_late():
    with robot() as (bench, bus):
        bus.cut()
        late = lateness(bench)
    assert not late.known
    assert not late.explains


@pytest.mark.parametrize("check", [check_directions, check_offsets])
def test_a_servo_that_ends_early_is_not_taken_for_blocked(check):
    """The left knee from 6 deg on, so that no leg can be straight."""
    knee = library().robot.legs.joint_names[3]
    joints = plain().joints
    early = CHANGED(joints[knee], lower=6.0)
    with robot(calibration=CHANGED(plain(), joints=joints | {knee: early})) as (
        bench,
        _,
    ):
        verdict = check(bench)
    assert verdict.outcome == "go", verdict.said


def test_each_joint_turns_alone_and_weakly():
    person = Somebody()
    with robot(person) as (bench, bus):
        verdict = check_directions(bench)
        assert weak(bus)
    assert verdict.outcome == "go"
    assert len(person.asked) == 12
    assert any("bend the left knee" in asked for asked in person.asked)
    assert min(verdict.measured["moved_deg"].values()) > 7.0


def test_a_joint_that_went_the_other_way_is_no_go():
    knee = library().robot.legs.joint_names[3]
    with robot(Somebody(no=knee)) as (bench, _):
        verdict = check_directions(bench)
    assert verdict.outcome == "no-go"
    assert knee in verdict.said
    assert "sign" in verdict.todo


def test_a_blocked_joint_is_seen_by_its_encoder():
    with robot() as (bench, bus):
        knee = library().robot.legs.joint_names[3]
        number = bench.calibration.joints[knee].id
        stuck = EmulatedXSeries(
            number, angle_deg=bus.angle_deg(number), speed_deg_s=1e-3
        )
        bus.bus.devices[number] = bus.servos[number] = stuck
        verdict = check_directions(bench)
    assert verdict.outcome == "no-go"
    assert f"{knee} turned by" in verdict.said
    assert "blocked" in verdict.said
    assert "pwm_limit" in verdict.todo
    assert "sign" not in verdict.todo


def test_the_legs_go_straight_and_a_person_judges():
    ends = []
    with robot(Somebody(no="straight")) as (bench, bus):
        bench.person.acts = {"straight": lambda: ends.append(bus.angle_deg(4))}
        verdict = check_offsets(bench)
        assert weak(bus)
    assert verdict.outcome == "no-go"
    assert "offset" in verdict.todo
    assert ends == pytest.approx([180.0], abs=0.1)


def turned_encoders(bench, deg):
    """Let the library be of a robot some of whose encoders show more than the angle."""
    count = len(library().robot.legs.joint_names)
    offset = np.zeros(count)
    offset[[4, 10]] = np.radians(deg)
    found = replace(Identified.of_file(count), offset=offset)
    poses = replace(library().poses, robot=library().robot.as_identified(found))
    bench.library = replace(library(), poses=poses)


def test_joints_with_known_offsets_go_where_the_robot_is_straight():
    """A servo shows 6 deg where its joint is at 0, and is not off there."""
    seen = []
    with robot(Somebody()) as (bench, bus):
        turned_encoders(bench, 6.0)
        bench.person.acts = {
            "straight": lambda: seen.extend(bus.angle_deg(n) for n in (4, 5))
        }
        verdict = check_offsets(bench)
    assert seen == pytest.approx([180.0, 186.0], abs=0.1)
    assert verdict.outcome == "go"
    assert verdict.measured["worst_deg"] == pytest.approx(0.0, abs=0.1)


def test_the_sway_begins_where_the_walker_stands():
    begun = []

    def end(stage, done, total):
        begun.append([bus.angle_deg(number) for number in range(1, 13)])
        raise KeyboardInterrupt

    for offset_deg in (0.0, 6.0):
        with robot(rate_hz=20.0, late_s=LATE_S) as (bench, bus):
            turned_encoders(bench, offset_deg)
            bench.progress = end
            with pytest.raises(KeyboardInterrupt):
                STAGE["shift"].run(bench)
    more = np.subtract(*reversed(begun))
    lag = 1.0  # deg, of emulated servos that are still on their way
    assert more == pytest.approx(6.0 * np.isin(np.arange(12), [4, 10]), abs=lag)


def test_a_joint_goes_as_far_as_its_servo_does_by_its_encoder():
    end = np.radians(10.0)
    servos = SimpleNamespace(limits=(np.full(12, -end), np.full(12, end)))
    with robot() as (bench, _):
        turned_encoders(bench, 6.0)
        legs = bench.within(servos).legs
    assert np.degrees([legs.lower[4], legs.upper[4]]) == pytest.approx([-16.0, 4.0])
    assert np.degrees([legs.lower[2], legs.upper[2]]) == pytest.approx([-10.0, 10.0])


def test_an_interrupt_turns_the_torque_off():
    def interrupt():
        raise KeyboardInterrupt

    with robot(Somebody(acts={"straight": interrupt})) as (bench, bus):
        with pytest.raises(KeyboardInterrupt):
            check_offsets(bench)
        assert any(servo.torque_seen for servo in bus.servos.values())


@pytest.mark.slow
def test_a_servo_that_dies_in_a_stage_ends_it_with_the_torque_off():
    with robot(Somebody()) as (bench, bus):
        bench.person.acts = {"left_hip": lambda: bus.kill(7)}
        verdict = STAGES[1].run(bench)
    assert verdict.outcome == "no-go"
    assert "--from directions" in verdict.todo
    assert "SWITCH THE SUPPLY OFF: right_hip_yaw (id 7)" in verdict.todo


@pytest.mark.parametrize(
    ("changes", "todo"),
    [
        ({}, ""),
        ({"delays_s": np.full(100, 0.012)}, "shorten the delay"),
        ({"late_p99_s": 0.008}, "shorten the delay"),
        ({"rate_hz": 80.0}, "latency timer"),
        ({"lost": 0.02}, "left_knee, which missed 9 of 100"),
        ({"late": LATE}, ""),
        (
            {"late": LATE, "lost": 0.2},
            "answers come late: set the USB adapter's latency timer",
        ),
        ({"late": LATE, "rate_hz": 80.0}, "answers come late"),
        ({"late": IN_TIME, "lost": 0.02}, "check cables"),
        ({"imu_missed": 10}, "the IMU, which missed 10 of 100"),
        ({"imu_missed": 1}, ""),
        ({"lost": 0.02, "missed": np.zeros(12, int)}, "plugs; then supply"),
    ],
)
def test_timing_is_judged_by_what_was_qualified(changes, todo):
    names = library().robot.legs.joint_names
    missed = np.array([9 * (name == "left_knee") for name in names])
    timing = Timing(100.0, np.full(100, 0.004), 0.001, 0.0, missed)
    bench = Bench(library(), plain(), "none", 100.0, Somebody())
    verdict = judge(bench, replace(timing, **changes), 0.01)
    assert (verdict.outcome == "no-go") is bool(todo)
    assert todo in verdict.todo


def on_slow_buses(*held):
    """The library with a grid of buses, by rate and how many of 10 walks held."""
    cells = [
        CellReport("", "bus_hz", False, (("bus_hz", hz),), 10, passes, {}, (1, 0))
        for hz, passes in held
    ]
    grid = GridReport(True, 1, 0.9, tuple(cells), ())
    verdicts = replace(library().qualification, grid=grid)
    return replace(library(), qualification=verdicts)


@pytest.mark.parametrize(
    ("held", "least_hz"),
    [((), 100.0), (((50.0, 8), (33.0, 0)), 100.0), (((50.0, 9), (33.0, 8)), 50.0)],
)
def test_no_slower_control_is_a_go_than_was_walked(held, least_hz):
    """Whatever was asked for: at 20 Hz this library falls in simulation."""
    own = on_slow_buses(*held)
    missed, calm = np.zeros(12, dtype=int), np.full(100, 0.004)
    for rate_hz, outcome in (
        (0.995 * least_hz, "go"),
        (0.98 * least_hz, "no-go"),
        (20.0, "no-go"),
    ):
        bench = Bench(own, plain(), "none", rate_hz, Somebody())
        verdict = judge(bench, Timing(rate_hz, calm, 0.001, 0.0, missed), 0.01)
        assert verdict.outcome == outcome
        assert verdict.measured["qualified_rate_hz"] == least_hz
    assert "--rate 20 is slower" in verdict.todo
    assert f"give --rate {least_hz:g} or more" in verdict.todo


def test_the_qualified_delay_is_that_of_gate_and_grid():
    """Up to 10 ms of delay, and 5 of jitter beyond it."""
    assert qualified_delay_s(library()) == pytest.approx(0.015)
    unknown = replace(library(), qualification=Qualification())
    assert qualified_delay_s(unknown) == 0.0


def late_library(delay_s, turnaround_s=None):
    """The library of a robot of which that delay was identified [s]."""
    plain = Identified.of_file(12)
    late = replace(plain, delay_s=delay_s, turnaround_s=turnaround_s)
    robot = library().robot.as_identified(late)
    return replace(library(), poses=replace(library().poses, robot=robot))


def test_an_identified_robot_is_qualified_for_its_own_delay_too():
    """As its walks had that in addition; without a verdict there were no walks."""
    own = late_library(0.02)
    assert MujocoBackend(own.robot, World(delay_s=0.01)).world.delay_s == 0.03
    assert qualified_delay_s(own) == pytest.approx(0.035)
    assert qualified_delay_s(replace(own, qualification=Qualification())) == 0.0


def test_a_bus_may_not_be_later_by_the_lag_of_the_servos():
    """Of 20 ms that targets are late, the bus of the log took 4."""
    own = late_library(0.02, 0.004)
    assert MujocoBackend(own.robot, World(delay_s=0.01)).world.delay_s == 0.03
    assert qualified_delay_s(own) == pytest.approx(0.019)


def test_no_later_delay_is_qualified_than_a_world_may_have():
    """Walks were in a world at its limit of 1 s, and 5 ms of jitter."""
    own = late_library(0.995)
    assert MujocoBackend(own.robot, World(delay_s=0.01)).world.delay_s == 1.0
    assert qualified_delay_s(own) == pytest.approx(1.005)


def test_a_grid_counts_where_enough_walks_held():
    cells = [
        CellReport(
            "",
            "",
            True,
            (("delay_s", late_s), ("jitter_s", 0.01)),
            10,
            held,
            {},
            (1, 0),
        )
        for late_s, held in ((0.02, 10), (0.03, 9), (0.04, 8))
    ]
    grid = GridReport(True, 1, 0.9, tuple(cells), ())
    graded = replace(library(), qualification=Qualification(grid=grid))
    assert qualified_delay_s(graded) == pytest.approx(0.04)


@pytest.mark.slow
def test_a_bus_that_loses_packets_is_no_go():
    with robot(rate_hz=20.0) as (bench, bus):
        bench.person.ready("")
        check_bus(bench)
        bus.bus.drop = 0.08
        verdict = check_timing(bench)
        bus.bus.drop = 0.0
    assert verdict.outcome == "no-go"
    assert verdict.measured.get("lost_percent", 100.0) > 1.0


@pytest.mark.slow
def test_an_imu_that_loses_its_answers_is_named():
    drawn = random.Random(1)
    with robot(rate_hz=20.0) as (bench, bus):
        passed = bus.bus._passed

        def lossy(packet):
            lost = packet[4:5] == bytes([IMU.id]) and drawn.random() < 0.3
            return b"" if lost else passed(packet)

        bus.bus._passed = lossy
        verdict = check_timing(bench)
        bus.bus._passed = passed
    assert verdict.outcome == "no-go"
    assert "most of all before the IMU, which missed" in verdict.todo


@pytest.mark.slow
def test_a_slow_bus_is_no_go():
    with robot(rate_hz=20.0) as (bench, bus):
        bench.library = on_slow_buses((20.0, 10))
        bus.delay_s = 0.015  # twice in a period: servos and IMU
        verdict = check_timing(bench)
    assert verdict.outcome == "no-go"
    assert verdict.todo
    assert "--rate 20 is slower" not in verdict.todo


class Tipper(Somebody):
    """Tips the trunk in a second, as its IMU feels it, whose gyro may be wrong."""

    def __init__(self, bench, bus, gyro=1.0):
        super().__init__()
        self.clock, self.imu, self.gyro = bench.clock, bus.bus.devices[200], gyro
        self.turn = Rotation.identity()

    def ready(self, text, meanwhile=None):
        self.asked.append(text)
        for word, axis in (("forward", [0.0, 20.0, 0.0]), ("left", [-20.0, 0.0, 0.0])):
            if word in text:
                goal = Rotation.from_rotvec(axis, degrees=True)
                self._tip(self.turn.inv() * goal, meanwhile)

    def _tip(self, way, meanwhile):
        begin, periods = self.turn, 20
        for i in range(periods + 1):
            self.turn = begin * Rotation.from_rotvec(i / periods * way.as_rotvec())
            self.imu.acceleration = self.turn.inv().apply([0.0, 0.0, 9.81])
            self.imu.angular_velocity = self.gyro * way.as_rotvec()
            meanwhile()
            self.clock.sleep_until(self.clock.now() + 1.0 / periods)
        self.imu.angular_velocity = np.zeros(3)


def test_a_sound_imu_is_go():
    with robot() as (bench, bus):
        bench.person = Tipper(bench, bus)
        verdict = check_imu(bench)
    assert verdict.outcome == "go", verdict.said


@pytest.mark.parametrize("gyro", [-1.0, 5.0, 0.1])
def test_a_gyro_of_a_wrong_sign_or_scale_is_no_go(gyro):
    with robot() as (bench, bus):
        bench.person = Tipper(bench, bus, gyro)
        verdict = check_imu(bench)
    assert verdict.outcome == "no-go"
    assert f"by {20 * gyro:.0f} deg as the gyro does" in verdict.said
    assert "gyro_scale" in verdict.todo


@pytest.mark.parametrize(
    ("axes", "said"),
    [
        (("x", "-y", "-z"), "up is near the trunk's -z"),
        (("z", "y", "-x"), "up is near the trunk's +x"),
        (("-y", "x", "z"), "tipped forward, gravity shows at"),
        (("-x", "-y", "z"), "tipped forward, gravity shows at +x"),
    ],
)
def test_a_turned_imu_is_no_go(axes, said):
    believed = CHANGED(plain(), imu=CHANGED(IMU, axes=axes))
    with robot(calibration=believed) as (bench, bus):
        bench.person = Tipper(bench, bus)
        verdict = check_imu(bench)
    assert verdict.outcome == "no-go"
    assert said in verdict.said
    assert "axes" in verdict.todo


@pytest.mark.parametrize(
    ("felt", "said", "todo"),
    [
        ([0.0, 0.0, 19.6], "long, at rest", "accelerometer_scale"),
        ([0.0, 0.0, -9.81], "up is near the trunk's -z", "imu.axes"),
    ],
)
def test_what_to_do_is_for_what_was_found(felt, said, todo):
    with robot() as (bench, bus):
        bus.bus.devices[200].acceleration = np.array(felt)
        verdict = check_imu(bench)
    assert verdict.outcome == "no-go"
    assert said in verdict.said
    assert todo in verdict.todo
    other = {"accelerometer_scale", "imu.axes"} - {todo}
    assert not any(word in verdict.todo for word in other)


def test_a_trunk_that_was_not_tipped_is_to_be_tipped():
    with robot() as (bench, _):
        verdict = check_imu(bench)
    assert "it shows 0 deg" in verdict.said
    assert "tip it by 8 deg" in verdict.todo
    assert "axes" not in verdict.todo


def test_a_frozen_imu_is_found_before_anything_moves():
    with robot() as (bench, bus):
        bench.person.present = False
        bus.bus.devices[200].noise_factor = 0.0
        verdict = check_imu(bench)
    assert verdict.outcome == "no-go"
    assert "stuck" in verdict.said
    assert "axes" not in verdict.todo


def test_without_an_imu_the_stage_is_skipped():
    with robot(truth=plain_calibration(library().robot)) as (bench, _):
        assert check_imu(bench).outcome == "skipped"


@pytest.mark.parametrize("period_s", [0.004, 0.02])
def test_a_tracking_error_is_averaged_over_a_second(period_s):
    """As by a first-order lag, whatever the period; a moment alone says nothing."""
    error = MeanTrackingError(period_s)
    assert error.worst_deg == 0.0
    off = np.radians([2.0, -10.0, np.nan])
    error.add(off)
    assert error.worst_deg == pytest.approx(10.0 * period_s)
    for _ in range(round(1.0 / period_s) - 1):
        error.add(off)
    assert error.worst_deg == pytest.approx(10.0 * (1.0 - np.exp(-1.0)), rel=0.01)
    assert error.worst_joint == 1


@pytest.mark.slow
def test_a_hung_robot_steps_and_lets_go():
    with robot(rate_hz=20.0, late_s=LATE_S) as (bench, bus):
        verdict = check_hung(bench)
        assert weak(bus)
    assert verdict.outcome == "go", verdict.said
    assert "steps at 0.17 m/s" in verdict.said


@pytest.mark.slow
def test_emulated_servos_step_without_balance_and_that_is_said():
    """They have no body, and the feedback of some libraries runs away there."""
    with robot(rate_hz=20.0, late_s=LATE_S) as (bench, _):
        bench.emulated = True
        verdict = STAGE["steps"].run(bench)
    assert verdict.outcome == "go", verdict.said
    assert "without balance, as emulated servos have no body" in verdict.said


def test_a_robot_that_falls_while_it_stands_is_no_go():
    def fall(stage, done, total):
        if done == 20:
            bus.bus.devices[200].acceleration = np.array([9.81, 0.0, 0.0])

    with robot(rate_hz=20.0, late_s=LATE_S) as (bench, bus):
        bench.progress = fall
        verdict = STAGE["stand"].run(bench)
    assert verdict.outcome == "no-go"
    assert "leans" in verdict.said
    assert "--from stand" in verdict.todo


@pytest.mark.parametrize("rate_hz", [50.0, 200.0])
def test_a_sway_lasts_as_long_at_any_rate(rate_hz):
    motion = exercise(library().robot)[1]
    resampled = motion.every(1.0 / rate_hz)
    given_s, found_s = (
        period_s * (len(m.targets) - 1)
        for m, period_s in ((motion, 0.01), (resampled, 1.0 / rate_hz))
    )
    assert found_s == pytest.approx(given_s, abs=1.0 / rate_hz)
    middle = len(motion.targets) // 2
    at = resampled.targets[round(0.01 * middle * rate_hz)]
    assert at == pytest.approx(motion.targets[middle], abs=1e-9)


@pytest.mark.slow
def test_a_dead_servo_ends_the_sway():
    def die(stage, done, total):
        if done == 10:
            bus.kill(2)

    with robot(rate_hz=20.0, late_s=LATE_S) as (bench, bus):
        bench.progress = die
        verdict = STAGE["shift"].run(bench)
    assert verdict.outcome == "no-go"
    assert "has not answered for 0.25 s" in verdict.said
