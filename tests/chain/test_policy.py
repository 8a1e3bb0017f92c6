"""Which next pose: greedy, looking ahead, and both against enumeration."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from gaitchain.chain.policy import cost_to_go, exhaustive, greedy, look_ahead, regret
from gaitchain.chain.pruning import all_gaits
from gaitchain.errors import ChainError

SIZES = st.lists(st.integers(1, 4), min_size=2, max_size=4)
SEEDS = st.integers(0, 2**32 - 1)

# Greedy takes the cheap first edge and pays 9 for it; looking ahead does not.
TRAP = (np.array([[1.0, 2.0]]), np.array([[9.0], [1.0]]))


def random_costs(sizes, seed, forbidden=0.0):
    rng = np.random.default_rng(seed)
    shapes = pairwise(sizes)
    costs = [rng.random(shape) for shape in shapes]
    return [np.where(rng.random(c.shape) < forbidden, np.inf, c) for c in costs]


def path_cost(costs, gaits):
    edges = [c[gaits[..., i], gaits[..., i + 1]] for i, c in enumerate(costs)]
    return np.sum(edges, axis=0)


def test_policies_by_hand():
    np.testing.assert_array_equal(greedy(TRAP, 0), [0, 0, 0])
    np.testing.assert_array_equal(look_ahead(TRAP, 0), [0, 1, 0])
    values = cost_to_go(TRAP)
    assert [value.tolist() for value in values] == [[3.0], [9.0, 1.0], [0.0]]
    gaits = all_gaits((1, 2, 1))
    np.testing.assert_array_equal(
        exhaustive(gaits, path_cost(TRAP, gaits), 0), [0, 1, 0]
    )


def test_regret_by_hand():
    gaits = all_gaits((1, 2, 1))
    found = regret(TRAP, TRAP, gaits, np.array([0.9, 0.4]))
    assert found.greedy == pytest.approx(1.0)
    assert found.greedy_absolute == pytest.approx(0.5)
    assert found.look_ahead == found.look_ahead_absolute == 0.0
    same = regret(TRAP, TRAP, gaits, np.array([0.4, 0.4]))
    assert same.greedy == same.look_ahead == 0.0


def test_greedy_takes_the_edge_costs_and_looking_ahead_the_path_costs():
    gaits, true = all_gaits((1, 2, 1)), np.array([0.9, 0.4])
    # By either policy TRAP's mirror image leads where TRAP does not.
    mirror = (TRAP[0][:, ::-1], TRAP[1][::-1])
    found = regret(mirror, TRAP, gaits, true)
    assert (found.greedy_absolute, found.look_ahead_absolute) == (0.0, 0.0)
    found = regret(TRAP, mirror, gaits, true)
    assert found.greedy_absolute == pytest.approx(0.5)
    assert found.look_ahead_absolute == pytest.approx(0.5)


@given(SIZES, SEEDS)
def test_regret_against_brute_force(sizes, seed):
    """Edge costs, path costs and true costs have nothing to do with each other."""
    near, ahead, other = (random_costs(sizes, [seed, n]) for n in range(3))
    gaits = all_gaits(sizes)
    true = path_cost(other, gaits)
    found = regret(near, ahead, gaits, true)
    lost = np.zeros(2)
    for start in range(sizes[0]):
        best = path_cost(other, exhaustive(gaits, true, start))
        step = [start]
        for costs in near:
            step.append(int(np.argmin(costs[step[-1]])))
        own = gaits[gaits[:, 0] == start]
        cheapest = own[np.argmin(path_cost(ahead, own))]
        lost += [path_cost(other, np.array(step)) - best, 0.0]
        lost += [0.0, path_cost(other, cheapest) - best]
    lost /= sizes[0]
    absolute = found.greedy_absolute, found.look_ahead_absolute
    np.testing.assert_allclose(absolute, lost, atol=1e-12)
    scale = np.ptp(true) or 1.0
    np.testing.assert_allclose((found.greedy, found.look_ahead), lost / scale)


@given(SIZES, SEEDS)
def test_look_ahead_equals_brute_force(sizes, seed):
    costs = random_costs(sizes, seed)
    gaits = all_gaits(sizes)
    totals = path_cost(costs, gaits)
    starts = np.arange(sizes[0])
    chosen = path_cost(costs, look_ahead(costs, starts))
    best = [totals[gaits[:, 0] == start].min() for start in starts]
    np.testing.assert_allclose(chosen, best)
    np.testing.assert_allclose(cost_to_go(costs)[0], best)
    for start in starts:
        optimum = path_cost(costs, exhaustive(gaits, totals, start))
        assert optimum == pytest.approx(best[start])
    assert np.all(chosen <= path_cost(costs, greedy(costs, starts)) + 1e-12)


@given(SIZES, SEEDS, st.data())
def test_forbidden_edges_and_ends_are_avoided(sizes, seed, data):
    costs = random_costs(sizes, seed, forbidden=0.3)
    ends = data.draw(st.sets(st.integers(0, sizes[-1] - 1), min_size=1))
    gaits = all_gaits(sizes)
    gaits = gaits[(gaits[:, 0] == 0) & np.isin(gaits[:, -1], list(ends))]
    best = path_cost(costs, gaits).min()
    if np.isinf(best):
        with pytest.raises(ChainError, match="no allowed path"):
            look_ahead(costs, 0, sorted(ends))
        return
    chosen = look_ahead(costs, 0, sorted(ends))
    assert chosen[-1] in ends
    assert path_cost(costs, chosen) == pytest.approx(best)


@given(SIZES, SEEDS)
def test_regret_of_the_true_cost(sizes, seed):
    costs = random_costs(sizes, seed)
    gaits = all_gaits(sizes)
    totals = path_cost(costs, gaits)
    assume(np.ptp(totals) > 1e-6)
    found = regret(costs, costs, gaits, totals)
    # The true cost is the sum that looking ahead minimises, so nothing is regretted.
    assert found.look_ahead == pytest.approx(0.0, abs=1e-9)
    assert -1e-9 <= found.greedy <= 1.0 + 1e-9
    shuffled = np.random.default_rng(seed).permutation(len(gaits))
    again = regret(costs, costs, gaits[shuffled], totals[shuffled])
    assert again.greedy == pytest.approx(found.greedy)


def test_start_may_be_a_batch_and_ends_may_be_chosen():
    costs = (np.array([[1.0, 2.0], [4.0, 3.0]]),)
    batch = greedy(costs, [[0, 1], [1, 1]])
    assert batch.shape == (2, 2, 2)
    np.testing.assert_array_equal(batch[..., 1], [[0, 1], [1, 1]])
    np.testing.assert_array_equal(
        greedy(costs, [0, 1], allowed_last=[1]), [[0, 1], [1, 1]]
    )


def test_greedy_says_where_it_is_stuck():
    costs = (np.array([[1.0, 2.0]]), np.array([[np.inf], [1.0]]))
    with pytest.raises(ChainError, match=r"from node 0 of layer 2.*use look_ahead"):
        greedy(costs, 0)
    np.testing.assert_array_equal(look_ahead(costs, 0), [0, 1, 0])


def test_terminal_costs_steer():
    costs = (np.array([[1.0, 2.0]]),)
    assert cost_to_go(costs, np.array([5.0, 0.0]))[0] == 2.0
    assert cost_to_go(costs, np.array([0.0, np.inf]))[0] == 1.0


def test_refusals():
    with pytest.raises(ChainError, match=r"start=3: need node indices in 0\.\.0"):
        greedy(TRAP, 3)
    with pytest.raises(ChainError, match="allowed_last"):
        look_ahead(TRAP, 0, [1])
    with pytest.raises(ChainError, match="need node indices"):
        look_ahead(TRAP, 0.5)
    with pytest.raises(ChainError, match="layer 1 hold NaN"):
        greedy((np.array([[np.nan]]),), 0)
    with pytest.raises(ChainError, match="as a source"):
        look_ahead((np.zeros((1, 2)), np.zeros((3, 1))), 0)
    with pytest.raises(ChainError, match="last_costs"):
        cost_to_go(TRAP, np.array([np.nan]))
    with pytest.raises(ChainError, match="no gait starts at pose 4"):
        exhaustive(all_gaits((2, 2)), np.zeros(4), 4)
    with pytest.raises(ChainError, match=r"gaits \(4, 2\) and costs \(3,\)"):
        exhaustive(all_gaits((2, 2)), np.zeros(3), 0)
    with pytest.raises(ChainError, match=r"gaits \(2,\) and costs"):
        exhaustive(np.zeros(2, int), np.zeros(2), 0)
    with pytest.raises(ChainError, match="cost of gait 1 is NaN"):
        exhaustive(all_gaits((2, 2)), np.array([0.0, np.nan, 0.0, 0.0]), 0)
    gaits = all_gaits((1, 2, 1))
    with pytest.raises(ChainError, match=r"gait \[0, 0, 0\] of a policy"):
        regret(TRAP, TRAP, gaits[1:], np.zeros(1))
    with pytest.raises(ChainError, match="G >= 1"):
        regret(TRAP, TRAP, gaits, np.zeros(3))
    with pytest.raises(ChainError, match="gait 1 is not finite"):
        regret(TRAP, TRAP, gaits, np.array([0.0, np.inf]))
    bad = (TRAP[0], TRAP[1] * np.nan)
    for near, ahead in ((bad, TRAP), (TRAP, bad)):
        with pytest.raises(ChainError, match="layer 2 hold NaN"):
            regret(near, ahead, gaits, np.zeros(2))


@pytest.mark.parametrize(
    "sizes", [(1, 3, 1), (2, 2, 1), (1, 2, 2), (1, 2), (1, 2, 1, 1)]
)
def test_path_costs_of_other_layers_are_refused(sizes):
    gaits = all_gaits((1, 2, 1))
    ahead = [-np.arange(1.0, 1 + n * m).reshape(n, m) for n, m in pairwise(sizes)]
    with pytest.raises(ChainError):
        regret(TRAP, ahead, gaits, np.zeros(2))
