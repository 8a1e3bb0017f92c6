"""The heading of a robot that falls, lies and gets up, by gyro and accelerometer."""

import math
from dataclasses import replace

import numpy as np
import pytest

from gaitchain.balance.rotations import about, rotation
from gaitchain.balance.state import Attitude
from gaitchain.messages import GRAVITY, Sensors
from gaitchain.walker.lying import Lying

PERIOD_S = 0.01
BIAS = np.array([0.01, -0.02, 0.03])
BEGAN = Attitude(roll=0.05, pitch=0.4, yaw=7.0)  # more than a turn
X, Y, Z = np.eye(3)


def turns():
    """Fall onto the front, roll over to the back, turn about the vertical, rise."""
    yield from ((Y, 1.2, 0.5), (X, math.pi, 1.0))
    yield from ((X, 0.0, 2.0), (X, 1.0, 1.0))  # lies, and turns on the floor
    yield from ((Y, 1.5, 1.5), (Z, -0.3, 1.0))


def followed(*, measured=lambda tick: True, spoil=lambda tick, sensors: sensors):
    """Return what was found, and where the trunk is: ahead and up, as it sees them."""
    turn = rotation(BEGAN.yaw, BEGAN.pitch, BEGAN.roll)
    lying, tick = Lying(BEGAN, BIAS, PERIOD_S), 0
    for axis, angle, seconds in turns():
        for _ in range(round(seconds / PERIOD_S)):
            rate = axis * angle / seconds
            turn = turn @ about(axis, angle * PERIOD_S / seconds)
            felt = GRAVITY * turn[2]
            nothing = np.zeros(12)
            sensors = Sensors(0.0, nothing, nothing, rate + BIAS, felt)
            lying.feel(spoil(tick, sensors), measured=measured(tick))
            tick += 1
    return lying, turn


def test_a_trunk_that_rolls_over_keeps_its_heading():
    lying, turn = followed()
    true = math.atan2(turn[1, 0], turn[0, 0])
    off = math.remainder(lying.yaw - true, math.tau)
    assert abs(off) < math.radians(0.1)
    assert abs(lying.yaw - BEGAN.yaw) <= math.pi  # it goes on, whatever the turns


def test_roll_and_pitch_are_those_of_the_trunk():
    lying, turn = followed()
    roll, pitch = math.atan2(turn[2, 1], turn[2, 2]), -math.asin(turn[2, 0])
    assert lying.tilt == pytest.approx((roll, pitch), abs=math.radians(1.0))


def test_the_bias_is_learned_as_it_lies():
    """For a minute, with what a short stand leaves unknown of a gyro."""
    lying = Lying(Attitude(), np.zeros(3), PERIOD_S)
    nothing = np.zeros(12)
    upright = Sensors(0.0, nothing, nothing, BIAS, np.array([0.0, 0.0, GRAVITY]))
    for _ in range(round(60.0 / PERIOD_S)):
        lying.feel(upright, measured=True)
    assert abs(lying.yaw) < math.radians(3.0)


def test_what_shakes_the_trunk_is_no_vertical():
    def shaken(tick, sensors):
        jolt = 30.0 * np.array([math.sin(tick), math.cos(tick), 0.0])
        return replace(sensors, acceleration=sensors.acceleration + jolt)

    lying, turn = followed(spoil=shaken)
    true = math.atan2(turn[1, 0], turn[0, 0])
    assert abs(math.remainder(lying.yaw - true, math.tau)) < math.radians(0.5)


@pytest.mark.parametrize(("lost", "known"), [(10, True), (40, False)])
def test_a_gyro_that_says_nothing_for_long_loses_the_heading(lost, known):
    gone = range(300, 300 + lost)  # while it lies still
    lying, _ = followed(measured=lambda tick: tick not in gone)
    assert (lying.yaw is not None) is known
