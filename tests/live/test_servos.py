"""The control loop on emulated servos: a servo that lets go, a supply that goes off."""

from contextlib import contextmanager
from dataclasses import replace as changed

import numpy as np
import pytest
from live_robot import Live, SteppedClock, library
from msgspec.structs import replace

from gaitchain.backends.servos import ServoBackend, ServoBusEmulator, plain_calibration
from gaitchain.live.messages import EmergencyStop, Mode, Reset, Shutdown, Start
from gaitchain.robot.identified import Identified
from gaitchain.walker.walker import Walker

pytest.importorskip("dynamixel_sdk")


@contextmanager
def on_servos(*, upper=None, of=None):
    """A loop whose robot is connected, torque off, and its bus.

    Its left knee bends no further than to `upper` [deg], where it is now. The loop has
    the library `of`, by default the shipped one.
    """
    clock, legs = SteppedClock(), library().robot.legs
    calibration, stand = plain_calibration(library().robot), np.array(legs.stand)
    if upper is not None:
        knee = replace(calibration.joints["left_knee"], upper=upper)
        joints = {**calibration.joints, "left_knee": knee}
        calibration = replace(calibration, joints=joints)
        stand[legs.joint_names.index("left_knee")] = np.radians(upper)
    with ServoBusEmulator.like(calibration, stand, clock=clock.now) as bus:
        robot = ServoBackend(
            bus.port, calibration, legs.joint_names, 0.1, watchdog_s=2.5
        )
        try:
            yield Live(backend=robot, clock=clock, of=of), bus
        finally:
            robot.close()


def supply(bus, *, on):
    """Switch the supply of all servos."""
    for number in bus.servos:
        (bus.revive if on else bus.kill)(number)


def walking_on(live):
    live.ask(Start("me"))
    live.run(2.5).run(1.5, drive=(0.3, 0.0, 0.0))
    assert live.mode is Mode.WALKING, live.last.reason
    return live


def test_a_standing_pose_beyond_the_servos_is_not_risen_to():
    """Goals would be cut at the servo's limit, and the robot would stand askew."""
    with on_servos(upper=10.0) as (live, _):
        live.run(0.2)
        live.ask(Start("me"))
        live.run(0.2)
        assert live.mode is Mode.OFF
        (said,) = live.happened("command")
    assert said.startswith(
        "start by me refused: the standing pose is out of reach: left_knee was to go "
    )
    assert said.endswith(" to 10; calibrate it again")


def identified_with(offset_deg, beyond_stand_deg):
    """The library of a robot whose left knee shows more than it is bent by.

    It may bend further than in the standing pose by so much.
    """
    shipped = library()
    robot, knee = shipped.robot, shipped.robot.legs.joint_names.index("left_knee")
    upper, offset = np.array(robot.legs.upper), np.zeros(len(robot.legs.stand))
    upper[knee] = robot.legs.stand[knee] + np.radians(beyond_stand_deg)
    offset[knee] = np.radians(offset_deg)
    found = changed(Identified.of_file(len(offset)), offset=offset)
    narrow = changed(robot.with_ranges(robot.legs.lower, upper), identified=found)
    return changed(shipped, poses=changed(shipped.poses, robot=narrow)), knee


def test_an_identified_robot_stands_where_only_its_encoder_is_past_the_range():
    """The range is that of the joint; the servo itself goes further."""
    identified, knee = identified_with(offset_deg=4.0, beyond_stand_deg=1.0)
    with on_servos(upper=80.0, of=identified) as (live, _):
        live.run(0.2)
        live.ask(Start("me"))
        live.run(3.0)
        assert live.mode is Mode.STANDING, live.happened("command")
        stand = Walker(library()).standing_targets.position[knee]
        assert live.last.joint_target[knee] == pytest.approx(stand, abs=0.01)
        assert "range" not in live.last.status


def test_the_end_of_the_loop_turns_every_torque_off():
    with on_servos() as (live, bus):
        walking_on(live)
        assert all(servo.torque for servo in bus.servos.values())
        live.ask(Shutdown())
        live.loop.run()
        assert not any(servo.torque for servo in bus.servos.values())


def test_a_servo_that_lets_go_ends_the_walk_at_once():
    with on_servos() as (live, bus):
        walking_on(live)
        number = plain_calibration(library().robot).joints["left_knee"].id
        with bus.bus.lock:
            bus.servos[number].fail(0x20)
        live.run(0.1, drive=(0.3, 0.0, 0.0))
        assert live.mode is Mode.SAFE
        assert f"left_knee (id {number}) has let go: overload" in live.last.reason


@pytest.mark.slow
def test_with_the_supply_off_a_reset_says_so_and_is_done_when_it_is_on_again():
    with on_servos() as (live, bus):
        walking_on(live)
        supply(bus, on=False)
        live.run(0.1)
        live.ask(EmergencyStop("me"))
        live.run(0.02)
        live.ask(Reset("me"))
        live.run(0.02)
        assert live.mode is Mode.STOPPED
        assert live.last.reason.startswith("not connected: ")
        assert "none answers: supply" in live.last.reason
        assert live.last.reason.endswith("it is tried again after 1 s")
        live.run(1.2)
        assert live.last.reason.endswith("it is tried again after 2 s")
        supply(bus, on=True)
        live.run(2.2)
        assert live.mode is Mode.OFF
        assert not any(servo.torque for servo in bus.servos.values())
        for _ in range(20):  # a loaded machine may answer a start too late
            live.ask(Start("me"))
            live.run(0.1)
            if live.mode is not Mode.OFF:
                break
        assert live.mode is Mode.RISING, live.last.reason


def test_an_emergency_stop_ends_the_attempts_until_a_reset():
    with on_servos() as (live, bus):
        live.ask(EmergencyStop("me"))
        live.run(0.02)
        supply(bus, on=False)
        live.ask(Reset("me"))
        live.run(0.1)
        live.ask(EmergencyStop("you"))
        live.run(0.02)
        assert live.last.reason == "emergency stop by you"
        supply(bus, on=True)
        live.run(3.0)
        assert live.mode is Mode.STOPPED
        live.ask(Reset("me"))
        live.run(0.02)
        assert live.mode is Mode.OFF
