"""Numbers that are selected joint by joint, on sensors that can be written down."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from joint_sensors import GROUPS, SIZE, rough, searched

from gaitchain.identify.joint_search import Group, JointSearch


@given(st.integers(0, 2**31))
def test_all_joints_find_their_own_numbers_at_once(seed):
    true = np.random.default_rng(seed).standard_normal(SIZE)
    found = searched(true, 12, np.eye(SIZE), seed).found
    np.testing.assert_allclose(found[:-2], true[:-2], atol=0.1)
    np.testing.assert_array_equal(found[-2:], 0.0)


def test_the_first_numbers_drawn_are_as_alike_as_is_believed():
    alike = np.full((SIZE, SIZE), 0.8) + 0.2 * np.eye(SIZE)
    search = JointSearch(np.ones(SIZE), alike, GROUPS)
    drawn = search.draw(20_000, np.random.default_rng(1))
    np.testing.assert_array_equal(drawn[0], 1.0)
    np.testing.assert_array_equal(drawn[:, -2:], 1.0)
    own = np.cov(drawn[:, :-2].T)
    np.testing.assert_allclose(own, alike[:-2, :-2], atol=0.05)


def test_what_no_sensor_tells_is_what_the_rest_makes_likely():
    """The last joint shows nothing; its numbers are believed to be the others'."""
    alike = np.full((SIZE, SIZE), 0.95) + 0.05 * np.eye(SIZE)
    true = np.full(SIZE, 1.5)
    search = JointSearch(np.zeros(SIZE), alike, GROUPS)
    rng = np.random.default_rng(2)
    for _ in range(15):
        tried = search.draw(96, rng)
        missed = 1e4 * np.sum(rough(tried, true) ** 2, axis=1)
        missed[:, -1] = 0.0
        search.select(tried, missed)
    blind = search.found[GROUPS[-1].numbers]
    np.testing.assert_allclose(blind, 1.5, atol=0.5)


def test_the_best_of_few_count_most():
    """Of two replays the better one; ties are the first's."""
    search = JointSearch(np.zeros(2), np.eye(2), [Group(np.arange(2), np.arange(1))])
    tried = np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]])
    search.select(tried, np.array([[100.0], [1.0], [1e6]]))
    assert 0.5 < search.found[0] < 1.0
    assert search.found == pytest.approx([search.found[0]] * 2)
