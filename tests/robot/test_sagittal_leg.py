"""The leg in its plane, against the whole chain of joints."""

from dataclasses import replace

import numpy as np
import pytest

from gaitchain.balance.leg_ik import leg_joints
from gaitchain.balance.leg_kinematics import legs_of, posture
from gaitchain.errors import UnreachableError
from gaitchain.robot.box_robot import load_box_robot
from gaitchain.robot.sagittal_leg import sagittal_leg

RES = load_box_robot("res")
LEG = RES.reduced.leg_length
PLANE = sagittal_leg(RES.legs)


@pytest.mark.parametrize("ahead", [-0.2, 0.0, 0.15])
@pytest.mark.parametrize("height", [0.5, 0.7, 0.86])
def test_it_bends_as_the_whole_leg_does(ahead, height):
    """Oracle: Newton's method on all joints of the leg."""
    legs, (x, z) = legs_of(RES), (ahead * LEG, height * LEG)
    ankle = np.array([-x, 0.5 * legs.hip_width, -z])
    count = RES.legs.leg_joints
    joints = leg_joints(legs, 0, ankle, np.eye(3), legs.start[:count])
    bend = PLANE.bend(x, z)
    assert bend[:3] == pytest.approx(joints[list(PLANE.joints)], abs=1e-6)
    found = posture(legs, np.concatenate([joints, legs.start[count:]]))
    knee = found.centres[0, PLANE.joints[1], 0] - found.ankles[0, 0]
    assert bend.knee_ahead == pytest.approx(knee, abs=1e-6)


def test_the_stand_is_where_its_angles_put_it():
    found = posture(legs_of(RES), np.array(RES.legs.stand))
    assert PLANE.stands_ahead(RES.legs) == pytest.approx(-found.ankles[0, 0])


def test_out_of_reach_the_leg_is_straight():
    assert PLANE.bend(0.3 * LEG, 1.1 * LEG).fold == 0.0
    assert PLANE.bend(0.3 * LEG, 0.9 * LEG).fold > 0.0


def test_a_leg_cannot_be_shorter_than_its_links_differ():
    longer = replace(PLANE, thigh=1.5 * PLANE.thigh)
    with pytest.raises(UnreachableError, match="too near"):
        longer.bend(0.0, 0.01 * LEG)


def test_angles_are_within_a_part_of_the_range_or_not():
    bend = PLANE.bend(0.0, 0.7 * LEG)
    part = max(map(abs, bend[:3])) / RES.legs.upper[0]
    assert PLANE.within(RES.legs, bend, (part + 1e-6,) * 3)
    assert not PLANE.within(RES.legs, bend, (part - 1e-6,) * 3)


def test_a_leg_that_bends_in_no_plane_has_none():
    aside = np.array(RES.legs.axis)[..., [1, 0, 2]]
    assert sagittal_leg(replace(RES.legs, axis=aside)) is None
