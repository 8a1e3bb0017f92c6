"""Where the search begins: at what the plan can make with the robot's legs."""

import dataclasses
import math
from functools import partial

import pytest
from other_robots import with_legs

from gaitchain.build.search_walks import Walk, fits
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
    assert "0.78 legs high, right_ankle_pitch would go beyond its range of" in said
    assert "-20.0 to 20.0 deg" in said
    assert said.count("legs high") == 3


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
