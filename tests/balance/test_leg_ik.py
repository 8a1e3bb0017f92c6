"""Inverse kinematics of legs as robots have them: offset, with 5 to 7 joints."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from leg_makes import (
    MAKES,
    NO_ANKLE_ROLL,
    NO_YAW,
    RES,
    SEVEN,
    make_legs,
)

from gaitchain.balance.leg_ik import _PLACE, leg_joints
from gaitchain.balance.leg_kinematics import legs_of, posture
from gaitchain.balance.rotations import about, rotation

SEEDS, LEGS = st.integers(0, 2**32 - 1), st.sampled_from([0, 1])


def placed(legs, leg, own):
    """Joint centres and axes of one leg, its ankle and its foot."""
    joints = np.zeros(2 * len(own))
    joints[leg * len(own) : (leg + 1) * len(own)] = own
    found = posture(legs, joints)
    return found.centres[leg], found.axes[leg], found.ankles[leg], found.feet[leg]


def straight_knee(legs, leg):
    """Knee angle at which the leg is longest, to a degree."""
    thigh, shank = legs.at[leg, legs.knee], legs.at[leg, legs.knee + 1]
    bends = np.radians(np.arange(-60, 61))
    axis = legs.axis[leg, legs.knee]
    lengths = [np.linalg.norm(thigh + about(axis, b) @ shank) for b in bends]
    return bends[int(np.argmax(lengths))]


def some_pose(legs, leg, rng):
    count = legs.link_mass.shape[1]
    own = legs.start[:count] + rng.uniform(-0.4, 0.4, count)
    own[legs.knee] = straight_knee(legs, leg) + rng.uniform(0.5, 1.6)
    return own


def errors(legs, leg, own, ankle, foot):
    """Position error, and the rotation vector still to go, both in the pelvis frame."""
    _, _, at, turn = placed(legs, leg, own)
    rest = foot @ turn.T
    skew = 0.5 * np.array(
        [rest[2, 1] - rest[1, 2], rest[0, 2] - rest[2, 0], rest[1, 0] - rest[0, 1]]
    )
    sine = np.linalg.norm(skew)
    angle = np.arctan2(sine, 0.5 * (np.trace(rest) - 1.0))
    return ankle - at, skew * (angle / sine if sine > 1e-12 else 1.0)


def jacobian(legs, leg, own):
    centres, axes, ankle, _ = placed(legs, leg, own)
    return np.vstack([np.cross(axes, ankle - centres).T, axes.T])


def some_target(make, seed, leg):
    """A leg of some make, a pose of it, and where its foot is then."""
    rng = np.random.default_rng(seed)
    legs = make_legs(make, rng)
    pose = some_pose(legs, leg, rng)
    _, _, ankle, foot = placed(legs, leg, pose)
    return rng, legs, pose, ankle, foot


@pytest.mark.parametrize("make", [*MAKES, NO_YAW, NO_ANKLE_ROLL, SEVEN])
@settings(max_examples=60)
@given(SEEDS, LEGS)
def test_offset_legs_find_a_target_they_can_meet(make, seed, leg):
    rng, legs, pose, ankle, foot = some_target(make, seed, leg)
    start = pose + rng.uniform(-0.2, 0.2, len(pose))
    found = leg_joints(legs, leg, ankle, foot, start)
    off = errors(legs, leg, found, ankle, foot)
    np.testing.assert_allclose(off, 0.0, atol=1e-7)


@pytest.mark.parametrize("make", [NO_YAW, NO_ANKLE_ROLL])
@settings(max_examples=60)
@example(seed=671, leg=1)
@given(SEEDS, LEGS)
def test_five_joints_meet_the_place_and_the_rest_as_well_as_they_can(make, seed, leg):
    """No pose near by has the ankle there and the foot turned less wrong."""
    rng, legs, pose, ankle, foot = some_target(make, seed, leg)
    foot = rotation(*rng.uniform(-0.15, 0.15, 3)) @ foot
    found = leg_joints(legs, leg, ankle, foot, pose)
    place, turn = errors(legs, leg, found, ankle, foot)
    # What the weight of a place leaves of it: a turn, over levers of 5 cm or more.
    most = np.linalg.norm(turn) / 0.05 / _PLACE**2
    np.testing.assert_allclose(place, 0.0, atol=most + 1e-9)
    columns = jacobian(legs, leg, found)
    free = np.linalg.svd(columns[:3])[2][3:]  # joints' ways that leave the ankle
    np.testing.assert_allclose(free @ columns[3:].T @ turn, 0.0, atol=1e-3)


@settings(max_examples=60)
@given(SEEDS, LEGS)
def test_seven_joints_move_as_little_as_possible(seed, leg):
    """To a target near by, no way that leaves the foot is gone."""
    rng = np.random.default_rng(seed)
    legs = make_legs(SEVEN, rng)
    pose = some_pose(legs, leg, rng)
    near = pose + rng.uniform(-1e-3, 1e-3, 7)
    _, _, ankle, foot = placed(legs, leg, near)
    found = leg_joints(legs, leg, ankle, foot, pose)
    idle = np.linalg.svd(jacobian(legs, leg, pose))[2][6]
    assert abs(idle @ (found - pose)) < 1e-4


@pytest.mark.parametrize("make", MAKES)
@settings(max_examples=40)
@given(SEEDS, LEGS, st.floats(1.1, 6.0))
def test_a_foot_out_of_reach_is_met_in_direction(make, seed, leg, distance):
    """The leg points at it, all but straight, and the sole lies as it should."""
    rng = np.random.default_rng(seed)
    legs = make_legs(make, rng)
    pose = some_pose(legs, leg, rng)
    way = np.array([*rng.uniform(-0.2, 0.2, 2), -1.0])
    way /= np.linalg.norm(way)
    hip = placed(legs, leg, pose)[0][0]
    ankle = hip + distance * (legs.reach + 0.2) * way
    found = pose
    for _ in range(6):  # as from one control period to the next
        found = leg_joints(legs, leg, ankle, np.eye(3), found)
    centres, _, at, foot = placed(legs, leg, found)
    hip, end = centres[legs.knee - 1], centres[legs.knee + 1]
    assert 0.95 * legs.reach < np.linalg.norm(end - hip) < 1.002 * legs.reach
    np.testing.assert_allclose(foot, np.eye(3), atol=0.01)
    to_go = ankle - (at - end) - hip  # the level foot goes along
    cosine = (end - hip) @ to_go / np.linalg.norm(end - hip) / np.linalg.norm(to_go)
    assert cosine > 0.9999


@pytest.mark.parametrize("make", [*MAKES, NO_YAW, NO_ANKLE_ROLL, SEVEN])
@settings(max_examples=40)
@given(SEEDS, LEGS, st.floats(-1e6, 1e6), st.booleans())
def test_singular_and_absurd_targets_give_numbers(make, seed, leg, size, straight):
    rng = np.random.default_rng(seed)
    legs = make_legs(make, rng)
    count = legs.link_mass.shape[1]
    start = np.zeros(count) if straight else rng.uniform(-3.0, 3.0, count)
    foot = rotation(*rng.uniform(-4.0, 4.0, 3))
    for ankle in (size * rng.normal(size=3), np.zeros(3), legs.at[leg, 0]):
        assert np.isfinite(leg_joints(legs, leg, ankle, foot, start)).all()


@pytest.mark.parametrize("leg", [0, 1])
def test_the_straight_box_leg_gives_numbers(leg):
    """Yaw in line with the leg, hip and ankle pitch with the knee's: singular twice."""
    legs = legs_of(RES)
    for ankle, foot in (
        (placed(legs, leg, np.zeros(6))[2], np.eye(3)),
        (legs.at[leg, 0], np.eye(3)),
        (placed(legs, leg, np.zeros(6))[2], np.diag([-1.0, 1.0, -1.0])),
    ):
        found = leg_joints(legs, leg, ankle, foot, np.zeros(6))
        assert np.isfinite(found).all()


def test_the_start_is_left_alone():
    legs, start = legs_of(RES), np.zeros(6)
    leg_joints(legs, 0, np.array([0.1, 0.1, -0.5]), np.eye(3), start)
    np.testing.assert_array_equal(start, 0.0)
