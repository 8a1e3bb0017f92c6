"""Swing, Lift and Move by forward kinematics; composing and factorising poses."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gaitchain.errors import UnreachableError
from gaitchain.gait.keypose.primitives import (
    PARAMETERS,
    compose,
    compose_rates,
    factorise,
    lift,
    move,
    move_by_swing_leg,
    swing,
)
from gaitchain.robot.box_robot import load_box_robot
from gaitchain.robot.kinematics import points

RES = load_box_robot("res")
BIPED = RES.reduced
CRUS, FEMUR = BIPED.crus_length, BIPED.femur_length
ANKLE_HEIGHT = np.array([0.0, 0.0, BIPED.ankle_height])
REACH = r"reachable: 0\.1000 to 0\.5920 m"

ANY_POSE = st.integers(0, 2**32 - 1).map(
    lambda seed: np.random.default_rng(seed).uniform(-0.6, 0.6, 7)
)
REACHES = st.floats(0.2, 0.585)
LEANS = st.floats(-0.8, 0.8)
SWAYS = st.floats(-0.6, 0.6)


@st.composite
def reachable(draw):
    """Parameters whose legs are neither straight nor folded."""
    support, swinging = draw(REACHES), draw(REACHES)
    lean, swing_lean = draw(LEANS), draw(LEANS)
    hip_x, hip_height = support * np.sin(lean), support * np.cos(lean)
    sway = draw(SWAYS)
    foot_x = hip_x - swinging * np.sin(swing_lean)
    foot_z = (hip_height - swinging * np.cos(swing_lean)) * np.cos(sway)
    return np.array([hip_x, hip_height, foot_x, foot_z, sway])


@given(ANY_POSE, SWAYS)
def test_swing_sets_both_sways_and_leaves_the_rest(q, sway):
    before = q.copy()
    swung = swing(q, sway)
    np.testing.assert_array_equal(swung[:5], q[:5])
    np.testing.assert_array_equal(swung[5:], [sway, sway])
    np.testing.assert_array_equal(q, before)


@given(reachable(), reachable())
def test_lift_reaches_its_target_and_leaves_the_support_leg(start, target):
    q = compose(RES, start)
    hip_x, hip_height, *_, sway = start
    swing_lean, reach = 0.5 * target[4], 0.3 + 0.2 * target[1]
    foot_x = hip_x - reach * np.sin(swing_lean)
    foot_z = (hip_height - reach * np.cos(swing_lean)) * np.cos(sway)
    lifted = lift(RES, q, foot_x, foot_z)
    ankle = points(BIPED, lifted)[6] - ANKLE_HEIGHT
    np.testing.assert_allclose(ankle[[0, 2]], [foot_x, foot_z], atol=1e-12)
    np.testing.assert_array_equal(lifted[[0, 1, 5, 6]], q[[0, 1, 5, 6]])
    assert lifted[2] == 0.0
    assert lifted[4] >= lifted[3], "the knee bends the human way"


def test_lift_solves_the_papers_two_equations():
    q = swing(move(RES, np.zeros(7), 0.01, 0.52), np.radians(12.0))
    lifted = lift(RES, q, foot_x=0.04, foot_z=0.08)
    l1, l2, l4, l5 = CRUS, FEMUR, FEMUR, CRUS
    q1, q2, _, q4, q5, theta, _ = lifted
    ahead = l1 * np.sin(q1) + l2 * np.sin(q2) - l4 * np.sin(q4) - l5 * np.sin(q5)
    above = l1 * np.cos(q1) + l2 * np.cos(q2) - l4 * np.cos(q4) - l5 * np.cos(q5)
    assert ahead == pytest.approx(0.04, abs=1e-14)
    assert above * np.cos(theta) == pytest.approx(0.08, abs=1e-14)


@given(ANY_POSE, LEANS, REACHES)
def test_move_brings_the_hip_and_keeps_the_swing_angles(q, lean, reach):
    hip_x, hip_height = reach * np.sin(lean), reach * np.cos(lean)
    moved = move(RES, q, hip_x, hip_height)
    np.testing.assert_array_equal(moved[3:], q[3:])
    assert moved[2] == 0.0
    assert moved[0] >= moved[1], "the knee bends the human way"
    hip = points(BIPED, swing(moved, 0.0))[2] - ANKLE_HEIGHT
    np.testing.assert_allclose(hip, [hip_x, 0.0, hip_height], atol=1e-12)


@given(
    st.floats(-0.4, 0.4),
    st.floats(0.9, 1.2),
    st.floats(-0.03, 0.03),
    st.floats(0.0, 0.01),
    SWAYS,
)
def test_move_by_swing_leg_closes_both_equations(q4, knee, foot_x, foot_z, sway):
    q5 = q4 + knee
    posed = swing(np.full(7, 0.1), sway)
    q = move_by_swing_leg(RES, posed, [q4, q5], foot_x, foot_z)
    np.testing.assert_array_equal(q[2:], [0.0, q4, q5, sway, sway])
    sin, cos = np.sin(q), np.cos(q)
    ahead = CRUS * (sin[0] - sin[4]) + FEMUR * (sin[1] - sin[3])
    above = CRUS * (cos[0] - cos[4]) + FEMUR * (cos[1] - cos[3])
    assert ahead == pytest.approx(foot_x, abs=1e-12)
    assert above * np.cos(sway) == pytest.approx(foot_z, abs=1e-12)


@given(reachable(), SWAYS)
def test_swing_commutes_with_move_and_lift(target, sway):
    q = compose(RES, target)
    moved = swing(move(RES, q, target[0], target[1]), sway)
    np.testing.assert_array_equal(
        moved, move(RES, swing(q, sway), target[0], target[1])
    )
    foot_z = target[3] * np.cos(sway) / np.cos(target[4])
    lifted = swing(lift(RES, q, target[2], foot_z, sway), sway)
    other = lift(RES, swing(q, sway), target[2], foot_z, sway)
    np.testing.assert_array_equal(lifted, other)


def test_swing_commutes_with_lift_on_the_table():
    q = compose(RES, np.array([0.0, 0.5, 0.0, 0.0, 0.05]))
    for sway in (0.0, 0.1, -0.2):
        first = lift(RES, swing(q, sway), 0.04, 0.08, sway)
        last = swing(lift(RES, q, 0.04, 0.08, sway), sway)
        np.testing.assert_array_equal(first, last)
        assert points(BIPED, last)[6, 2] - BIPED.ankle_height == pytest.approx(0.08)


@given(reachable())
def test_factorise_inverts_compose(parameters):
    q = compose(RES, parameters)
    factors = factorise(RES, q)
    np.testing.assert_allclose(factors.parameters, parameters, atol=1e-12)
    np.testing.assert_allclose(factors.residual, 0.0, atol=1e-11)


@given(ANY_POSE)
def test_residual_is_what_composing_leaves(q):
    factors = factorise(RES, q)
    again = compose(RES, factors.parameters)
    np.testing.assert_array_equal(factors.residual, q - again)
    ankle, same = (
        points(BIPED, swing(q, 0.0))[6],
        points(BIPED, swing(again, 0.0))[6],
    )
    np.testing.assert_allclose(same, ankle, atol=1e-12)


STANDARD = np.array([0.02, 0.5, 0.1, 0.03, 0.1])


@pytest.mark.parametrize(
    ("joint", "change", "residual"),
    [
        ("trunk", [0, 0, 0.2, 0, 0, 0, 0], [0, 0, 0.2, 0, 0, 0, 0]),
        ("sways", [0, 0, 0, 0, 0, 0.1, -0.1], [0, 0, 0, 0, 0, 0.1, -0.1]),
    ],
)
def test_primitives_do_not_explain(joint, change, residual):
    q = compose(RES, STANDARD) + change
    factors = factorise(RES, q)
    np.testing.assert_allclose(factors.parameters, STANDARD, atol=1e-12)
    np.testing.assert_allclose(factors.residual, residual, atol=1e-12, err_msg=joint)


@pytest.mark.parametrize(("crus", "femur", "leg"), [(0, 1, 1.0), (4, 3, 0.0)])
def test_a_backward_knee_is_all_residual(crus, femur, leg):
    q = compose(RES, STANDARD)
    hip, foot = points(BIPED, swing(q, 0.0))[[2, 6]]
    line = hip - (ANKLE_HEIGHT if leg else foot)
    lean = np.arctan2(line[0], line[2])
    backward = q.copy()
    backward[[crus, femur]] = 2.0 * lean - q[[crus, femur]]
    factors = factorise(RES, backward)
    np.testing.assert_allclose(factors.parameters, STANDARD, atol=1e-12)
    np.testing.assert_allclose(factors.residual, backward - q, atol=1e-12)
    assert abs(factors.residual[crus]) > 0.1
    assert abs(factors.residual[femur]) > 0.1


FAR = pytest.mark.parametrize("far", [0.7, -0.7, np.nan])


@FAR
def test_unreachable_move_says_what_is_in_reach(far):
    with pytest.raises(UnreachableError, match=rf"^Move: .* m apart; {REACH}$"):
        move(RES, np.zeros(7), far, 0.5)
    with pytest.raises(UnreachableError, match=REACH):
        move(RES, np.zeros(7), [0.0, far], 0.5)
    with pytest.raises(UnreachableError, match=REACH):
        move_by_swing_leg(RES, np.zeros(7), [0.2, 0.3], far)


@FAR
def test_unreachable_lift_says_what_is_in_reach(far):
    q = compose(RES, STANDARD)
    with pytest.raises(UnreachableError, match=rf"^Lift: .* m apart; {REACH}$"):
        lift(RES, q, far, 0.02)
    with pytest.raises(UnreachableError, match=REACH):
        lift(RES, q, 0.0, 2.0 * far)
    with pytest.raises(UnreachableError, match=REACH):
        compose(RES, np.array([0.0, 0.5, far, 0.0, 0.0]))


def test_a_folded_leg_is_out_of_reach_and_a_straight_one_is_not():
    with pytest.raises(UnreachableError, match=r"0\.0500 m apart"):
        move(RES, np.zeros(7), 0.0, 0.05)
    straight = move(RES, np.zeros(7), 0.0, BIPED.leg_length)
    np.testing.assert_allclose(straight, 0.0, atol=1e-6)


@given(reachable(), st.integers(0, 2**32 - 1))
def test_rates_match_finite_differences(parameters, seed):
    rates = np.random.default_rng(seed).uniform(-0.1, 0.1, 5)
    h = 1e-5
    steps = [compose(RES, parameters + k * h * rates) for k in (-2, -1, 1, 2)]
    found = np.tensordot([1.0, -8.0, 8.0, -1.0], steps, axes=1) / (12.0 * h)
    computed = compose_rates(RES, parameters, rates)
    np.testing.assert_allclose(computed, found, atol=1e-7, rtol=1e-7)


def test_batches_broadcast():
    rng = np.random.default_rng(2)
    batch = STANDARD + rng.uniform(-0.01, 0.01, (2, 3, 5))
    rates = rng.uniform(-1.0, 1.0, (2, 3, 5))
    q, dq = compose(RES, batch), compose_rates(RES, batch, rates)
    factors = factorise(RES, q)
    assert q.shape == dq.shape == factors.residual.shape == (2, 3, 7)
    assert factors.parameters.shape == (2, 3, len(PARAMETERS))
    for i in np.ndindex(2, 3):
        np.testing.assert_allclose(q[i], compose(RES, batch[i]), atol=1e-14)
        one = compose_rates(RES, batch[i], rates[i])
        np.testing.assert_allclose(dq[i], one, atol=1e-13)

    one, many = q[0, 0], np.array([0.0, 0.05, 0.1, 0.15])
    assert swing(q[:, :1], many[:3]).shape == (2, 3, 7)
    assert lift(RES, one, many, 0.02).shape == (4, 7)
    assert lift(RES, one, 0.0, 0.02, many).shape == (4, 7)
    assert move(RES, one, 0.0, 0.4 + many).shape == (4, 7)
    angles = np.stack([many, many + 0.9], axis=-1)
    assert move_by_swing_leg(RES, q[:, :1], angles, 0.05).shape == (2, 4, 7)
    column = lift(RES, q[0], many[:, None], 0.02)
    assert column.shape == (4, 3, 7)
    np.testing.assert_array_equal(column[2, 1], lift(RES, q[0, 1], 0.1, 0.02))
