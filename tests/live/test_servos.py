"""The control loop on emulated servos: a servo that lets go, a supply that goes off."""

from contextlib import contextmanager

import numpy as np
import pytest
from live_robot import Live, SteppedClock, library
from msgspec.structs import replace

from gaitchain.backends.dynamixel import (
    DynamixelBackend,
    ServoBusEmulator,
    plain_calibration,
)
from gaitchain.live.messages import EmergencyStop, Mode, Reset, Start

pytest.importorskip("dynamixel_sdk")


@contextmanager
def on_servos(*, upper=None):
    """A loop whose robot is connected, torque off, and its bus.

    Its left knee bends no further than to `upper` [deg], where it is now.
    """
    clock, legs = SteppedClock(), library().robot.legs
    calibration, stand = plain_calibration(library().robot), np.array(legs.stand)
    if upper is not None:
        knee = replace(calibration.joints["left_knee"], upper=upper)
        joints = {**calibration.joints, "left_knee": knee}
        calibration = replace(calibration, joints=joints)
        stand[legs.joint_names.index("left_knee")] = np.radians(upper)
    with ServoBusEmulator.like(calibration, stand, clock=clock.now) as bus:
        robot = DynamixelBackend(
            bus.port, calibration, legs.joint_names, 0.1, watchdog_s=2.5
        )
        try:
            yield Live(backend=robot, clock=clock), bus
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
