"""Expected costs of edges and poses, by which the next pose is chosen."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from gaitchain.chain.effects import Effects, estimate_effects
from gaitchain.chain.layered_chain import (
    FloatArray,
    IntArray,
    check_layer_sizes,
    freeze,
)
from gaitchain.chain.training import check_samples, edge_sums
from gaitchain.errors import ChainError

_FLOOR = float(np.finfo(np.float64).tiny)  # replaces a weight of 0
_SWEEPS = 20  # of backfitting; more would change the libraries that builds make


@dataclass(frozen=True, eq=False)
class EdgeStatistics:
    """Expected cost and number of the sampled gaits through each edge."""

    cost: tuple[FloatArray, ...]
    """cost[i][k, l] = expected f in [0, 1] of a gait through that edge."""
    count: tuple[IntArray, ...]
    """count[i][k, l] = sampled gaits through that edge, both (N_i, N_{i+1})."""

    def __post_init__(self) -> None:
        cost = tuple(freeze(np.asarray(c, np.float64)) for c in self.cost)
        count = tuple(freeze(np.asarray(c, np.int64)) for c in self.count)
        object.__setattr__(self, "cost", cost)
        object.__setattr__(self, "count", count)
        if [c.shape for c in cost] != [c.shape for c in count]:
            raise ChainError("cost and count differ in shape; both need (N_i, N_{i+1})")


def expected_costs(
    layer_sizes: Sequence[int],
    gaits: IntArray,
    costs: FloatArray,
    shrink: float | None = 1.0,
) -> EdgeStatistics:
    """Average f over the gaits through each edge, shrunk toward an additive guess.

    Ours: E[k, l] = (sum f + shrink * guess[k, l]) / (n[k, l] + shrink), where
    guess = row mean + column mean - global mean, clipped to [0, 1]; row and column
    means are shrunk toward the global mean in the same way. For an edge without a
    sampled gait E is the guess. Without a given `shrink`, rows, columns and edges are
    effects that are shrunk as much as their samples ask (`effects.estimate_effects`).

    Args:
        layer_sizes: poses per key moment, L of them.
        gaits: pose indices, shape (G, L), G >= 1.
        costs: f of each gait in [0, 1], shape (G,).
        shrink: weight of the guess, in gaits, >= 0; None estimates it.

    Returns:
        Expected cost and number of gaits of each edge.

    Raises:
        ChainError: an index, a cost or `shrink` is not allowed, or G = 0.
    """
    sizes, indices, checked = _check_learning(layer_sizes, gaits, costs, shrink)
    expected, counts = [], []
    for layer in range(len(sizes) - 1):
        count = edge_sums(sizes, indices, layer, None)
        if shrink is None:
            expected.append(_estimated(sizes, indices, layer, checked))
        else:
            total = edge_sums(sizes, indices, layer, checked)
            expected.append(_guessed(total, count, float(checked.mean()), shrink))
        counts.append(count.astype(np.int64))
    return EdgeStatistics(tuple(expected), tuple(counts))


def pose_costs(statistics: EdgeStatistics) -> tuple[FloatArray, ...]:
    """Average the expected cost of each pose over its edges, weighted by their count.

    Ours. The mean is over the outgoing edges in layer 1 and over the incoming edges in
    all other layers. It is not weighted for a pose without a sampled gait.

    Returns:
        Per layer the costs of its poses, shape (N_i,).
    """
    outgoing = _weighted_mean(statistics.cost[0], statistics.count[0], axis=1)
    pairs = zip(statistics.cost, statistics.count, strict=True)
    return (outgoing, *(_weighted_mean(cost, count, axis=0) for cost, count in pairs))


def path_costs(
    layer_sizes: Sequence[int],
    gaits: IntArray,
    costs: FloatArray,
    shrink: float | None = 1.0,
) -> tuple[FloatArray, ...]:
    """Split f into costs per edge whose sum along a gait is its expected cost.

    Ours: f is modelled as its mean, plus an effect of each pose, plus an effect of each
    edge, every effect shrunk toward 0 (a ridge regression, by backfitting). The costs
    of `expected_costs` cannot be added up, as each inner pose would count twice. With
    one strength for all, 200 walks fit their noise: the sum explains -4 % of the
    variance of other walks, with estimated strengths 17 % (`docs/paper_map.md`). With a
    strength of 1 sums along gaits are within 0.005 of the ridge regression where the
    layers were drawn independently, and within 0.02 where they go together; with a
    weaker one they may be further off.

    Args:
        layer_sizes: poses per key moment, L of them.
        gaits: pose indices, shape (G, L), G >= 1.
        costs: f of each gait in [0, 1], shape (G,).
        shrink: weight of the value 0 in each effect, in gaits, >= 0; None estimates one
            for each layer of poses and of edges (`path_effects`).

    Returns:
        L - 1 matrices, shape (N_i, N_{i+1}); their sum along a gait is E[f | gait].

    Raises:
        ChainError: an index, a cost or `shrink` is not allowed, or G = 0.
    """
    if shrink is None:
        fit = path_effects(layer_sizes, gaits, costs)
        return join_effects(layer_sizes, fit.mean, fit.means)
    sizes, indices, checked = _check_learning(layer_sizes, gaits, costs, shrink)
    mean = float(checked.mean())
    groups, widths = _path_groups(sizes, indices)
    effects = _backfit(groups, widths, checked - mean, shrink)
    return join_effects(sizes, mean, effects)


def path_effects(
    layer_sizes: Sequence[int], gaits: IntArray, costs: FloatArray
) -> Effects:
    """Fit the effects of all poses, then of all edges, layer by layer, on f.

    Arguments and errors are those of `path_costs`.
    """
    sizes, indices, checked = _check_learning(layer_sizes, gaits, costs, None)
    return estimate_effects(*_path_groups(sizes, indices), checked)


def join_effects(
    layer_sizes: Sequence[int], mean: float, effects: Sequence[FloatArray]
) -> tuple[FloatArray, ...]:
    """Join effects of poses and edges, as `path_effects` orders them, to edge costs."""
    shapes, layers = list(pairwise(layer_sizes)), len(layer_sizes)
    of_pose, of_edge = effects[:layers], effects[layers:]
    share = mean / len(shapes)  # so that all parts have the same mean
    parts = [
        edge.reshape(shape) + target + share
        for edge, shape, target in zip(of_edge, shapes, of_pose[1:], strict=True)
    ]
    parts[0] = parts[0] + of_pose[0][:, np.newaxis]
    return tuple(parts)


def _path_groups(
    sizes: tuple[int, ...], indices: IntArray
) -> tuple[list[IntArray], list[int]]:
    """Return the pose and the edge of each sample at each layer, and their numbers."""
    poses = [indices[:, layer] for layer in range(len(sizes))]
    edges = [k * n + m for k, m, n in zip(poses, poses[1:], sizes[1:], strict=False)]
    return [*poses, *edges], [*sizes, *(m * n for m, n in pairwise(sizes))]


def _guessed(
    total: FloatArray, count: FloatArray, mean: float, shrink: float
) -> FloatArray:
    """Return the means of a layer's edges, shrunk toward the additive guess."""
    centre = np.full((1, 1), mean)
    guess = -centre
    for axis in (0, 1):
        sums = total.sum(axis, keepdims=True), count.sum(axis, keepdims=True)
        guess = guess + _shrunk(*sums, centre, shrink)
    return _shrunk(total, count, np.clip(guess, 0.0, 1.0), shrink)


def _estimated(
    sizes: tuple[int, ...], indices: IntArray, layer: int, costs: FloatArray
) -> FloatArray:
    """Return the means of a layer's edges, shrunk as much as the samples ask."""
    rows, columns = sizes[layer : layer + 2]
    row, column = indices[:, layer], indices[:, layer + 1]
    widths = [rows, columns, rows * columns]
    fit = estimate_effects([row, column, row * columns + column], widths, costs)
    of_row, of_column, of_edge = fit.means
    cost = fit.mean + of_row[:, np.newaxis] + of_column + of_edge.reshape(rows, columns)
    return np.asarray(np.clip(cost, 0.0, 1.0))


def _check_learning(
    layer_sizes: Sequence[int],
    gaits: IntArray,
    costs: FloatArray,
    shrink: float | None,
) -> tuple[tuple[int, ...], IntArray, FloatArray]:
    if shrink is not None and not (math.isfinite(shrink) and shrink >= 0.0):
        raise ChainError(f"shrink={shrink}: need a finite weight >= 0, such as 1.0")
    sizes = check_layer_sizes(layer_sizes)
    indices, checked = check_samples(sizes, gaits, costs)
    if not checked.size:
        raise ChainError("0 sequences have no mean cost; sample at least 1")
    return sizes, indices, checked


def _backfit(
    groups: Sequence[IntArray],
    widths: Sequence[int],
    residual: FloatArray,
    shrink: float,
) -> list[FloatArray]:
    """Fit residual = sum of one effect per grouping, sweeping over the groupings.

    Args:
        groups: for each grouping the group of each sample, (G,).
        widths: number of groups of each grouping.
        residual: (G,) values to fit.
        shrink: weight of the value 0 in each effect, in gaits.

    Returns:
        For each grouping the effects of its groups, (width,).
    """
    effects = [np.zeros(width) for width in widths]
    weights = [
        np.maximum(np.bincount(group, minlength=width) + shrink, _FLOOR)
        for group, width in zip(groups, widths, strict=True)
    ]
    for _ in range(_SWEEPS):
        for i, group in enumerate(groups):
            residual = residual + effects[i][group]
            effects[i] = np.bincount(group, residual, widths[i]) / weights[i]
            residual = residual - effects[i][group]
    return effects


def _shrunk(
    total: FloatArray, count: FloatArray, guess: FloatArray, shrink: float
) -> FloatArray:
    weight = count + shrink
    mean = (total + shrink * guess) / np.where(weight > 0.0, weight, 1.0)
    return np.asarray(np.where(weight > 0.0, mean, guess))


def _weighted_mean(cost: FloatArray, count: IntArray, axis: int) -> FloatArray:
    seen = count.sum(axis=axis)
    weighted = (cost * count).sum(axis=axis) / np.maximum(seen, 1)
    return np.asarray(np.where(seen > 0, weighted, cost.mean(axis=axis)))
