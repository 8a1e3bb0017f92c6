"""Gains that make up for soft servos, by the joint that they are made for."""

import dataclasses

import numpy as np
import pytest
from leg_makes import MAKES, NO_ANKLE_ROLL, make_robot

from gaitchain.balance.gains import derive_gains
from gaitchain.balance.leg_kinematics import legs_of
from gaitchain.messages import GRAVITY


def gains_of(make, pitch, roll):
    """Return the gains of a robot whose ankle servos have these parts of m g h."""
    robot = make_robot(make, np.random.default_rng(0))
    legs = legs_of(robot)
    tipping = legs.mass * GRAVITY * (legs.leg + legs.ankle_height)
    kinds, knee = make.split(), legs.knee
    parts = {"pitch": pitch, "roll": roll}
    own = [10.0] * (knee + 1) + [parts[kind] for kind in kinds[knee + 1 :]]
    stiffness = tipping * np.tile(own, 2)
    model = dataclasses.replace(robot.legs, stiffness=stiffness)
    return derive_gains(legs_of(dataclasses.replace(robot, legs=model)))


@pytest.mark.parametrize("make", MAKES)
def test_each_ankle_servo_that_is_soft_has_its_own_gain_made_up(make):
    ankle = gains_of(make, pitch=5.0, roll=1.0).ankle
    assert ankle == pytest.approx((1.55, 1.6 + 2.0))
    ankle = gains_of(make, pitch=2.5, roll=7.0).ankle
    assert ankle == pytest.approx((1.55 + 0.5, 1.6))


def test_without_an_ankle_roll_both_follow_the_pitch():
    ankle = gains_of(NO_ANKLE_ROLL, pitch=2.0, roll=0.0).ankle
    assert ankle == pytest.approx((2.55, 2.6))
