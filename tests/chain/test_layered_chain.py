"""The layered chain: Eq. 4, gait probability, sampling, cutting nodes (Fig. 5)."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gaitchain.chain.layered_chain import LayeredChain, draw_gaits
from gaitchain.chain.pruning import all_gaits
from gaitchain.errors import ChainError

SIZES = st.lists(st.integers(1, 5), min_size=2, max_size=4)
SEEDS = st.integers(0, 2**32 - 1)

FIRST = np.array([[0.25, 0.75], [1.0, 0.0]])
SECOND = np.array([[0.5, 0.5], [0.2, 0.8]])


def random_chain(sizes, seed, cyclic=False):
    rng = np.random.default_rng(seed)
    shapes = pairwise(sizes)
    return LayeredChain(
        tuple(rng.dirichlet(np.ones(right), size=left) for left, right in shapes),
        cyclic,
    )


def test_gait_probability_by_hand():
    chain = LayeredChain((FIRST, SECOND))
    gaits = np.array([[0, 1, 0], [0, 0, 1], [1, 1, 1]])
    np.testing.assert_allclose(chain.gait_probability(gaits), [0.15, 0.125, 0.0])
    first = np.array([0.4, 0.6])
    expected = [0.06, 0.05, 0.0]
    np.testing.assert_allclose(chain.gait_probability(gaits, first), expected)
    assert chain.gait_probability(gaits[0]).shape == ()
    assert chain.gait_probability(gaits.reshape(1, 3, 3)).shape == (1, 3)


@given(SIZES, SEEDS)
def test_all_paths_from_a_start_sum_to_one(sizes, seed):
    chain = random_chain(sizes, seed)
    gaits = all_gaits(sizes)
    probability = chain.gait_probability(gaits)
    sums = np.bincount(gaits[:, 0], probability)
    np.testing.assert_allclose(sums, 1.0, atol=1e-12)
    prior = np.full(sizes[0], 1.0 / sizes[0])
    assert chain.gait_probability(gaits, prior).sum() == pytest.approx(1.0)


@given(SIZES, SEEDS, st.data())
def test_keep_leaves_a_chain_of_conditional_probabilities(sizes, seed, data):
    chain = random_chain(sizes, seed)
    kept = [
        np.array(sorted(data.draw(st.sets(st.integers(0, n - 1), min_size=1))))
        for n in sizes
    ]
    smaller = chain.keep(kept)
    assert smaller.is_stochastic()
    assert smaller.layer_sizes == tuple(len(group) for group in kept)
    # Cutting keeps the odds of two kept targets.
    for layer, matrix in enumerate(smaller.transitions):
        old = chain.transitions[layer][np.ix_(kept[layer], kept[layer + 1])]
        np.testing.assert_allclose(matrix * old[:, :1], old * matrix[:, :1], atol=1e-12)


def test_keep_by_hand():
    first = np.array([[0.2, 0.3, 0.5], [0.1, 0.6, 0.3]])
    second = np.array([[1.0, 0.0], [0.5, 0.5], [0.25, 0.75]])
    smaller = LayeredChain((first, second)).keep([[0, 1], [0, 2], [0, 1]])
    np.testing.assert_allclose(smaller.transitions[0], [[2 / 7, 5 / 7], [0.25, 0.75]])
    np.testing.assert_allclose(smaller.transitions[1], [[1, 0], [0.25, 0.75]])


def test_uniform():
    chain = LayeredChain.uniform((2, 4, 2))
    assert chain.layer_sizes == (2, 4, 2)
    assert chain.cyclic
    np.testing.assert_array_equal(chain.transitions[0], np.full((2, 4), 0.25))


@given(SIZES, SEEDS, st.integers(0, 50))
def test_draws_are_in_range_and_repeatable(sizes, seed, count):
    gaits = draw_gaits(sizes, count, np.random.default_rng(seed))
    assert gaits.shape == (count, len(sizes))
    assert gaits.dtype == np.int64
    assert np.all((gaits >= 0) & (gaits < sizes))
    again = draw_gaits(sizes, count, np.random.default_rng(seed))
    np.testing.assert_array_equal(gaits, again)
    sampled = random_chain(sizes, seed).sample(np.random.default_rng(seed), count)
    assert sampled.shape == (count, len(sizes))
    assert np.all((sampled >= 0) & (sampled < sizes))


def test_sample_follows_the_probabilities():
    chain = LayeredChain((FIRST, SECOND))
    gaits = chain.sample(np.random.default_rng(1), 20_000)
    expected = chain.gait_probability(all_gaits((2, 2, 2)), np.array([0.5, 0.5]))
    codes = np.ravel_multi_index(tuple(gaits.T), (2, 2, 2))
    share = np.bincount(codes, minlength=8) / 20_000
    # Five standard deviations of a share of 20 000 draws.
    np.testing.assert_allclose(share, expected, atol=5 * 0.5 / np.sqrt(20_000))
    assert np.all(share[expected == 0.0] == 0.0)


class ExtremeDraws:
    """Draw the least and the greatest number that a generator can return."""

    def integers(self, _high, size):
        return np.zeros(size, dtype=np.int64)

    def random(self, size):
        return np.resize([0.0, 1.0 - 2.0**-53], size)


@pytest.mark.parametrize("count", [-1, 2.0, True, None])
def test_so_many_gaits_cannot_be_drawn(count):
    rng = np.random.default_rng(0)
    for draw in (
        lambda: LayeredChain((FIRST, SECOND)).sample(rng, count),
        lambda: draw_gaits((2, 2), count, rng),
    ):
        with pytest.raises(ChainError, match=f"count={count}: need a whole number"):
            draw()


@pytest.mark.parametrize(
    ("first", "message"),
    [
        ([0, 7], r"node 7 of layer 1: need 0\.\.1"),
        ([0, -1], r"node -1 of layer 1: need 0\.\.1"),
        ([0, 1, 1], r"first has shape \(3,\): need \(2,\)"),
        ([0.0, 1.0], "need integers"),
    ],
)
def test_first_poses_that_do_not_exist_are_refused(first, message):
    with pytest.raises(ChainError, match=message):
        LayeredChain((FIRST, SECOND)).sample(np.random.default_rng(0), 2, first)


def test_extreme_draws_never_take_an_impossible_edge():
    # The row sums to a little less than 1, as the tolerance allows.
    row = np.array([[0.0, 0.3, 0.7 - 5e-10, 0.0]])
    gaits = LayeredChain((row,), cyclic=False).sample(ExtremeDraws(), 2)
    np.testing.assert_array_equal(gaits[:, 1], [1, 2])


def test_arrays_are_copies_and_read_only():
    matrix = np.array(FIRST)
    chain = LayeredChain((matrix,))
    matrix[0, 0] = 7.0
    assert chain.transitions[0][0, 0] == 0.25
    with pytest.raises(ValueError, match="read-only"):
        chain.transitions[0][0, 0] = 0.0


@pytest.mark.parametrize(
    ("matrices", "message"),
    [
        ((), "one or more"),
        ((np.ones(3),), "2-D"),
        ((np.ones((0, 2)),), "non-empty"),
        ((FIRST, np.ones((3, 1))), "layer 2 has 2 nodes as a target but 3"),
        ((np.array([[0.5, 0.5], [0.5, 0.4]]),), "layer 1, row 1 sums to 0.9"),
        ((np.array([[1.5, -0.5], [0.5, 0.5]]),), "probability of -0.5"),
        ((np.array([[np.nan, 0.5], [0.5, 0.5]]),), "probability of nan"),
        ((np.full((2, 3), 1 / 3),), "2 and 3 nodes; pass cyclic=False"),
    ],
)
def test_a_matrix_that_is_no_chain_is_refused(matrices, message):
    with pytest.raises(ChainError, match=message):
        LayeredChain(matrices)


@pytest.mark.parametrize(
    ("kept", "message"),
    [
        ([[0, 1], [0]], "2 layers, the chain 3"),
        ([[0, 1], [], [0, 1]], "layer 2 cannot keep"),
        ([[0, 1], [0, 2], [0, 1]], r"layer 2 cannot keep \[0, 2\].*0\.\.1"),
        ([[0, 1], [1, 0], [0, 1]], "rising"),
        ([[0], [0, 1], [1]], "same nodes at both ends"),
        ([[0, 1], [1], [0, 1]], "node 1 of layer 1 would keep no edge"),
    ],
)
def test_keep_refuses(kept, message):
    with pytest.raises(ChainError, match=message):
        LayeredChain((FIRST, SECOND)).keep(kept)


@pytest.mark.parametrize(
    ("gaits", "message"),
    [
        ([[0, 0]], r"need integers of shape \(..., 3\)"),
        ([[0.0, 0.0, 0.0]], "float64"),
        ([[0, 2, 0]], r"node 2 of layer 2: need 0\.\.1"),
        ([[0, 0, -1]], "node -1 of layer 3"),
    ],
)
def test_gaits_that_do_not_fit_are_refused(gaits, message):
    with pytest.raises(ChainError, match=message):
        LayeredChain((FIRST, SECOND)).gait_probability(np.array(gaits))


def test_other_refusals():
    with pytest.raises(ChainError, match="two or more layers"):
        LayeredChain.uniform((3,))
    with pytest.raises(ChainError, match=">= 1 node"):
        draw_gaits((3, 0), 1, np.random.default_rng(0))
    with pytest.raises(ChainError, match="layer 1 has 2 nodes"):
        chain = LayeredChain((FIRST, SECOND))
        chain.gait_probability(np.array([[0, 0, 0]]), np.ones(3))
