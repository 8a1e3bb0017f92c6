"""The ZMP of points and of the full robot: where they must agree, and where not."""

from dataclasses import replace

import numpy as np
import pytest
from other_robots import with_legs

from gaitchain.analysis.zmp_error import zmp_error
from gaitchain.robot.box_robot import box_legs, load_box_robot
from gaitchain.robot.leg_model import LegModel

RES = load_box_robot("res")
BOXES = box_legs(RES.reduced)


def robot(legs: LegModel):
    return with_legs(RES, legs)


def test_it_vanishes_for_links_that_are_points():
    nothing = np.zeros_like(BOXES.inertia)
    points = replace(BOXES, inertia=nothing, trunk_inertia=np.zeros((3, 3)))
    error = zmp_error(robot(points))
    assert 0.0 <= error.ahead < 2e-5
    assert 0.0 <= error.left < 2e-5


def test_it_grows_with_the_links_inertia():
    once = zmp_error(robot(BOXES))
    twice = zmp_error(robot(replace(BOXES, inertia=2.0 * BOXES.inertia)))
    assert once.ahead > 5e-4
    assert twice.ahead == pytest.approx(2.0 * once.ahead, rel=0.1)


def test_rotors_do_not_push_the_ground():
    heavy = replace(BOXES, armature=np.full(12, 0.5))
    assert zmp_error(robot(heavy)) == pytest.approx(zmp_error(robot(BOXES)))


def test_boxes_and_their_anatomy_are_one_robot():
    """Rounded: the links without mass have a little in the skeleton."""
    assert zmp_error(RES) == pytest.approx(zmp_error(robot(BOXES)), abs=2e-5)


def test_where_the_base_is_does_not_matter():
    ahead = np.array([0.07, 0.0, 0.0])
    at = BOXES.at.copy()
    at[:, 0] += ahead
    moved = replace(BOXES, at=at, trunk_com=BOXES.trunk_com + ahead)
    error = tuple(zmp_error(robot(moved)))
    assert error == pytest.approx(tuple(zmp_error(robot(BOXES))), abs=2e-5)
