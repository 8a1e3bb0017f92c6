"""Where the search begins: at what the plan can make with the robot's legs."""

import dataclasses
import math
import re
from functools import partial

import pytest
from other_robots import with_legs

from gaitchain.build.knee_load import overload
from gaitchain.build.search_walks import Walk, fits, walk_of
from gaitchain.build.shape_start import PACE, Plan, plan_of
from gaitchain.errors import LibraryError
from gaitchain.gait.stride.shape import MODEL_SHAPE, StrideShape
from gaitchain.robot.box_robot import load_box_robot

RES = load_box_robot("res")
ANKLES = 4, 10  # left and right ankle pitch


def with_ankles(bend_deg):
    """RES, its ankles' ranges cut."""
    lower, upper = list(RES.legs.lower), list(RES.legs.upper)
    for joint in ANKLES:
        lower[joint] = max(lower[joint], -math.radians(bend_deg))
        upper[joint] = min(upper[joint], math.radians(bend_deg))
    legs = dataclasses.replace(RES.legs, lower=tuple(lower), upper=tuple(upper))
    return with_legs(RES, legs)


def start_of(robot, usual=MODEL_SHAPE, limit=math.inf):
    return plan_of(robot, usual, partial(StrideShape.timing, robot=robot), limit, 1)


@pytest.mark.slow
def test_legs_that_can_do_it_begin_as_usual():
    start = start_of(RES)
    assert start.at(PACE) == MODEL_SHAPE
    assert start.pace == PACE
    assert start.hips(PACE)[0] < MODEL_SHAPE.hip_height < start.hips(PACE)[1]


@pytest.mark.slow
def test_ankles_that_bend_little_begin_with_straighter_knees():
    robot = with_ankles(40.0)
    usual = MODEL_SHAPE, MODEL_SHAPE.timing(robot)
    assert not fits(robot, *usual, Walk(1.0), PACE, math.inf)
    start = start_of(robot)
    assert start.at(PACE).hip_height > MODEL_SHAPE.hip_height
    assert start.pace > 0.0
    shape = start.at(start.pace)
    assert fits(robot, shape, shape.timing(robot), Walk(1.0), start.pace, math.inf)


def test_where_no_walk_can_be_made_the_limits_are_named():
    with pytest.raises(LibraryError) as raised:
        start_of(with_ankles(20.0))
    said = str(raised.value)
    needed = re.findall(r"right_ankle_pitch would have to turn to (-?[\d.]+) deg", said)
    assert said.count("its range is -20.0 to 20.0 and plans use 98% of it") == 3
    # The lower the hips the further an ankle bends, and never less than it stands.
    low, usual, high = (abs(float(angle)) for angle in needed)
    assert low > usual > high > 20.0
    assert low > math.degrees(math.acos(0.78))
    assert said.count("legs high") == 3


def with_knees(torque_n_m):
    """RES, its knees' torque limits cut."""
    limits = list(RES.legs.torque_limit)
    limits[3] = limits[9] = torque_n_m
    return with_legs(RES, dataclasses.replace(RES.legs, torque_limit=tuple(limits)))


def bent_knee_torque(hip_height):
    """What a knee holds that bears RES's weight with thigh and shank alike bent."""
    biped = RES.reduced
    thigh, shank, hips = biped.femur_length, biped.crus_length, hip_height
    hips *= biped.leg_length
    ankle = math.acos((shank**2 + hips**2 - thigh**2) / (2.0 * shank * hips))
    return 9.81 * biped.mass * shank * math.sin(ankle)


@pytest.mark.parametrize("hip_height", [0.8, 0.87, 0.95])
def test_a_knee_bears_the_weight_at_its_lever(hip_height):
    """Less what is below it; by the triangle of thigh, shank and leg."""
    shape = dataclasses.replace(MODEL_SHAPE, hip_height=hip_height)
    timing = shape.timing(RES)
    needed = bent_knee_torque(hip_height)

    def said(torque_n_m):
        robot = with_knees(torque_n_m)
        poses, _ = walk_of(robot, shape, timing.step, Walk(1.0), 0.0)
        return overload(poses, timing)

    assert said(1.02 * needed) == ""
    assert said(0.85 * needed).startswith("left_knee would have to hold ")
    assert said(0.85 * needed).endswith(f"its limit is {0.85 * needed:.3g}")


def test_where_knees_cannot_bear_the_robot_their_torque_is_named():
    with pytest.raises(LibraryError, match=r"0\.98 legs high, left_knee would have to"):
        start_of(with_knees(5.0))


@pytest.mark.slow
def test_weak_knees_begin_straighter():
    start = start_of(with_knees(bent_knee_torque(0.94)))
    assert start.at(PACE).hip_height > MODEL_SHAPE.hip_height
    assert start.hips(PACE)[0] > 0.87


@pytest.mark.slow
def test_slow_joints_begin_slower():
    start = start_of(RES, limit=90.0)
    assert 0.0 < start.pace < PACE


def test_hips_are_searched_around_the_only_height_that_can_be_made():
    low, high = (dataclasses.replace(MODEL_SHAPE, hip_height=h) for h in (0.8, 0.98))
    plan = Plan(MODEL_SHAPE, (low, high), (0.0, 0.2))
    assert plan.at(0.2) == high
    below, above = plan.hips(0.2)
    assert 0.96 < below < 0.98 < above < 1.0
