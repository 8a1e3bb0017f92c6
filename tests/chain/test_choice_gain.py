"""What looking ahead gains and pruning costs, on chains made by hand."""

import math
from itertools import pairwise, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gaitchain.chain.choice_gain import ChoiceGain, choice_gain

INF = math.inf


def one_pose(*layers):
    return [np.array(layer, dtype=float) for layer in layers]


def test_greedy_takes_the_bait():
    """The cheap first edge leads to a dear last one: 1 + 1 + 9 against 2 + 1 + 1."""
    costs = one_pose([[1, 2]], [[1, 5], [5, 1]], [[9], [1]])
    pairs = np.ones((1, 1), dtype=bool)
    gain = choice_gain(costs, costs, list(costs), pairs)
    assert gain == ChoiceGain(all_poses=4.0, kept_poses=4.0, kept_greedy=11.0)


def test_pruning_costs_what_the_best_pose_saved():
    """Without the second pose of layer 2, the best way is 1 + 5 + 1, not 2 + 1 + 1."""
    costs = one_pose([[1, 2]], [[1, 5], [5, 1]], [[9], [1]])
    kept = [costs[0][:, :1], costs[1][:1], costs[2]]
    gain = choice_gain(costs, kept, list(kept), np.ones((1, 1), dtype=bool))
    assert (gain.all_poses, gain.kept_poses, gain.kept_greedy) == (4.0, 7.0, 11.0)


def test_the_greedy_rule_goes_by_edge_costs_and_pays_path_costs():
    paths = one_pose([[1, 2]], [[1], [1]], [[1]])
    edges = one_pose([[5, 0]], [[1], [1]], [[1]])
    gain = choice_gain(paths, paths, edges, np.ones((1, 1), dtype=bool))
    assert (gain.kept_poses, gain.kept_greedy) == (3.0, 4.0)


def test_greedy_runs_into_no_dead_end():
    """The cheapest edges lead nowhere; the rule sees that they are closed."""
    costs = one_pose([[0, 1, 2]], [[0, INF], [INF, 1], [1, 1]], [[INF, 3], [3, INF]])
    pairs = np.array([[True, False]])
    gain = choice_gain(costs, costs, list(costs), pairs)
    # Pose 0 of layer 2 leads to pose 0 of layer 3 alone, which does not lead to 0.
    assert gain.kept_greedy == 1.0 + 1.0 + 3.0
    assert gain.kept_poses == 5.0


def test_only_walked_pairs_count():
    costs = one_pose([[1], [3]], [[0]], [[0, 10]])
    every, none = np.ones((2, 2), dtype=bool), np.zeros((2, 2), dtype=bool)
    assert choice_gain(costs, costs, costs, every).all_poses == 7.0
    one = none.copy()
    one[1, 0] = True
    assert choice_gain(costs, costs, costs, one).all_poses == 3.0
    assert math.isnan(choice_gain(costs, costs, costs, none).all_poses)


@settings(max_examples=40)
@given(st.integers(0, 2**32 - 1))
def test_against_every_way_there_is(seed):
    """The best by brute force, and greedy never better than looking ahead."""
    rng = np.random.default_rng(seed)
    sizes = (3, 4, 4, 3)
    paths = [np.where(rng.random(s) < 0.8, rng.random(s), INF) for s in pairwise(sizes)]
    edges = [np.where(np.isfinite(c), rng.random(c.shape), INF) for c in paths]
    best = np.full((3, 3), INF)
    for a, b, c, d in product(*map(range, sizes)):
        cost = paths[0][a, b] + paths[1][b, c] + paths[2][c, d]
        best[a, d] = min(best[a, d], cost)
    pairs = np.isfinite(best)
    gain = choice_gain(paths, paths, edges, pairs)
    assert gain.all_poses == gain.kept_poses == pytest.approx(best[pairs].mean())
    assert gain.kept_greedy - gain.kept_poses >= -1e-12
    assert math.isfinite(gain.kept_greedy)
