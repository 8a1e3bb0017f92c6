"""The control loop on the simulator: modes, requests, faults; the robot ends safe."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from live_robot import FaultyRobot, Frozen, Live, hide, library

from gaitchain.backends.base import Disturbances, PunchesState
from gaitchain.errors import BackendError
from gaitchain.live.guard import Trouble
from gaitchain.live.messages import (
    Disturb,
    Drive,
    EmergencyStop,
    LetGo,
    Mode,
    Note,
    PushRobot,
    Recall,
    Reset,
    Rest,
    Shutdown,
    Start,
    Stop,
    TroubleKind,
    decode_telemetry,
    encode,
)
from gaitchain.live.safe_backend import SafeBackend
from gaitchain.live.telemetry_record import before_fall, record_of
from gaitchain.messages import GRAVITY


@pytest.fixture
def walking():
    live = Live().walking()
    assert live.mode is Mode.WALKING
    return live


def upright(live):
    return not live.robot.fallen


def test_a_simulated_robot_rises_stands_and_walks_as_commanded():
    live = Live().run(3.0)
    assert live.mode is Mode.STANDING
    before = live.robot.data.qpos[0]
    live.run(10.0, drive=(0.3, 0.0, 0.0))
    assert live.mode is Mode.WALKING
    assert live.robot.data.qpos[0] - before == pytest.approx(3.0, abs=0.4)


@pytest.mark.slow
def test_at_250_hz_it_walks_as_well():
    live = Live(period_s=0.004).run(3.0).run(10.0, drive=(0.3, 0.0, 0.0))
    assert live.robot.data.qpos[0] == pytest.approx(3.0, abs=0.4)


class MotorRobot(FaultyRobot):
    """Motor drivers: they push by a reference, its speed, and a torque fed forward."""

    drives = 0

    def drive(self, targets):
        self.drives += 1
        ahead = targets.torque + targets.damping * targets.velocity
        super().write(targets.position + ahead / targets.stiffness)


def test_motor_drivers_walk_as_position_servos_do():
    """The law of the servos taken apart is the same law."""
    walks = [Live(backend=robot).walking() for robot in (FaultyRobot(), MotorRobot())]
    assert walks[1].robot.data.qpos == pytest.approx(walks[0].robot.data.qpos, abs=1e-6)
    stood = walks[1].robot.writes - walks[1].robot.drives
    assert stood > 50  # it rose without a gait
    assert walks[1].robot.drives > 300


def test_what_drivers_are_told_is_kept_inside_the_limits(walking, monkeypatch):
    modes = walking.loop.modes
    before, kept = modes.target.copy(), (modes.target, "kept")
    monkeypatch.setattr(type(modes._limiter), "limit", lambda *_: kept)
    walking.run(walking.period_s, drive=(0.3, 0.0, 0.0))
    now, legs = modes.motors, library().robot.legs
    free = np.abs(now.torque) < legs.torque_limit
    ahead = (now.torque + now.damping * now.velocity) / now.stiffness
    assert (now.position + ahead)[free] == pytest.approx(before[free])
    assert free.any()


def test_a_command_that_is_not_repeated_ends_the_walk(walking):
    walking.run(3.0)
    assert walking.mode is Mode.STANDING
    assert upright(walking)
    assert "no command of me for 0.5 s" in walking.happened("command")[0]
    assert walking.last.command == (0.0, 0.0, 0.0)


def test_a_robot_whose_driver_is_silent_stays_low(walking):
    most = walking.loop.modes._walker.command_range.crouch[0]
    walking.ask(Drive("me", 0.1, crouch=2.0 * most))
    walking.run(0.1)
    told = walking.last
    assert (told.crouch_asked, told.crouch) == (2.0 * most, pytest.approx(most))
    assert "crouch" in told.note
    walking.run(3.0)
    assert walking.mode is Mode.STANDING
    assert walking.last.command == (0.0, 0.0, 0.0)
    assert walking.last.crouch == pytest.approx(most)
    walking.ask(Stop("somebody else"))
    walking.run(0.1)
    assert walking.last.crouch == pytest.approx(most)
    walking.ask(EmergencyStop("me"), Reset("me"))
    walking.run(3.0)
    assert walking.mode is Mode.STANDING
    assert walking.last.crouch == 0.0  # it rose anew


def test_stop_is_heard_from_anybody(walking):
    walking.ask(Stop("somebody else"))
    walking.run(1.0, drive=(0.3, 0.0, 0.0))
    assert walking.last.asked == (0.0, 0.0, 0.0)  # until the driver lets go as well
    walking.ask(Drive("me"))
    walking.run(0.2, drive=(0.3, 0.0, 0.0))
    assert walking.last.asked == (0.3, 0.0, 0.0)


def test_the_second_driver_only_watches_until_the_first_lets_go(walking):
    walking.ask(Drive("other", -0.2), Rest("other"))
    walking.run(0.05)
    assert walking.last.driver == "me"
    assert walking.last.asked[0] == 0.3
    walking.ask(LetGo("other"))
    walking.run(0.02)
    assert walking.last.driver == "me"
    walking.ask(LetGo("me"), Drive("other", -0.2))
    walking.run(0.02)
    assert (walking.last.driver, walking.last.asked[0]) == ("other", -0.2)


def test_a_silent_driver_loses_the_wheel(walking):
    walking.run(3.1)
    assert walking.last.driver == ""


def test_emergency_stop_turns_the_torque_off_within_the_same_period(walking):
    writes = walking.robot.writes
    assert walking.last.support and np.isfinite(walking.last.planned_zmp).all()
    walking.ask(EmergencyStop("a watcher"))
    walking.run(0.01)
    assert walking.last.support == "" and np.isnan(walking.last.planned_zmp).all()
    assert walking.robot.released_at == writes
    assert walking.mode is Mode.STOPPED
    assert walking.last.reason == "emergency stop by a watcher"
    assert walking.last.trouble is TroubleKind.EMERGENCY_STOP
    assert not walking.last.fell
    walking.ask(Start("me"), Drive("me", 0.3))
    walking.run(1.0)
    assert walking.mode is Mode.STOPPED


def test_reset_puts_a_simulated_robot_on_its_feet(walking):
    walking.ask(EmergencyStop("me"))
    walking.run(2.0)
    assert walking.robot.fallen
    walking.ask(Reset("me"), Drive("me"))
    walking.run(3.0).run(2.0, drive=(0.2, 0.0, 0.0))
    assert walking.mode is Mode.WALKING
    assert upright(walking)


def test_a_command_out_of_range_is_carried_out_as_far_as_it_goes(walking):
    walking.run(1.0, drive=(5.0, 0.0, 0.0))
    most = library().command_range.vx[1]
    assert walking.last.command[0] == pytest.approx(most)
    assert "5" in walking.last.note
    walking.run(0.2, drive=(math.nan, 0.0, 0.0))
    assert "refused" in walking.happened("command")[-1]
    assert walking.last.command[0] == pytest.approx(most)


def test_a_note_of_the_walk_ends_with_it(walking):
    walking.run(0.1, drive=(5.0, 0.0, 0.0))
    assert walking.last.note
    walking.ask(EmergencyStop("me"))
    walking.run(0.1)
    assert (walking.mode, walking.last.note) == (Mode.STOPPED, "")


def test_a_push_is_carried_out_and_told(walking):
    before = float(walking.robot.data.qvel[1])
    walking.ask(PushRobot("me", 10.0, 90.0))
    walking.run(0.1, drive=(0.3, 0.0, 0.0))
    assert walking.robot.data.qvel[1] - before > 0.1
    assert walking.happened("push") == ["a push of 10 N s to 90 deg"]


def test_a_refused_push_is_told_to_who_asked_and_no_cause_of_a_fall(walking):
    walking.ask(PushRobot("me", 1e9, 0.0))
    walking.run(0.02)
    (refused,) = (text for t in walking.port.told for text in t.refused)
    assert refused.startswith("push by me refused: ")
    assert walking.happened("command") == [refused]
    assert not walking.happened("push")
    walking.ask(Disturb("me", payload=5.0))
    walking.run(3.0, drive=(0.3, 0.0, 0.0))
    assert walking.last.trouble is TroubleKind.FALL
    record = record_of(library().robot, before_fall(walking.port.told))
    assert [text for _, text in record.events] == ["payload 500 %"]


def test_a_push_names_its_body_and_elevation(walking):
    walking.ask(PushRobot("me", 2.0, 90.0, 20.0, "left_foot"))
    walking.ask(PushRobot("me", 2.0, 0.0, body="arm"))
    walking.ask(PushRobot("me", 0.01, 0.0, body="any"))
    walking.run(0.02)
    first, second = walking.happened("push")
    assert first == "a push of 2 N s to 90 deg, 20 deg up on left_foot"
    assert second.startswith("a push of 0.01 N s to 0 deg")
    (refused,) = walking.happened("command")
    says = "push by me refused: body 'arm': the robot has trunk, left_femur"
    assert refused.startswith(says)


def test_disturbances_change_while_it_walks_and_are_told(walking):
    none = Disturbances(None, "still", 0.0)
    assert walking.last.disturbances == none
    punches = PunchesState(1.0, 0.2)
    walking.ask(Disturb("me", punches=punches), Disturb("me", payload=0.05))
    walking.run(0.1, drive=(0.2, 0.0, 0.0))
    assert walking.last.disturbances == Disturbances(punches, "still", 0.05)
    walking.ask(Disturb("me", arms="random"))
    walking.run(1.0, drive=(0.2, 0.0, 0.0))
    assert walking.last.disturbances == Disturbances(punches, "random", 0.05)
    assert walking.mode is Mode.WALKING
    assert walking.happened("world") == [
        "punches of up to 1 N s every 0.2 s",
        "payload 5 %",
        "arms random",
    ]
    punched = walking.happened("push")
    assert len(punched) == 5
    assert all(text.startswith("punch: a push of ") for text in punched)
    walking.ask(Disturb("me", punches=None, arms="still", payload=0.0))
    walking.run(1.0, drive=(0.2, 0.0, 0.0))
    assert walking.last.disturbances == none
    assert walking.happened("world")[3:] == ["no punches", "arms still", "payload 0 %"]
    assert walking.happened("push") == punched
    assert walking.robot.masses == pytest.approx(FaultyRobot().masses)


def test_disturbances_beyond_their_limits_are_refused(walking):
    before = walking.last.disturbances
    walking.ask(Disturb("me", payload=11.0))
    walking.ask(Disturb("me", punches=PunchesState(5.0, 0.01)))
    walking.run(0.02)
    assert walking.last.disturbances == before
    assert not walking.happened("world")
    assert walking.happened("command") == [
        "disturb by me refused: payload is 11.0, must be 0 to 10",
        "disturb by me refused: every_s is 0.01, must be 0.1 to 1000000",
    ]


def test_a_reset_leaves_the_disturbances_and_begins_punches_anew():
    live = Live().run(3.0)
    wanted = Disturbances(PunchesState(0.5, 2.0), "random", 0.1)
    live.ask(Disturb("me", wanted.punches, wanted.arms, wanted.payload))
    live.run(1.5)
    live.ask(EmergencyStop("me"))
    live.run(0.2)
    live.ask(Reset("me"))
    live.run(1.9)
    assert live.last.disturbances == wanted
    assert not live.happened("push"), "the first is due 2 s after the reset"
    live.run(0.2)
    assert len(live.happened("push")) == 1
    assert live.robot.masses["trunk"] > FaultyRobot().masses["trunk"]


def test_disturbances_lead_to_the_cause_of_a_fall(walking):
    walking.ask(Disturb("me", payload=5.0))
    walking.run(3.0, drive=(0.3, 0.0, 0.0))
    assert walking.last.trouble is TroubleKind.FALL
    record = record_of(library().robot, before_fall(walking.port.told))
    assert [text for _, text in record.events] == ["payload 500 %"]


def test_a_fall_turns_the_torque_off_and_says_so(walking):
    walking.ask(PushRobot("me", 80.0, 90.0))
    walking.run(2.0, drive=(0.3, 0.0, 0.0))
    assert walking.mode is Mode.STOPPED
    assert walking.last.reason.startswith("fell: the trunk leans")
    assert walking.last.trouble is TroubleKind.FALL
    assert walking.last.fell
    assert not walking.robot.engaged


@pytest.mark.parametrize("sensor", ["angular_velocity", "joint_position"])
def test_a_sensor_that_is_gone_makes_the_robot_hold_still(walking, sensor):
    walking.robot.spoil = hide(sensor)
    walking.run(0.3, drive=(0.3, 0.0, 0.0))
    assert walking.mode is Mode.SAFE
    assert "has not answered" in walking.last.reason


def test_a_dead_servo_is_named(walking):
    walking.robot.spoil = hide("joint_position", joint=3)
    walking.run(0.2, drive=(0.3, 0.0, 0.0))
    assert walking.mode is Mode.WALKING
    walking.run(0.2, drive=(0.3, 0.0, 0.0))
    assert walking.mode is Mode.SAFE
    assert "left_" in walking.last.reason
    assert "has not answered" in walking.last.reason


@pytest.mark.parametrize(
    "time_goes_on, told", [(True, "stuck"), (False, "sensors are late")]
)
def test_sensors_that_repeat_themselves_are_found(walking, time_goes_on, told):
    walking.robot.spoil = Frozen(time_goes_on=time_goes_on)
    walking.run(0.4, drive=(0.3, 0.0, 0.0))
    assert walking.mode in (Mode.SAFE, Mode.STOPPED)
    assert any(told in text for text in walking.happened("mode"))


@pytest.mark.parametrize(
    "stuck", [("joint_position",), ("angular_velocity", "acceleration")]
)
def test_encoders_or_an_imu_that_repeat_themselves_are_found(walking, stuck):
    """Either alone, while the other one and the time go on."""
    first = []

    def spoil(sensors):
        first.append(sensors)
        return replace(sensors, **{name: getattr(first[0], name) for name in stuck})

    walking.robot.spoil = spoil
    walking.run(0.4, drive=(0.3, 0.0, 0.0))
    assert walking.mode in (Mode.SAFE, Mode.STOPPED)
    assert any("stuck" in text for text in walking.happened("mode"))


def test_a_bus_that_is_cut_for_a_moment_is_told_and_forgiven(walking):
    walking.robot.cut = True
    walking.run(0.2, drive=(0.3, 0.0, 0.0))
    walking.robot.cut = False
    walking.run(2.0, drive=(0.3, 0.0, 0.0))
    assert walking.mode is Mode.WALKING
    assert walking.happened("link") == [
        "the bus does not answer",
        "over, 20 times in 0.19 s: the bus does not answer",
    ]


def test_a_bus_that_is_cut_for_good_ends_the_walk(walking):
    walking.robot.cut = True
    walking.run(1.0, drive=(0.3, 0.0, 0.0))
    assert walking.mode is Mode.SAFE
    assert "the robot has not answered" in walking.last.reason
    walking.robot.cut = False
    walking.ask(Reset("me"))
    walking.run(3.0)
    assert walking.mode is Mode.STANDING


def raising(error):
    def fail(*_):
        raise error

    return fail


@pytest.mark.parametrize(
    "spoil, told",
    [
        (raising(OSError(5, "no such device")), "read: OSError: [Errno 5] no such dev"),
        (raising(ValueError("bad frame")), "failed to read: ValueError: bad frame"),
        (lambda s: replace(s, joint_position=np.zeros(3)), "(3,) numbers, not (12,)"),
        (lambda s: replace(s, foot_load=[1.0]), "(1,) numbers, not (2,)"),
        (lambda s: replace(s, acceleration=["up"] * 3), "could not convert string"),
        (lambda s: replace(s, time=None), "failed to read: TypeError"),
    ],
)
def test_whatever_a_backend_raises_is_a_robot_out_of_reach(
    walking, spoil, told, caplog
):
    walking.robot.spoil = spoil
    walking.run(0.2, drive=(0.3, 0.0, 0.0))
    assert told in walking.last.status
    walking.run(0.2, drive=(0.3, 0.0, 0.0))
    assert walking.mode is Mode.SAFE
    assert told in walking.happened("link")[0]
    assert len(walking.happened("link")) == 1
    assert len([r for r in caplog.records if told in r.getMessage()]) == 1
    assert caplog.records[0].exc_info is not None
    walking.robot.spoil = lambda sensors: sensors
    walking.ask(Reset("me"))
    walking.run(3.0)
    assert walking.mode is Mode.STANDING


def listed(sensors):
    """Measurements as of a backend that knows no arrays."""
    rows = {n: v for n, v in vars(sensors).items() if isinstance(v, np.ndarray)}
    return replace(sensors, **{name: row.tolist() for name, row in rows.items()})


@pytest.mark.parametrize("physical", [False, True])
def test_a_robot_that_measures_in_lists_rises_and_walks_alike(physical):
    walked = []
    for spoil in (listed, lambda sensors: sensors):
        live = Live(backend=FaultyRobot(physical=physical))
        live.robot.spoil = spoil
        live.run(0.1)
        live.ask(*[Start("me")] * physical)
        live.walking()
        assert live.mode is Mode.WALKING
        walked.append(live.last.joint_target)
    assert walked[0] == walked[1]


def test_measurements_are_not_those_that_a_backend_writes_into():
    robot, row = FaultyRobot(), np.zeros(3)
    robot.spoil = lambda sensors: replace(sensors, acceleration=row)
    first = SafeBackend(robot, 12).read()
    row += 1.0
    assert not first.acceleration.any()


@pytest.mark.parametrize("call", ["write", "loads", "health"])
def test_no_call_of_a_broken_backend_ends_the_loop(walking, call, monkeypatch):
    monkeypatch.setattr(walking.robot, call, raising(RuntimeError("worn out")))
    walking.run(0.5, drive=(0.3, 0.0, 0.0))
    assert walking.mode is (Mode.SAFE if call == "write" else Mode.WALKING)


def test_a_fall_is_seen_though_a_servo_has_let_go(walking):
    walking.robot.fault = "left_knee has let go"
    walking.run(0.01)
    assert walking.mode is Mode.SAFE
    assert walking.last.reason.startswith("left_knee has let go; reset when")
    assert walking.last.trouble is TroubleKind.JOINTS
    walking.ask(PushRobot("me", 80.0, 90.0))
    walking.run(2.0)
    assert walking.mode is Mode.STOPPED
    assert walking.last.reason.startswith("fell: the trunk leans")
    assert not walking.robot.engaged


def test_a_release_that_fails_is_said_with_the_emergency_stop(walking, monkeypatch):
    monkeypatch.setattr(walking.robot, "release", raising(RuntimeError("worn out")))
    walking.ask(EmergencyStop("me"))
    walking.run(0.02)
    assert walking.mode is Mode.STOPPED
    assert "NOT known to have let go: the backend failed" in walking.last.link_note
    assert walking.last.link_holds


def test_a_request_in_the_wrong_mode_is_refused_with_the_reason(walking):
    walking.ask(Start("me"))
    walking.run(0.02)
    said = "start by me refused: the robot is walking, not off"
    assert walking.happened("command") == [said]
    walking.run(1.1, drive=(0.3, 0.0, 0.0))
    walking.ask(Rest("me"))
    walking.run(1.1, drive=(0.3, 0.0, 0.0))
    walking.ask(Reset("you"))
    walking.run(0.02)
    assert walking.happened("command")[1:] == [
        "rest by me refused: the robot is walking, not standing or rising or safe",
        "reset by you refused: me drives",
    ]


@pytest.mark.slow
def test_a_flood_of_refused_requests_does_not_fill_the_log(walking):
    for tick in range(1500):
        walking.ask(*(Start(f"{name}{tick}") for name in ("you", "they")))
        if tick % 10 == 0:
            walking.ask(Drive("me", 0.3))
        walking.run(0.01)
    assert walking.mode is Mode.WALKING
    assert 10 <= len(walking.happened("command")) <= 20  # of 3000
    before = len(walking.happened("command"))
    for _ in range(1500):
        walking.ask(Start("me"))
        walking.run(0.01)
    assert len(walking.happened("command")) - before <= 4


def test_targets_that_do_not_arrive_end_the_walk(walking, monkeypatch):
    def refuse(_position):
        raise BackendError("the watchdog has tripped")

    monkeypatch.setattr(walking.robot, "write", refuse)
    walking.run(0.5, drive=(0.3, 0.0, 0.0))
    assert walking.mode is Mode.SAFE
    assert "the watchdog has tripped" in walking.last.reason
    assert walking.last.trouble is TroubleKind.LINK
    assert walking.happened("link") == ["the watchdog has tripped"]


def test_a_pause_on_the_way_to_safety_is_not_caught_up_with(walking):
    walking.robot.spoil = hide("joint_position", joint=3)
    walking.run(5.0)
    walking.robot.spoil = lambda sensors: sensors
    walking.port.told.clear()
    walking.run(0.5)
    targets = np.array([told.joint_target for told in walking.port.told])
    assert np.abs(np.diff(targets, axis=0)).max() < 0.51 * walking.period_s


def test_an_accelerometer_in_other_units_is_found():
    live = Live()
    live.robot.spoil = lambda s: replace(s, acceleration=s.acceleration / 9.81)
    live.run(2.0)
    assert live.mode is Mode.SAFE
    assert "the accelerometer says 1.0 m/s^2" in live.last.reason
    assert live.last.trouble is TroubleKind.SENSORS


def test_a_joint_that_is_silent_at_the_start_is_not_started():
    robot = FaultyRobot(physical=True)
    live = Live(backend=robot).run(0.1)
    robot.spoil = hide("joint_position", joint=2)
    live.ask(Start("me"))
    live.run(0.1)
    assert live.mode is Mode.OFF
    assert not robot.engaged
    name = live.loop.modes._joint_names[2]
    assert f"cannot start: no answer of {name}, asked" in live.happened("link")[-1]


def test_a_joint_that_is_silent_once_at_the_start_is_asked_again():
    robot = FaultyRobot(physical=True)
    live = Live(backend=robot).run(0.1)
    silent = iter([2, 5, 2])

    def now_and_then(sensors):
        joint = next(silent, None)
        return sensors if joint is None else hide("joint_position", joint)(sensors)

    live.ask(Start("me"))
    robot.engage = lambda: setattr(robot, "spoil", now_and_then)  # not the tick's own
    live.run(0.1)
    assert next(silent, None) is None
    assert live.mode is Mode.RISING


def test_a_limp_robot_is_told_so_again():
    robot = FaultyRobot(physical=True)
    live = Live(backend=robot)
    robot.engaged = True  # as if it had not heard
    live.run(1.0)
    assert not robot.engaged


@pytest.mark.parametrize("jump_s", [5.0, -5.0])
def test_a_clock_that_jumps_does_not_move_the_robot(walking, jump_s):
    target = np.array(walking.last.joint_target)
    walking.clock.jump_s = jump_s
    walking.run(0.01)
    step = np.abs(np.array(walking.last.joint_target) - target).max()
    assert step < 0.1
    walking.run(3.0)
    assert walking.mode is Mode.STANDING
    assert upright(walking)


def test_a_walker_that_fails_leaves_a_robot_that_holds_still(walking, monkeypatch):
    def fail(_sensors):
        raise ZeroDivisionError("no such luck")

    monkeypatch.setattr(walking.loop.modes._walker, "step", fail)
    walking.run(0.01)
    assert walking.mode is Mode.SAFE
    assert "the walker failed: no such luck" in walking.last.reason
    assert walking.last.trouble is TroubleKind.WALKER


def test_a_robot_is_connected_by_the_first_tick_and_once(monkeypatch):
    robot, connected = FaultyRobot(), []
    connect = robot.connect

    def count(position):
        connected.append(position)
        connect(position)

    monkeypatch.setattr(robot, "connect", count)
    live = Live(backend=robot)
    assert live.mode is Mode.OFF
    assert not connected
    live.run(0.05)
    assert live.mode is Mode.RISING
    assert len(connected) == 1


def test_a_robot_that_is_connected_already_is_not_connected_again(monkeypatch):
    robot = FaultyRobot(physical=True)
    monkeypatch.setattr(robot, "connect", None)
    live = Live(backend=robot, connected=True).run(0.05)
    assert live.mode is Mode.OFF
    assert live.last.trouble is None


def test_an_imu_that_speaks_late_lets_a_fall_be_detected():
    """Behind ROS another node publishes it, which may start after the joints."""
    robot = FaultyRobot(physical=True)
    robot.has_imu = False
    live = Live(backend=robot, connected=True).run(0.1)
    assert live.last.status == "no IMU is heard: a fall is not detected"
    live.ask(Start("me"))
    live.run(0.5)
    robot.has_imu = True
    live.run(0.1)
    assert live.last.status == ""
    assert live.happened("sensor") == [
        "an IMU is heard: a fall is detected from now on"
    ]
    robot.spoil = lambda sensors: replace(
        sensors, acceleration=np.array([GRAVITY, 0.0, 0.0])
    )
    live.run(2.0)
    assert live.last.fell


def test_motors_stay_off_until_somebody_starts_them():
    live = Live(backend=FaultyRobot(physical=True)).run(1.0)
    assert live.mode is Mode.OFF
    assert live.robot.writes == 0
    live.ask(Drive("me", 0.3))
    live.run(0.5)
    assert live.robot.writes == 0
    live.ask(Start("me"))
    live.run(0.05)
    assert live.mode is Mode.RISING


def test_rising_goes_slowly_from_where_the_joints_are():
    robot = FaultyRobot(physical=True)
    live = Live(backend=robot)
    robot.data.qpos[7:] += 0.3
    live.run(0.05)
    live.ask(Start("me"))
    live.run(0.02)
    assert np.array(live.last.joint_target) == pytest.approx(
        np.array(live.last.joint_position), abs=0.05
    )
    live.run(0.5)
    targets = np.array([t.joint_target for t in live.port.told[-40:]])
    assert np.abs(np.diff(targets, axis=0)).max() < 0.51 * live.period_s


def test_rest_lets_a_standing_robot_go():
    live = Live().run(3.0)
    live.ask(Rest("me"))
    live.run(0.02)
    assert live.mode is Mode.OFF
    assert not live.robot.engaged


def test_the_attitude_of_a_robot_at_rest_is_followed_as_it_falls():
    live = Live().run(3.0)
    live.ask(Rest("me"), PushRobot("me", 5.0, 0.0))
    for _ in range(30):
        live.run(0.1)
        pitch = live.last.estimated_tilt[1]  # a roll means nothing where it lies
        assert pitch == pytest.approx(live.robot.tilt[1], abs=0.25)  # blows and all
    assert pitch == pytest.approx(0.5 * math.pi, abs=0.02)


def test_a_robot_that_lies_there_is_not_started_and_has_not_fallen_just_now():
    live = Live().run(3.0)
    live.ask(Rest("me"))
    live.run(3.0)
    assert (live.mode, live.robot.fallen) == (Mode.OFF, True)
    live.ask(Start("me"))
    live.run(1.0)
    assert (live.mode, live.robot.engaged) == (Mode.STOPPED, False)
    assert re.fullmatch(
        r"lies there: the trunk leans by \d+ deg, limit 50; set it up and reset",
        live.last.reason,
    )
    assert not live.last.fell
    assert live.happened("mode")[-1].startswith("off to stopped: lies there")
    live.ask(Reset("me"))
    live.run(3.0)
    assert live.mode is Mode.STANDING


def test_a_robot_that_was_set_up_by_hand_is_started():
    live = Live(backend=FaultyRobot(physical=True))
    leans, upright = np.array([GRAVITY, 0.0, 0.0]), np.array([0.0, 0.0, GRAVITY])
    felt = leans
    live.robot.spoil = lambda sensors: replace(sensors, acceleration=felt)
    live.run(3.0)
    assert live.last.estimated_tilt[1] == pytest.approx(-0.5 * math.pi, abs=0.02)
    felt = upright
    live.run(3.0)
    live.ask(Start("me"))
    live.run(0.1)
    assert live.mode is Mode.RISING


def test_a_real_robot_is_not_pushed_from_here():
    live = Live(backend=FaultyRobot(physical=True)).run(3.0)
    live.ask(PushRobot("me", 10.0, 0.0), Disturb("me", payload=0.1))
    live.run(0.02)
    assert live.happened("command") == [
        "push by me refused: only a simulated robot can be pushed from here",
        "disturb by me refused: only a simulated robot can be disturbed from here",
    ]
    assert live.last.disturbances is None


def test_shutdown_ends_the_walk_first_then_lets_go(walking):
    closed, close = [], walking.robot.close
    walking.robot.close = lambda: (closed.append(walking.mode), close())
    walking.ask(Shutdown())
    walking.loop.run()
    assert walking.last.mode is Mode.STANDING
    assert upright(walking)
    assert closed == [Mode.STANDING]


def test_a_loop_that_takes_over_a_stop_stays_stopped_until_a_reset():
    live = Live()
    reason = "emergency stop by me"
    live.loop.modes.held = Trouble(TroubleKind.EMERGENCY_STOP, reason)
    live.run(0.1)
    assert (live.mode, live.last.reason) == (Mode.STOPPED, reason)
    live.ask(Drive("me", 0.3), Start("me"))
    live.run(1.0)
    assert live.mode is Mode.STOPPED
    live.ask(Reset("me"))
    live.run(3.5)
    assert live.mode is Mode.STANDING


@pytest.mark.parametrize("kind", ["part", "command"])
def test_a_note_is_kept_short_however_long_it_came(kind):
    """What a node of ROS sends may be in it, and the page gets it with each frame."""
    live = Live()
    live.ask(Note(kind, f"pose 1 is in {'x' * 1_000_000}"))
    (told,) = live.run(0.02).happened(kind)
    assert told.startswith("pose 1 is in xxx")
    assert len(told) == 1000


def test_notes_of_other_parts_come_out_as_events(walking):
    walking.ask(Note("part", "the api part was started again"))
    walking.run(0.01)
    assert walking.happened("part") == ["the api part was started again"]


def test_a_reader_that_comes_late_can_have_the_events_again(walking):
    walking.ask(Recall())
    walking.run(0.01)
    told = [event.text for event in walking.last.recalled]
    assert told[0] == "off to rising: settling"
    walking.run(0.01)
    assert not walking.last.recalled


def test_telemetry_survives_the_wire(walking):
    for told in walking.port.told[-3:]:
        again = decode_telemetry(encode(told))
        assert again.joint_position == told.joint_position
        assert again.choice == told.choice
        assert again.mode is told.mode
