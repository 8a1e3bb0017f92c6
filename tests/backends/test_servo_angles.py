"""Joint angles and servo counts: there and back, limits, turns."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from servo_bench import mounted_oddly

from gaitchain.backends.dynamixel.make import MAKE
from gaitchain.backends.servos.angles import ServoAngles, shortest_turn_deg
from gaitchain.backends.servos.calibration import JointCalibration
from gaitchain.backends.servos.guide import angle_of
from gaitchain.backends.servos.table import COUNTS, DEG_PER_COUNT

_COUNT_RAD = np.radians(DEG_PER_COUNT)


@st.composite
def joints(draw):
    """A joint whose range its servo can turn through; at a whole turn its ends meet."""
    low = draw(st.floats(0.0, 350.0))
    high = draw(st.floats(low + 5.0, min(low + 359.0, 360.0)))
    sign = draw(st.sampled_from([1, -1]))
    offset = draw(st.floats(-360.0, 720.0))
    ends = sorted(sign * (end - offset) for end in (low, high))
    return JointCalibration(1, sign, offset, *ends)


@given(joints(), st.floats(0.0, 1.0))
def test_an_angle_within_the_limits_comes_back(joint, part):
    angles = ServoAngles([joint], MAKE)
    asked = np.radians([joint.lower + part * (joint.upper - joint.lower)])
    goal = angles.goals(asked)
    assert np.all((goal >= 0) & (goal < COUNTS))
    # Half a count of rounding, and at an end up to one more to stay inside.
    assert np.abs(angles.positions(goal) - asked) < 1.6 * _COUNT_RAD


@given(joints(), st.floats(-1e6, 1e6))
def test_no_goal_is_ever_outside_the_limits(joint, asked):
    angles = ServoAngles([joint], MAKE)
    reached = np.degrees(angles.positions(angles.goals(np.array([asked]))))
    assert joint.lower - 1e-3 <= reached <= joint.upper + 1e-3


@given(joints(), st.integers(0, COUNTS - 1), st.integers(-3, 3))
def test_a_limp_servo_that_was_turned_past_its_zero_is_where_it_is(
    joint, counts, turns
):
    angles = ServoAngles([joint], MAKE)
    once = angles.positions(np.array([counts]))
    again = angles.positions(np.array([counts + turns * COUNTS]))
    gap = np.abs(np.exp(1j * once) - np.exp(1j * again))
    assert gap < 1e-9
    middle = np.radians(0.5 * (joint.lower + joint.upper))
    assert np.abs(once - middle) <= np.pi + 1e-9
    gap_deg = np.degrees(once[0]) - angle_of(joint, counts)
    assert abs((gap_deg + 180.0) % 360.0 - 180.0) < 1e-6


@given(joints(), st.integers(-2 * COUNTS, 3 * COUNTS))
def test_whoever_is_not_beyond_its_zero_can_be_held_where_it_is(joint, count):
    angles, counts = ServoAngles([joint], MAKE), np.array([count])
    at = np.degrees(angles.positions(counts))[0]
    outside_deg = max(joint.lower - at, at - joint.upper, 0.0)
    turned_deg = abs(angles.goals(np.radians([at]))[0] - count) * DEG_PER_COUNT
    if not angles.beyond_zero(counts)[0]:
        assert turned_deg <= outside_deg + 2.0 * DEG_PER_COUNT
    elif 0 <= count < COUNTS:
        assert turned_deg >= 360.0 - outside_deg - 2.0 * DEG_PER_COUNT


def test_velocity_has_the_sign_of_the_joint():
    angles = ServoAngles(list(mounted_oddly().joints.values()), MAKE)
    speed = angles.velocities(np.full(12, 100.0))
    assert np.all(np.sign(speed) == np.tile([1, -1], 6))
    assert np.allclose(np.abs(speed), 22.9 * 2.0 * np.pi / 60.0)


def test_the_servos_own_limits_narrow_the_goals():
    angles = ServoAngles([JointCalibration(1, -1, 180.0, -90.0, 90.0)], MAKE)
    angles.narrow(np.array([2000]), np.array([2100]))
    assert angles.goals(np.array([1.5])) == 2000
    assert angles.goals(np.array([-1.5])) == 2100


@given(joints())
def test_the_limits_are_the_ends_of_what_goals_can_be(joint):
    low, high = ServoAngles([joint], MAKE).limits
    assert np.radians(joint.lower) - 1e-9 <= low[0]
    assert high[0] <= np.radians(joint.upper) + 1e-9
    assert high[0] - low[0] > np.radians(joint.upper - joint.lower) - 2.1 * _COUNT_RAD


def test_no_answer_stays_no_number():
    angles = ServoAngles(list(mounted_oddly().joints.values()), MAKE)
    assert np.isnan(angles.positions(np.full(12, np.nan))).all()


@given(st.integers(-9999, 9999), st.integers(-9999, 9999))
def test_the_way_between_two_places_is_the_short_one(start, end):
    way = shortest_turn_deg(np.array([start]), np.array([end]))
    assert -180.0 <= way[0] < 180.0
    rest = (end - start) * DEG_PER_COUNT - way[0]
    assert abs(rest / 360.0 - round(rest / 360.0)) < 1e-9
