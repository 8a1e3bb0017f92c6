"""A robot with other servo gains than those of its file."""

import json
from dataclasses import replace

import numpy as np
import pytest
from other_robots import with_legs

from gaitchain.gait.library_file import check_robot
from gaitchain.robot.box_robot import load_box_robot
from gaitchain.robot.identified import Identified
from gaitchain.robot.storage import robot_arrays, robot_facts, robot_from
from gaitchain.sim.model import build_model
from gaitchain.sim.world import World

RES = load_box_robot("res")
FULL = with_legs(RES, RES.legs)
ROBOTS = pytest.mark.parametrize("robot", [RES, FULL], ids=["boxes", "full"])


def stored(robot):
    return robot_from(json.loads(json.dumps(robot_facts(robot))), robot_arrays(robot))


@ROBOTS
def test_softer_servos_are_those_of_a_world_with_softer_servos(robot):
    world = build_model(robot, World(servo_gain=0.5))
    own = build_model(robot.with_servo_gain(0.5))
    for name in ("actuator_gainprm", "actuator_biasprm", "dof_damping"):
        np.testing.assert_allclose(getattr(own, name), getattr(world, name))


@ROBOTS
def test_the_gain_is_that_of_the_file(robot):
    soft = robot.with_servo_gain(0.5)
    assert soft.fingerprint != robot.fingerprint
    assert soft.with_servo_gain(0.25) == robot.with_servo_gain(0.25)
    assert soft.with_servo_gain(1.0) == robot
    assert soft.in_file == robot
    assert soft.nominal == soft


@ROBOTS
def test_it_is_stored(robot):
    soft = robot.with_servo_gain(0.5)
    assert stored(soft) == soft
    assert stored(soft).servo_gain == 0.5
    assert stored(robot) == robot


@pytest.mark.parametrize("wrong", [0.0, -1.0, float("inf"), "half", None])
def test_a_gain_that_cannot_be_is_refused(wrong):
    facts = {**robot_facts(RES.with_servo_gain(0.5)), "servo_gain": wrong}
    with pytest.raises(ValueError, match="servo gain"):
        robot_from(facts, robot_arrays(RES))


def test_what_is_identified_of_a_robot_adds_to_its_gain():
    plain = Identified.of_file(len(FULL.legs.joint_names))
    found = FULL.with_servo_gain(0.5).as_identified(plain)
    np.testing.assert_allclose(found.legs.stiffness, 0.5 * FULL.legs.stiffness)
    assert found.nominal == FULL.with_servo_gain(0.5)
    assert found.in_file == FULL
    assert stored(found) == found


def test_a_library_with_softer_servos_is_of_the_robot_of_the_file(brisk):
    soft = replace(brisk.poses, robot=brisk.robot.with_servo_gain(0.5))
    check_robot(replace(brisk, poses=soft), brisk.robot)
    shown = dict(replace(brisk, poses=soft).describe())
    assert shown["servo gains"] == "0.5 of the file's"
    assert "servo gains" not in dict(brisk.describe())
