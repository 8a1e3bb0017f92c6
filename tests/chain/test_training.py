"""Eq. 5 and 6 against the loop that they describe; batch counts; expected costs."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gaitchain.chain import expectation
from gaitchain.chain.expectation import (
    EdgeStatistics,
    expected_costs,
    path_costs,
    pose_costs,
)
from gaitchain.chain.layered_chain import LayeredChain, draw_gaits
from gaitchain.chain.policy import regret
from gaitchain.chain.pruning import all_gaits, inner_distance, prune
from gaitchain.chain.training import train_batch, train_by_cost, train_sequential
from gaitchain.errors import ChainError

NEAR = 0.01
CASES = st.tuples(
    st.lists(st.integers(1, 4), min_size=2, max_size=4),
    st.integers(0, 2**32 - 1),
    st.integers(0, 60),
)


def samples(case):
    sizes, seed, count = case
    rng = np.random.default_rng(seed)
    # Costs of exactly 0 and 1 are as likely as the ones between.
    costs = np.clip(rng.uniform(-1.0, 2.0, count), 0.0, 1.0)
    return sizes, draw_gaits(sizes, count, rng), costs


def naive(chain, gaits, costs, axis):
    """Eq. 5 then Eq. 6, one sample after another, over the whole matrix."""
    matrices = [np.array(matrix) for matrix in chain.transitions]
    for gait, cost in zip(gaits, costs, strict=True):
        for layer in range(len(matrices)):
            matrices[layer][gait[layer], gait[layer + 1]] += 1.0 - cost
            matrices[layer] /= matrices[layer].sum(axis=axis, keepdims=True)
    return [matrix / matrix.sum(axis=1, keepdims=True) for matrix in matrices]


@given(CASES, st.sampled_from([("rows", 1), ("columns", 0)]))
def test_sequential_equals_the_loop(case, normalise):
    sizes, gaits, costs = samples(case)
    name, axis = normalise
    chain = LayeredChain.uniform(sizes, cyclic=False)
    trained = train_sequential(chain, gaits, costs, name)
    assert trained.is_stochastic()
    expected = naive(chain, gaits, costs, axis)
    for matrix, oracle in zip(trained.transitions, expected, strict=True):
        np.testing.assert_allclose(matrix, oracle, rtol=1e-12, atol=1e-12)


@given(CASES)
def test_training_goes_on_where_it_stopped(case):
    sizes, gaits, costs = samples(case)
    chain = LayeredChain.uniform(sizes, cyclic=False)
    half = len(costs) // 2
    whole = train_sequential(chain, gaits, costs)
    first = train_sequential(chain, gaits[:half], costs[:half])
    both = train_sequential(first, gaits[half:], costs[half:])
    for one, other in zip(whole.transitions, both.transitions, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-12)


def test_sequential_by_hand():
    chain = LayeredChain.uniform((1, 2), cyclic=False)
    gaits, costs = np.array([[0, 0], [0, 1]]), np.array([0.0, 0.5])
    # (1/2, 1/2) -> (3/2, 1/2) / 2 -> (3/4, 3/4) / (3/2).
    trained = train_sequential(chain, gaits, costs)
    np.testing.assert_allclose(trained.transitions[0], [[0.5, 0.5]])
    # The other way round: (1/2, 1) / (3/2) -> (4/3, 2/3) / 2: the order matters.
    trained = train_sequential(chain, gaits[::-1], costs[::-1])
    np.testing.assert_allclose(trained.transitions[0], [[2 / 3, 1 / 3]])


def test_columns_by_hand():
    chain = LayeredChain.uniform((2, 2))
    gaits, costs = np.array([[0, 0]]), np.array([0.0])
    # Columns (3/2, 1/2) and (1/2, 1/2) become (3/4, 1/4) and (1/2, 1/2).
    trained = train_sequential(chain, gaits, costs, "columns")
    np.testing.assert_allclose(trained.transitions[0], [[0.6, 0.4], [1 / 3, 2 / 3]])


def test_many_updates_never_reach_zero():
    gaits = np.zeros((5000, 2), dtype=np.int64)
    chain = LayeredChain.uniform((1, 3), cyclic=False)
    trained = train_sequential(chain, gaits, np.zeros(5000))
    assert np.all(trained.transitions[0] > 0.0)
    assert trained.is_stochastic()


def test_an_impossible_edge_stays_impossible():
    chain = LayeredChain((np.array([[1.0, 0.0], [0.0, 1.0]]),))
    gaits = np.array([[0, 0], [1, 1]])
    for name in ("rows", "columns"):
        trained = train_sequential(chain, gaits, np.array([0.0, 0.3]), name)
        np.testing.assert_allclose(trained.transitions[0], np.eye(2))
    chain = LayeredChain((np.array([[1.0, 0.0], [1.0, 0.0]]),))
    trained = train_sequential(chain, gaits[:1], np.zeros(1), "columns")
    np.testing.assert_allclose(trained.transitions[0], [[1, 0], [1, 0]])


@given(CASES, st.floats(0.01, 10.0))
def test_batch_does_not_depend_on_the_order(case, prior):
    sizes, gaits, costs = samples(case)
    shuffled = np.random.default_rng(0).permutation(len(costs))
    one = train_batch(sizes, gaits, costs, prior, cyclic=False)
    other = train_batch(sizes, gaits[shuffled], costs[shuffled], prior, cyclic=False)
    assert one.is_stochastic()
    for left, right in zip(one.transitions, other.transitions, strict=True):
        assert np.all(left > 0.0)
        np.testing.assert_allclose(left, right, atol=1e-12)


def test_batch_by_hand():
    gaits = np.array([[0, 0], [0, 0], [0, 1]])
    costs = np.array([0.0, 0.5, 1.0])
    trained = train_batch((2, 2), gaits, costs, prior=2.0)
    # Row 0: (1 + 1 + 0.5, 1 + 0) / 3.5; row 1 is the prior.
    np.testing.assert_allclose(trained.transitions[0], [[5 / 7, 2 / 7], [0.5, 0.5]])
    assert trained.cyclic


def test_expected_costs_by_hand():
    gaits = np.array([[0, 0], [0, 0], [0, 1], [1, 0]])
    costs = np.array([0.1, 0.3, 0.6, 0.8])
    plain = expected_costs((2, 2), gaits, costs, shrink=0.0)
    # Rows 1/3, 0.8; columns 0.4, 0.6; mean 0.45: the unseen edge is 0.8 + 0.6 - 0.45.
    np.testing.assert_allclose(plain.cost[0], [[0.2, 0.6], [0.8, 0.95]])
    np.testing.assert_array_equal(plain.count[0], [[2, 1], [1, 0]])
    shrunk = expected_costs((2, 2), gaits, costs, shrink=1.0)
    row, column = (1.0 + 0.45) / 4, (1.2 + 0.45) / 4
    guess = row + column - 0.45
    assert shrunk.cost[0][0, 0] == pytest.approx((0.4 + guess) / 3)


@given(CASES.filter(lambda case: case[2] > 0), st.floats(0.0, 5.0))
def test_expected_costs_are_costs(case, shrink):
    sizes, gaits, costs = samples(case)
    statistics = expected_costs(sizes, gaits, costs, shrink)
    for cost, count in zip(statistics.cost, statistics.count, strict=True):
        assert np.all((cost >= -1e-12) & (cost <= 1 + 1e-12))
        assert count.sum() == len(costs)
    for poses, size in zip(pose_costs(statistics), sizes, strict=True):
        assert poses.shape == (size,)


def test_expected_costs_recover_an_additive_cost():
    sizes = (4, 4, 4)
    rng = np.random.default_rng(3)
    gaits = draw_gaits(sizes, 20_000, rng)
    parts = rng.uniform(0.0, 1 / 3, (3, 4))
    costs = parts[np.arange(3), gaits].sum(axis=1)
    statistics = expected_costs(sizes, gaits, costs)
    expected = parts[0][:, None] + parts[1] + parts[2].mean()
    # A mean of some 1250 costs of standard deviation below 0.2: five of its errors.
    np.testing.assert_allclose(statistics.cost[0], expected, atol=5 * 0.2 / 1250**0.5)


def test_pose_costs_by_hand():
    statistics = EdgeStatistics(
        (np.array([[0.2, 0.6, 0.1], [0.8, 0.4, 0.3]]),),
        (np.array([[3, 1, 0], [1, 1, 0]]),),
    )
    first, second = pose_costs(statistics)
    np.testing.assert_allclose(first, [0.3, 0.6])
    np.testing.assert_allclose(second, [0.35, 0.5, 0.2])


def along(parts, gaits):
    """Sum of the parts along each gait."""
    return sum(part[gaits[:, i], gaits[:, i + 1]] for i, part in enumerate(parts))


def random_parts(sizes, seed):
    """Parts whose sum along any gait is a cost in [0, 1]."""
    rng = np.random.default_rng(seed)
    return [rng.random(shape) / (len(sizes) - 1) for shape in pairwise(sizes)]


def indicators(sizes, gaits):
    """Columns of the model: 1, each pose, each edge."""
    poses = [gaits[:, i, None] == np.arange(n) for i, n in enumerate(sizes)]
    edges = [
        (a[:, :, None] & b[:, None, :]).reshape(len(gaits), -1)
        for a, b in pairwise(poses)
    ]
    return np.hstack([*poses, *edges]).astype(float)


LAYERS = st.lists(st.integers(1, 4), min_size=2, max_size=4)


@given(LAYERS, st.integers(0, 2**32 - 1))
def test_path_costs_recover_a_sum_over_edges(sizes, seed):
    gaits = all_gaits(sizes)
    costs = along(random_parts(sizes, seed), gaits)
    found = path_costs(sizes, gaits, costs, shrink=0.0)
    assert [part.shape for part in found] == list(pairwise(sizes))
    np.testing.assert_allclose(along(found, gaits), costs, atol=1e-12)
    # What adds up is what looking ahead minimises: nothing is regretted.
    edges = expected_costs(sizes, gaits, costs).cost
    assert regret(edges, found, gaits, costs).look_ahead == pytest.approx(0, abs=1e-9)


def test_expected_costs_of_edges_do_not_add_up():
    """The reason for path costs: an inner pose would weigh twice."""
    sizes = (4, 4, 4, 4)
    gaits = all_gaits(sizes)
    lost = []
    for seed in range(20):
        costs = along(random_parts(sizes, seed), gaits)
        edges = expected_costs(sizes, gaits, costs, shrink=0.0).cost
        lost.append(regret(edges, edges, gaits, costs).look_ahead)
    assert max(lost) > 0.01


@given(LAYERS, st.integers(0, 2**32 - 1))
def test_path_costs_are_the_least_squares_fit_of_all_gaits(sizes, seed):
    """Of any cost, a sum over edges or not."""
    gaits = all_gaits(sizes)
    costs = np.random.default_rng(seed).random(len(gaits))
    table = np.column_stack([np.ones(len(gaits)), indicators(sizes, gaits)])
    best = table @ np.linalg.lstsq(table, costs)[0]
    found = along(path_costs(sizes, gaits, costs, shrink=0.0), gaits)
    np.testing.assert_allclose(found, best, atol=1e-12)


def ridge(sizes, gaits, costs, shrink):
    """Least squares of rows of data, and of one row per effect that pulls it to 0."""
    table = indicators(sizes, gaits)
    mean = costs.mean()
    pulled = np.vstack([table, np.sqrt(shrink) * np.eye(table.shape[1])])
    wanted = np.concatenate([costs - mean, np.zeros(table.shape[1])])
    effects = np.linalg.lstsq(pulled, wanted)[0]
    return lambda which: mean + indicators(sizes, which) @ effects


@settings(max_examples=40)
@given(CASES.filter(lambda case: case[2] > 0), st.floats(1.0, 5.0))
def test_path_costs_tend_to_the_ridge_fit_of_a_sample(case, shrink):
    sizes, gaits, costs = samples(case)
    every = all_gaits(sizes)  # also those that were never drawn
    expected = ridge(sizes, gaits, costs, shrink)(every)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(expectation, "_SWEEPS", 800)
        parts = path_costs(sizes, gaits, costs, shrink)
    np.testing.assert_allclose(along(parts, every), expected, atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(5))
def test_path_costs_of_a_librarys_size_are_near_the_ridge_fit(seed):
    """As many sweeps as are made bring the fit to a hundredth of the costs' range."""
    sizes, gaits, costs = samples(((5, 10, 15, 5), seed, 800))
    expected = ridge(sizes, gaits, costs, 1.0)(gaits)
    found = along(path_costs(sizes, gaits, costs), gaits)
    np.testing.assert_allclose(found, expected, atol=NEAR)


@pytest.mark.parametrize("shrink", [0.0, 0.1, 1.0])
@pytest.mark.parametrize(("alike", "near"), [(0.0, 0.005), (0.5, 0.02), (0.9, 0.02)])
def test_path_costs_are_as_near_the_ridge_fit_as_is_said(alike, near, shrink):
    """Also where a gait's later poses mostly have the number of its first one."""
    sizes, count, off = (6, 6, 6, 6), 200, 0.0
    for seed in range(5):
        rng = np.random.default_rng(seed)
        first = rng.integers(6, size=(count, 1))
        alone = rng.random((count, 4)) >= alike
        gaits = np.where(alone, rng.integers(6, size=(count, 4)), first)
        slope = 0.05 * (gaits[:, 0] - gaits[:, 3])
        costs = np.clip(0.5 + slope + 0.1 * rng.standard_normal(count), 0.0, 1.0)
        found = along(path_costs(sizes, gaits, costs, shrink), gaits)
        expected = ridge(sizes, gaits, costs, shrink)(gaits)
        off = max(off, np.abs(found - expected).max())
    assert off < near


def test_path_costs_do_not_depend_on_the_order():
    sizes, gaits, costs = samples(((3, 4, 4, 3), 5, 60))
    shuffled = np.random.default_rng(0).permutation(len(costs))
    one = path_costs(sizes, gaits, costs)
    other = path_costs(sizes, gaits[shuffled], costs[shuffled])
    for left, right in zip(one, other, strict=True):
        np.testing.assert_allclose(left, right, atol=1e-12)


def test_path_costs_by_hand():
    """One gait leaves no effect beside the mean; two share theirs out."""
    (only,) = path_costs((2, 2), np.array([[0, 1]]), np.array([0.4]))
    np.testing.assert_allclose(only, np.full((2, 2), 0.4))
    gaits, costs = np.array([[0, 0], [1, 0]]), np.array([0.2, 0.6])
    # Effect -e of pose 0 and of its edge: each is (-0.2 - e) / 2, so e = -0.2 / 3.
    (found,) = path_costs((2, 1), gaits, costs, shrink=1.0)
    np.testing.assert_allclose(found, [[0.4 - 0.4 / 3], [0.4 + 0.4 / 3]], atol=1e-6)
    # Shrunk without end, only the mean is left.
    (flat,) = path_costs((2, 1), gaits, costs, shrink=1e12)
    np.testing.assert_allclose(flat, 0.4)


def test_statistics_are_read_only():
    statistics = expected_costs((1, 1), np.array([[0, 0]]), np.array([0.5]))
    for array in (statistics.cost[0], statistics.count[0]):
        with pytest.raises(ValueError, match="read-only"):
            array[0, 0] = 1
    with pytest.raises(ChainError, match="differ in shape"):
        EdgeStatistics((np.zeros((2, 2)),), (np.zeros((2, 3), dtype=np.int64),))


@pytest.mark.parametrize(
    ("costs", "message"),
    [
        ([0.5, 1.5], "cost 1.5 of sequence 1"),
        ([-0.1, 2.0], "cost -0.1 of sequence 0"),
        ([0.5, np.nan], "cost nan of sequence 1"),
        ([0.5], r"need \(G, L\) and \(G,\)"),
    ],
)
def test_bad_costs_are_refused(costs, message):
    gaits = np.array([[0, 0], [1, 1]])
    chain = LayeredChain.uniform((2, 2))
    for train in (
        lambda: train_sequential(chain, gaits, np.array(costs)),
        lambda: train_batch((2, 2), gaits, np.array(costs)),
        lambda: expected_costs((2, 2), gaits, np.array(costs)),
        lambda: path_costs((2, 2), gaits, np.array(costs)),
    ):
        with pytest.raises(ChainError, match=message):
            train()


def test_bad_options_are_refused():
    gaits, costs = np.array([[0, 0]]), np.array([0.5])
    with pytest.raises(ChainError, match="normalise='both'"):
        train_sequential(LayeredChain.uniform((2, 2)), gaits, costs, "both")
    with pytest.raises(ChainError, match="prior=0"):
        train_batch((2, 2), gaits, costs, prior=0.0)
    for learn in (expected_costs, path_costs):
        with pytest.raises(ChainError, match="shrink=-1"):
            learn((2, 2), gaits, costs, shrink=-1.0)
        for shrink in (np.nan, np.inf):
            with pytest.raises(ChainError, match=f"shrink={shrink}"):
                learn((2, 2), gaits, costs, shrink=shrink)
        with pytest.raises(ChainError, match="0 sequences"):
            learn((2, 2), gaits[:0], costs[:0])
        with pytest.raises(ChainError):
            learn((2, 2), gaits + 2, costs)


def test_by_cost_prefers_the_cheap_and_sees_distances_of_costs():
    """A row's log-ratios are its cost differences over the spread: Eq. 2 by hand."""
    costs = [np.array([[0.1, 0.3, 0.3], [0.2, 0.4, 0.4]])]
    chain = train_by_cost(costs, cyclic=False)
    off = costs[0] - costs[0].mean(axis=1, keepdims=True)
    spread = np.sqrt(np.mean(off**2))
    logs = np.log(chain.transitions[0])
    np.testing.assert_allclose(logs[:, 0] - logs[:, 1], 0.2 / spread, rtol=1e-12)
    distance = inner_distance(chain.transitions[0])
    assert distance[0, 1] == pytest.approx(0.2 / spread)
    assert distance[1, 2] == pytest.approx(0.0, abs=1e-12)


def test_by_equal_costs_all_poses_are_redundant():
    sizes = (3, 5, 4, 3)
    equal = [np.full(shape, 0.25) for shape in pairwise(sizes)]
    pruned = prune(train_by_cost(equal), [np.zeros(n) for n in sizes], 0.5, layers=[1])
    assert len(pruned.kept[1]) == 1


def test_by_cost_refuses_forbidden_edges():
    with pytest.raises(ChainError, match="layer 1 is not finite"):
        train_by_cost([np.array([[0.1, np.inf]])], cyclic=False)
