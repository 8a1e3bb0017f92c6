"""Eq. 2, eps independent poses, zeta independent gaits, and the paper's figures."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gaitchain.chain.layered_chain import LayeredChain, draw_gaits
from gaitchain.chain.pruning import (
    all_gaits,
    gait_distance,
    independent_gaits,
    independent_group,
    inner_distance,
    pose_distances,
    prune,
)
from gaitchain.chain.training import train_batch, train_sequential
from gaitchain.errors import ChainError

PAPER = (5, 10, 10, 5)
SEEDS = st.integers(0, 2**32 - 1)
EPSILONS = st.floats(0.0, 4.0)


def random_transition(seed, rows=4, columns=7):
    rng = np.random.default_rng(seed)
    return rng.dirichlet(np.full(columns, 0.5), size=rows)


def assert_separated(distance, kept, least):
    """Pairwise >= least, and every dropped one < least from a kept one."""
    among = distance[np.ix_(kept, kept)]
    assert np.all(among[~np.eye(len(kept), dtype=bool)] >= least)
    dropped = np.setdiff1d(np.arange(len(distance)), kept)
    assert np.all(distance[np.ix_(dropped, kept)].min(axis=1, initial=np.inf) < least)


def test_inner_distance_by_hand():
    transition = np.array([[0.5, 0.25, 0.25], [0.2, 0.4, 0.4]])
    # Pose 0 against 1: (|ln 2| + |ln 1/2|) / 2; poses 1 and 2 are the same.
    half = math.log(2.0)
    expected = [[0, half, half], [half, 0, 0], [half, 0, 0]]
    np.testing.assert_allclose(inner_distance(transition), expected, atol=1e-15)
    np.testing.assert_allclose(inner_distance(transition, 2.0)[0, 1], 1.0)


@given(SEEDS)
def test_inner_distance_is_a_pseudometric(seed):
    distance = inner_distance(random_transition(seed))
    np.testing.assert_array_equal(np.diag(distance), 0.0)
    np.testing.assert_array_equal(distance, distance.T)
    assert np.all(distance >= 0.0)
    detour = (distance[:, :, None] + distance[None, :, :]).min(axis=1)
    assert np.all(distance <= detour + 1e-9)


@given(SEEDS, st.floats(1.1, 20.0))
def test_inner_distance_equals_the_sum_and_the_base_scales_it(seed, base):
    transition = np.maximum(random_transition(seed, 3, 4), 1e-9)
    united = transition * np.array([[0.2], [0.3], [0.5]])
    expected = np.zeros((4, 4))
    for k in range(4):
        for one in range(4):
            logs = [abs(math.log(row[k] / row[one], base)) for row in united]
            expected[k, one] = sum(logs) / 3
    np.testing.assert_allclose(inner_distance(transition, base), expected, atol=1e-9)
    scaled = inner_distance(transition) / math.log(base)
    np.testing.assert_allclose(inner_distance(transition, base), scaled)


def test_a_zero_probability_gives_a_finite_distance():
    distance = inner_distance(np.array([[1.0, 0.0, 0.0]]))
    assert np.all(np.isfinite(distance))
    assert distance[1, 2] == 0.0
    assert distance[0, 1] > 700.0


@given(SEEDS, EPSILONS)
def test_group_is_independent_and_maximal(seed, epsilon):
    distance = inner_distance(random_transition(seed))
    costs = np.random.default_rng(seed).random(7)
    kept = independent_group(distance, costs, epsilon)
    assert np.argmin(costs) in kept
    assert np.all(np.diff(kept) > 0)
    assert_separated(distance, kept, epsilon)


def test_group_by_hand():
    line = np.array([0.0, 1.0, 2.0, 3.0])
    distance = np.abs(line[:, None] - line)
    by_index = independent_group(distance, np.zeros(4), 2.0)
    np.testing.assert_array_equal(by_index, [0, 2])
    by_cost = independent_group(distance, np.array([0.4, 0.1, 0.3, 0.2]), 2.0)
    np.testing.assert_array_equal(by_cost, [1, 3])
    np.testing.assert_array_equal(independent_group(distance, line, 0.0), range(4))
    np.testing.assert_array_equal(independent_group(distance, line, np.inf), [0])


@given(SEEDS, EPSILONS, st.booleans())
def test_prune_keeps_independent_groups(seed, epsilon, cyclic):
    sizes = (3, 6, 5, 3)
    rng = np.random.default_rng(seed)
    chain = train_batch(sizes, draw_gaits(sizes, 40, rng), rng.random(40), 1.0, cyclic)
    pruned = prune(chain, [rng.random(size) for size in sizes], epsilon)
    assert pruned.chain.is_stochastic()
    assert pruned.chain.cyclic == cyclic
    assert pruned.chain.layer_sizes == tuple(len(group) for group in pruned.kept)
    distances = pose_distances(chain)
    for layer in range(0 if cyclic else 1, 4):
        assert_separated(distances[layer], pruned.kept[layer], epsilon)
    if cyclic:
        np.testing.assert_array_equal(pruned.kept[0], pruned.kept[-1])
    else:
        assert len(pruned.kept[0]) == 3
    assert prune(chain, [np.zeros(n) for n in sizes], 0.0).chain.layer_sizes == sizes


@given(SEEDS, EPSILONS)
def test_poses_of_other_classes_are_no_nearer_than_the_farthest(seed, epsilon):
    rng = np.random.default_rng(seed)
    distance = inner_distance(random_transition(seed))
    chain = LayeredChain((random_transition(seed),), cyclic=False)
    labels, costs = rng.integers(3, size=7), rng.random(7)
    parted = np.where(labels[:, None] != labels, 1e300, distance)
    expected = independent_group(parted, costs, epsilon)
    classes = [np.zeros(4), labels]
    kept = prune(chain, [np.zeros(4), costs], epsilon, classes=classes).kept[1]
    np.testing.assert_array_equal(kept, expected)


@pytest.mark.parametrize("epsilon", [1e300, math.inf])
def test_the_best_pose_of_each_class_is_kept_whatever_epsilon(epsilon):
    """Where it is infinite, poses of all classes were merged into one."""
    chain = LayeredChain.uniform((2, 6, 2))
    costs = [np.zeros(2), np.array([0.3, 0.2, 0.5, 0.4, 0.9, 0.8]), np.zeros(2)]
    classes = [np.zeros(2), np.array([4, 4, 1, 1, 7, 1]), np.zeros(2)]
    pruned = prune(chain, costs, epsilon, layers=[1], classes=classes)
    assert [group.tolist() for group in pruned.kept] == [[0, 1], [1, 3, 4], [0, 1]]


def test_ends_of_a_cyclic_chain_are_ordered_by_the_last_layers_costs():
    matrix = np.array([[0.5, 0.5], [0.5, 0.5]])
    chain = LayeredChain((matrix, matrix))
    costs = [np.array([0.0, 1.0]), np.zeros(2), np.array([1.0, 0.0])]
    for ends in ([0], [2], [0, 2]):
        pruned = prune(chain, costs, 1.0, layers=ends)
        assert [group.tolist() for group in pruned.kept] == [[1], [0, 1], [1]]
    middle = prune(chain, costs, 1.0, layers=[1])
    assert middle.chain.layer_sizes == (2, 1, 2)
    with pytest.raises(ValueError, match="read-only"):
        middle.kept[0][0] = 1


@given(SEEDS, st.floats(0.0, 2.0))
def test_gait_group_is_independent_and_maximal(seed, zeta):
    sizes = (2, 3, 2, 2)
    rng = np.random.default_rng(seed)
    chain = train_batch(sizes, draw_gaits(sizes, 30, rng), rng.random(30))
    gaits, distances = all_gaits(sizes), pose_distances(chain)
    costs = rng.random(len(gaits))
    kept = independent_gaits(gaits, distances, costs, zeta)
    assert np.argmin(costs) in kept
    assert_separated(gait_distance(gaits, distances), kept, zeta)


def test_gait_distance_by_hand():
    distances = [np.zeros((2, 2)), np.array([[0.0, 3.0], [3.0, 0.0]])]
    gaits = np.array([[0, 0], [1, 0], [0, 1]])
    expected = [[0, 0, 1.5], [0, 0, 1.5], [1.5, 1.5, 0]]
    np.testing.assert_allclose(gait_distance(gaits, distances), expected)
    kept = independent_gaits(gaits, distances, np.array([0.2, 0.1, 0.3]), 1.0)
    np.testing.assert_array_equal(kept, [1, 2])


def test_pose_distances_of_an_open_chain_start_with_zeros():
    chain = LayeredChain((random_transition(0, 3, 4),), cyclic=False)
    first, last = pose_distances(chain)
    np.testing.assert_array_equal(first, np.zeros((3, 3)))
    np.testing.assert_array_equal(last, inner_distance(chain.transitions[0]))


def test_all_gaits():
    expected = [[0, 0], [0, 1], [0, 2], [1, 0], [1, 1], [1, 2]]
    np.testing.assert_array_equal(all_gaits((2, 3)), expected)
    assert len(all_gaits(PAPER)) == 2500
    with pytest.raises(ChainError, match="2500 gaits, over the limit of 2499"):
        all_gaits(PAPER, limit=2499)


def poses_left(cost, samples, epsilon, *, base=math.e, normalise="rows", seeds=200):
    """Mean number of poses kept in layers 2 and 3 of the paper's chain."""
    left = []
    for seed in range(seeds):
        gaits = draw_gaits(PAPER, samples, np.random.default_rng(seed))
        costs = np.full(samples, cost)
        chain = LayeredChain.uniform(PAPER)
        chain = train_sequential(chain, gaits, costs, normalise)
        pruned = prune(chain, [np.zeros(n) for n in PAPER], epsilon, base)
        left.append([len(group) for group in pruned.kept[1:3]])
    return np.mean(left, axis=0)


@pytest.mark.parametrize(
    ("cost", "expected"),
    [(0.0, (7.8, 6.0)), (0.2, (7.0, 4.0)), (0.5, (4.0, 1.8))],
)
def test_poses_left_at_the_end_of_figure_6(cost, expected):
    np.testing.assert_allclose(poses_left(cost, 100, 3.0), expected, atol=0.7)
    # Base 10 keeps 1 to 2 poses of 10, where the paper keeps 3.
    assert np.all(poses_left(cost, 100, 3.0, base=10.0, seeds=50) < 2.5)


@pytest.mark.parametrize(
    ("cost", "few", "many"),
    [
        (0.0, (9.0, 9.6), (9.3, 10.0)),
        (0.2, (8.4, 8.8), (8.2, 9.8)),
        (0.5, (6.1, 5.0), (6.2, 8.0)),
    ],
)
def test_poses_left_in_figure_7(cost, few, many):
    np.testing.assert_allclose(poses_left(cost, 160, 2.5, seeds=100), few, atol=0.7)
    np.testing.assert_allclose(poses_left(cost, 400, 2.5, seeds=100), many, atol=0.7)


def test_columns_as_printed_never_let_layer_2_recover():
    rows = poses_left(0.0, 400, 2.5, seeds=50)
    columns = poses_left(0.0, 400, 2.5, normalise="columns", seeds=50)
    assert columns[0] < 6.0
    assert rows[0] > 8.0


def test_refusals():
    distance, costs = np.zeros((2, 2)), np.zeros(2)
    with pytest.raises(ChainError, match=r"epsilon=-1\.0: need a distance >= 0"):
        independent_group(distance, costs, -1.0)
    with pytest.raises(ChainError, match="zeta=nan"):
        independent_gaits(np.zeros((2, 1), int), [distance], costs, math.nan)
    with pytest.raises(ChainError, match=r"need finite numbers of \(3, 3\)"):
        independent_group(distance, np.zeros(3), 1.0)
    with pytest.raises(ChainError, match="no NaN"):
        independent_group(distance, np.array([0.0, np.nan]), 1.0)
    with pytest.raises(ChainError, match="one cost per gait"):
        independent_gaits(np.zeros((3, 1), int), [distance], costs, 1.0)
    for bad in (np.array([[np.nan, 1.0]]), np.array([[-0.5, 1.5]]), np.ones(3)):
        with pytest.raises(ChainError, match=r"transition of shape .*finite and >= 0"):
            inner_distance(bad)
    with pytest.raises(ChainError, match="base=1"):
        inner_distance(np.full((1, 2), 0.5), base=1.0)
    chain = LayeredChain.uniform((2, 2), cyclic=False)
    with pytest.raises(ChainError, match=r"layer 0 cannot be pruned: need 1\.\.1"):
        prune(chain, [costs, costs], 1.0, layers=[0])
    with pytest.raises(ChainError, match="1 layers, the chain 2"):
        prune(chain, [costs], 1.0)
    with pytest.raises(ChainError, match=r"classes \(3,\): need one of each for 2"):
        prune(chain, [costs, costs], 1.0, classes=[np.zeros(2), np.zeros(3)])
    with pytest.raises(ChainError, match=r"costs \(1,\), classes \(2,\): need one"):
        prune(chain, [costs, np.zeros(1)], 1.0)
