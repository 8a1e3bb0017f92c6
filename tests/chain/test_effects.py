"""Effects as strong as the samples show, against drawn ones; directed walks."""

from itertools import pairwise

import numpy as np
import pytest

from gaitchain.chain.directed_walks import direct_walks
from gaitchain.chain.effects import estimate_effects
from gaitchain.chain.expectation import expected_costs, path_costs
from gaitchain.chain.policy import look_ahead
from gaitchain.chain.sampling import draw_walks
from gaitchain.chain.training import train_batch

SIZES = (6, 8, 8, 6)


def gaits_of(rng, count):
    return np.column_stack([rng.integers(n, size=count) for n in SIZES])


def costs_of(gaits, poses, edges, rng, noise):
    """Drawn effects of poses and edges, and noise; between 0 and 1 as f is."""
    total = 0.3 + sum(p[gaits[:, i]] for i, p in enumerate(poses))
    for i, edge in enumerate(edges):
        total = total + edge[gaits[:, i], gaits[:, i + 1]]
    return np.clip(total + rng.normal(0.0, noise, len(gaits)), 0.0, 1.0)


def truth(rng, of_pose, of_edge):
    poses = [rng.normal(0.0, of_pose[i], n) for i, n in enumerate(SIZES)]
    shapes = enumerate(pairwise(SIZES))
    edges = [rng.normal(0.0, of_edge[i], shape) for i, shape in shapes]
    return poses, edges


def along(matrices, gaits):
    steps = enumerate(matrices)
    return sum(m[gaits[:, i], gaits[:, i + 1]] for i, m in steps)


@pytest.mark.parametrize("seed", range(3))
def test_variances_are_recovered(seed):
    rng = np.random.default_rng(seed)
    groups = [rng.integers(40, size=8000), rng.integers(60, size=8000)]
    real = [rng.normal(0.0, 0.05, 40), np.zeros(60)]
    values = 0.4 + real[0][groups[0]] + rng.normal(0.0, 0.1, 8000)
    fit = estimate_effects(groups, [40, 60], values)
    assert np.sqrt(fit.noise) == pytest.approx(0.1, rel=0.03)
    assert np.corrcoef(fit.means[0], real[0])[0, 1] > 0.97
    assert np.abs(fit.means[1]).max() < 0.01  # nothing to see: shrunk away
    inside = np.abs(fit.means[0] - real[0] + real[0].mean())
    assert np.mean(inside < 2.0 * np.sqrt(fit.variances[0])) > 0.8


@pytest.mark.parametrize("seed", range(4))
def test_estimated_strengths_predict_better_than_fixed_ones(seed):
    """On walks that were not learned from, where noise is as large as the effects."""
    rng = np.random.default_rng(seed)
    model = truth(rng, (0.0, 0.02, 0.04, 0.0), (0.03, 0.01, 0.0))
    seen, other = gaits_of(rng, 300), gaits_of(rng, 4000)
    costs, later = (costs_of(g, *model, rng, 0.1) for g in (seen, other))
    off = {
        shrink: np.mean(
            (along(path_costs(SIZES, seen, costs, shrink), other) - later) ** 2
        )
        for shrink in (None, 1.0)
    }
    assert off[None] < off[1.0]


def test_equal_costs_teach_nothing():
    rng = np.random.default_rng(0)
    gaits = gaits_of(rng, 200)
    for matrix in path_costs(SIZES, gaits, np.full(200, 0.25), shrink=None):
        np.testing.assert_allclose(matrix, 0.25 / 3.0, atol=1e-6)
    learned = expected_costs(SIZES, gaits, np.full(200, 0.25), shrink=None)
    for matrix in learned.cost:
        np.testing.assert_allclose(matrix, 0.25, atol=1e-6)


@pytest.mark.slow
def test_directed_walks_go_the_cheap_way():
    """With many samples the best way is known; ends and allowed edges stay."""
    rng = np.random.default_rng(1)
    model = truth(rng, (0.0, 0.05, 0.05, 0.0), (0.05, 0.05, 0.05))
    allowed = [rng.random(shape) < 0.8 for shape in pairwise(SIZES)]
    gaits = gaits_of(rng, 20_000)
    costs = costs_of(gaits, *model, rng, 0.02)
    walks = draw_walks(allowed, 20, 5, rng)
    directed = direct_walks(walks, allowed, (gaits, costs), rng)
    poses, edges = model
    true = [edges[i] + poses[i + 1] for i in range(3)]
    true = [np.where(mask, m, np.inf) for m, mask in zip(true, allowed, strict=True)]
    for before, after in zip(walks, directed, strict=True):
        np.testing.assert_array_equal(before[:, [0, 3]], after[:, [0, 3]])
        assert np.isfinite(along(true, after)).all()
        best = np.stack([look_ahead(true, int(a), [int(b)]) for a, *_, b in before])
        assert along(true, after).mean() < along(true, best).mean() + 0.02


def test_directed_walks_explore_what_is_unknown():
    rng = np.random.default_rng(2)
    allowed = [np.ones(shape, bool) for shape in pairwise(SIZES)]
    gaits = gaits_of(rng, 20)
    samples = gaits, costs_of(gaits, *truth(rng, (0.1,) * 4, (0.1,) * 3), rng, 0.1)
    walks = draw_walks(allowed, 40, 5, rng)
    seen = np.concatenate(direct_walks(walks, allowed, samples, rng))
    assert len(np.unique(seen[:, 1])) > 3
    assert train_batch(SIZES, seen, np.zeros(len(seen))).is_stochastic()
