"""The standing pose of a robot of boxes, whatever its lengths and limits."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from other_robots import resized

from gaitchain.gait.keypose.feasibility import headroom
from gaitchain.robot.box_robot import load_box_robot
from gaitchain.robot.feet import FootFinder

RES = load_box_robot("res")


def test_res_stands_as_its_library_was_built():
    """To the last digit, as the numbers of its walks follow from it."""
    assert RES.legs.stand.tolist() == 2 * [0.0, 0.0, -0.45, 1.1, -0.65, 0.0]


@given(st.floats(0.02, 2.0), st.floats(0.02, 2.0), st.floats(10.0, 180.0))
def test_hips_are_over_the_ankles_within_the_joints_ranges(crus, femur, limit_deg):
    robot = resized(
        RES,
        crus_length=crus,
        femur_length=femur,
        joint_angle_limit=math.radians(limit_deg),
    )
    feet, leg = FootFinder(robot.legs).find(robot.legs.stand), crus + femur
    assert np.abs(feet.ankles[:, 0]).max() < 0.006 * leg
    np.testing.assert_allclose(feet.turns, 2 * [np.eye(3)], atol=1e-12)
    lower, upper = headroom(robot)
    assert ((robot.legs.stand >= lower) & (robot.legs.stand <= upper)).all()


@pytest.mark.parametrize("limit_deg", [50.0, 80.0])
def test_knees_bend_as_far_as_they_can_and_no_more_than_in_walking(limit_deg):
    robot = resized(RES, joint_angle_limit=math.radians(limit_deg))
    knee = robot.legs.stand[robot.legs.knee]
    assert knee == pytest.approx(min(1.1, math.radians(0.9 * limit_deg)), abs=0.005)
