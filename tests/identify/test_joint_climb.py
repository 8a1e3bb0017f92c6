"""Numbers that climb on from a search, on sensors that can be written down."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from joint_sensors import GROUPS, JOINTS, OWN, SIZE, rough, searched

from gaitchain.identify.joint_climb import JointClimb
from gaitchain.identify.joint_search import Group, JointSearch

WIDE = np.tile([-10.0, 10.0], (SIZE, 1))


def climbed(search, generations, missed, bounds=WIDE, count=32, seed=0):
    climb = JointClimb(search, bounds, count, seed)
    for _ in range(generations):
        tried = climb.ask()
        assert (tried >= bounds[:, 0]).all()
        assert (tried <= bounds[:, 1]).all()
        climb.tell(tried, missed(tried))
    return climb.found


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 2**31))
def test_all_joints_find_their_own_numbers_at_once(seed):
    true = np.random.default_rng(seed).standard_normal(SIZE)
    search = searched(true, 2, np.eye(SIZE), seed)

    def missed(tried):
        return 1e4 * np.sum(rough(tried, true) ** 2, axis=1)

    found = climbed(search, 34, missed, seed=seed)
    np.testing.assert_allclose(found[:-2], true[:-2], atol=0.05)
    np.testing.assert_array_equal(found[-2:], 0.0)


def test_it_gets_along_a_valley_on_which_a_search_ends():
    """Sums are told a hundred times as well as differences."""
    group = [Group(np.arange(2), np.arange(1))]
    true, told = np.array([-3.0, 3.0]), np.array([[1e3, 1e3], [10.0, -10.0]])

    def missed(tried):
        return np.sum(((tried - true) @ told.T) ** 2, axis=1)[:, None]

    def begun():
        return JointSearch(np.zeros(2), np.eye(2), group)

    search, rng = begun(), np.random.default_rng(0)
    for _ in range(12):
        tried = search.draw(96, rng)
        search.select(tried, missed(tried))
    found = climbed(begun(), 36, missed, WIDE[:2])
    far, near = (np.linalg.norm(each - true) for each in (search.found, found))
    assert near < 0.05
    assert far > 0.5


def test_it_stays_within_bounds_and_finds_what_is_at_them():
    true = np.zeros(SIZE)
    bounds = np.tile([0.0, 2.0], (SIZE, 1))
    search = searched(true + 0.5, 2, np.eye(SIZE))

    def missed(tried):
        return 1e4 * np.sum(rough(tried, true) ** 2, axis=1)

    found = climbed(search, 34, missed, bounds)
    np.testing.assert_allclose(found[: JOINTS * OWN], 0.0, atol=0.05)


def test_what_no_sensor_tells_is_what_the_rest_makes_likely():
    alike = np.full((SIZE, SIZE), 0.95) + 0.05 * np.eye(SIZE)
    true = np.full(SIZE, 1.5)
    search = searched(true, 2, alike)

    def missed(tried):
        squares = 1e4 * np.sum(rough(tried, true) ** 2, axis=1)
        squares[:, -1] = 0.0
        return squares

    found = climbed(search, 34, missed)
    np.testing.assert_allclose(found[GROUPS[-1].numbers], 1.5, atol=0.5)


def test_the_same_seed_asks_for_the_same():
    search = searched(np.ones(SIZE), 2, np.eye(SIZE))
    one, same, other = (JointClimb(search, WIDE, 8, seed).ask() for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, same)
    assert not np.array_equal(one, other)
    assert one[:, 0] != pytest.approx(one[0, 0])
