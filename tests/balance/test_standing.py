"""Standing on two feet of which one may be ahead: what they bear, and who steps."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import Delaunay
from walk_record import walk_record

from gaitchain.balance.gains import derive_gains
from gaitchain.balance.leg_kinematics import legs_of
from gaitchain.balance.standing import settling_zmp, standing_balance
from gaitchain.balance.state import SETTLE, Foot, GaitState, Pelvis, StepTimes
from gaitchain.robot.box_robot import load_box_robot

LEGS = legs_of(load_box_robot("res"))
GAINS = derive_gains(LEGS)
TIMES = StepTimes(
    step=0.46, single=0.4, rise=0.2, shift=1.0, hip_height=0.5, omega=4.0, period=0.01
)
WIDTH = LEGS.hip_width
REAR, FRONT = LEGS.stand_rear + GAINS.sole_margin, LEGS.stand_front - GAINS.sole_margin
FEET = st.builds(Foot, st.floats(-0.2, 0.2), st.floats(-1.5 * WIDTH, -0.5 * WIDTH))
PLACES = st.tuples(st.floats(-0.3, 0.3), st.floats(-1.8 * WIDTH, 0.3 * WIDTH))


def standing(other, dcm):
    """Record of a robot that comes to rest, its DCM there."""
    pelvis = Pelvis(*dcm, 0.0, 0.0)
    state = GaitState(SETTLE, pelvis=pelvis, lift_off=other)
    return walk_record(GAINS, TIMES, state=state)


def corners(other):
    """Ends of both soles on the lines through their ankles, (4, 2) [m]."""
    return np.array(
        [(foot.x + end, foot.y) for foot in (Foot(), other) for end in (REAR, FRONT)]
    )


def inside(other, place):
    return bool(Delaunay(corners(other)).find_simplex(place, tol=1e-9) >= 0)


@given(FEET, PLACES)
def test_two_feet_hold_what_is_over_their_convex_hull(other, dcm):
    balance = standing_balance(LEGS, standing(other, dcm))
    near = min(abs(dcm[1]), abs(dcm[1] - other.y)) < 1e-6
    assert near or balance.is_capturable == inside(other, dcm)


@given(FEET, PLACES)
def test_the_zmp_of_a_robot_that_settles_is_within_the_convex_hull(other, dcm):
    walk = standing(other, dcm)
    zmp = settling_zmp(LEGS, walk, walk.state.pelvis)
    assert inside(other, (zmp.x, zmp.y))


@given(FEET)
def test_it_settles_where_it_is_over_the_middle(other):
    middle = 0.5 * other.x + GAINS.foot_zmp.x, 0.5 * other.y
    walk = standing(other, middle)
    zmp = settling_zmp(LEGS, walk, walk.state.pelvis)
    assert (zmp.x, zmp.y) == pytest.approx(middle)


@pytest.mark.parametrize("ahead", [0.15, -0.15])
def test_the_foot_that_is_further_from_where_it_falls_to_steps(ahead):
    other = Foot(ahead, -WIDTH)
    back, front = (-0.3, -0.5 * WIDTH), (0.3, -0.5 * WIDTH)
    for dcm, swing in ((back, ahead > 0.0), (front, ahead < 0.0)):
        balance = standing_balance(LEGS, standing(other, dcm))
        assert not balance.is_capturable
        assert balance.swing_steps == swing


@given(st.floats(-0.2, 0.2), st.floats(-0.3, 0.3))
def test_beside_both_feet_the_one_on_that_side_steps(ahead, x):
    other = Foot(ahead, -WIDTH)
    assert standing_balance(LEGS, standing(other, (x, -1.1 * WIDTH))).swing_steps
    assert not standing_balance(LEGS, standing(other, (x, 0.1 * WIDTH))).swing_steps
