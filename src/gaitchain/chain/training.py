"""Train the chain from sampled gaits and their costs: Eq. 5, Eq. 6, and batch counts.

`train_sequential` is the paper's update, sample by sample. `train_batch` is ours and
does not depend on the order of the samples; nor does `train_by_cost`, which goes by the
expected costs that were learned from them.
"""

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np

from gaitchain.chain.layered_chain import (
    FloatArray,
    IntArray,
    LayeredChain,
    check_gaits,
    check_layer_sizes,
    members_by_row,
)
from gaitchain.errors import ChainError

# Each update by Eq. 5-6 reduces the other edges of the row by up to one half; after
# about a thousand updates they would underflow to 0, whose logarithm in Eq. 2 is
# infinite. The least normal number is the lower limit instead.
_FLOOR = float(np.finfo(np.float64).tiny)
_ALIKE = 1e-6  # spread of costs that are the same but for rounding


def train_sequential(
    chain: LayeredChain,
    gaits: IntArray,
    costs: FloatArray,
    normalise: Literal["rows", "columns"] = "rows",
) -> LayeredChain:
    """Apply p += 1 - f (Eq. 5), then normalise (Eq. 6), after every sample in turn.

    An update divides its row by 2 - f, so the loop has a closed form: sample t adds
    (1 - f_t) times the product of 1 / (2 - f_u) over itself and the row's later ones.

    Ours: rows are normalised (sum over the target, as Eq. 4 requires). "columns" is
    Eq. 6 as printed (sum over the source); its result is made row-stochastic once, at
    the end, which changes no pose inner distance as a row's factor cancels in Eq. 2.
    No probability falls below the least normal float64, so the logarithm in Eq. 2 is
    finite.

    Args:
        chain: the chain before training.
        gaits: pose indices in the order of training, shape (G, L).
        costs: f of each gait in [0, 1], shape (G,).
        normalise: "rows" or "columns".

    Raises:
        ChainError: an index, a cost or `normalise` is not allowed.
    """
    if normalise not in ("rows", "columns"):
        raise ChainError(f"normalise={normalise!r}: need 'rows' or 'columns'")
    indices, checked = check_samples(chain.layer_sizes, gaits, costs)
    update = _update_rows if normalise == "rows" else _update_columns
    trained = tuple(
        update(matrix, indices[:, layer], indices[:, layer + 1], 1.0 - checked)
        for layer, matrix in enumerate(chain.transitions)
    )
    return LayeredChain(trained, chain.cyclic)


def train_batch(
    layer_sizes: Sequence[int],
    gaits: IntArray,
    costs: FloatArray,
    prior: float = 1.0,
    cyclic: bool = True,
) -> LayeredChain:
    """Count each edge with weight 1 - f: P[k, l] ~ prior / N_l + sum of (1 - f).

    Ours: the mean of a Dirichlet posterior, independent of the order of the samples;
    the prior distributes `prior` gaits of cost 0 evenly over a row, so P is never 0.

    Args:
        layer_sizes: poses per key moment, L of them.
        gaits: pose indices, shape (G, L).
        costs: f of each gait in [0, 1], shape (G,).
        prior: weight of the prior per row, in gaits of cost 0, > 0.
        cyclic: whether the last layer is the next step's first.

    Raises:
        ChainError: an index, a cost or the prior is not allowed.
    """
    if not (math.isfinite(prior) and prior > 0.0):
        raise ChainError(f"prior={prior}: need a finite weight above 0, such as 1.0")
    sizes = check_layer_sizes(layer_sizes)
    if prior / max(sizes) < np.finfo(float).tiny:
        raise ChainError(f"prior={prior}: nothing of it is left in a row; try 1.0")
    indices, checked = check_samples(sizes, gaits, costs)
    trained = []
    for layer in range(len(sizes) - 1):
        weights = edge_sums(sizes, indices, layer, 1.0 - checked)
        weights += prior / sizes[layer + 1]
        trained.append(weights / weights.sum(axis=1, keepdims=True))
    return LayeredChain(tuple(trained), cyclic)


def train_by_cost(expected: Sequence[FloatArray], cyclic: bool = True) -> LayeredChain:
    """Prefer edges by their expected cost: P[k, l] ~ exp(-E[k, l] / s).

    Ours: counts of a few hundred walks see an edge about twice, so the distances of
    Eq. 2 between poses are those of luck, the same whatever the costs. Here s is the
    spread of E within the rows of a layer, so that D_I is the mean difference of the
    costs at which two poses are reached, in units of that spread; with equal costs all
    poses are redundant.

    Args:
        expected: L - 1 matrices of expected edge costs, shape (N_i, N_{i+1}).
        cyclic: whether the last layer is the next step's first.

    Raises:
        ChainError: a cost is not finite.
    """
    trained = []
    for layer, costs in enumerate(expected):
        if not np.all(np.isfinite(costs)):
            raise ChainError(f"a cost of layer {layer + 1} is not finite; give all")
        off = costs - costs.mean(axis=1, keepdims=True)
        spread = float(np.sqrt(np.mean(off**2)))
        scaled = off / spread if spread > _ALIKE else np.zeros_like(off)
        weights = np.exp(scaled.min(axis=1, keepdims=True) - scaled)
        trained.append(weights / weights.sum(axis=1, keepdims=True))
    return LayeredChain(tuple(trained), cyclic)


def check_samples(
    layer_sizes: Sequence[int], gaits: IntArray, costs: FloatArray
) -> tuple[IntArray, FloatArray]:
    """Return gaits (G, L) and costs (G,), or raise ChainError for an invalid value."""
    indices = check_gaits(layer_sizes, gaits)
    values = np.asarray(costs, dtype=np.float64)
    if indices.ndim != 2 or values.shape != indices.shape[:1]:
        raise ChainError(
            f"sequences {indices.shape} and costs {values.shape}: need (G, L) and (G,)"
        )
    bad = np.flatnonzero(~((values >= 0.0) & (values <= 1.0)))
    if bad.size:
        worst = bad[0]
        raise ChainError(f"cost {values[worst]} of sequence {worst}: need 0 <= f <= 1")
    return indices, values


def edge_sums(
    sizes: tuple[int, ...], indices: IntArray, layer: int, weight: FloatArray | None
) -> FloatArray:
    """Sum the weights of the gaits through each edge out of a layer, or count them."""
    shape = sizes[layer], sizes[layer + 1]
    edge = indices[:, layer] * shape[1] + indices[:, layer + 1]
    sums = np.bincount(edge, weight, shape[0] * shape[1])
    return sums.astype(np.float64, copy=False).reshape(shape)


def _update_rows(
    matrix: FloatArray, source: IntArray, target: IntArray, weight: FloatArray
) -> FloatArray:
    """Apply the updates p[k, l] += w, p[k] /= 1 + w in closed form."""
    decay = np.zeros(matrix.shape[0])
    share = np.zeros(weight.size)
    for row, members in members_by_row(source, matrix.shape[0]):
        # Summed from the last sample back, so that large shares have small errors.
        later = np.cumsum(np.log1p(weight[members])[::-1])[::-1]
        share[members] = weight[members] * np.exp(-later)
        decay[row] = later[0]
    added = np.bincount(source * matrix.shape[1] + target, share, matrix.size)
    trained = matrix * np.exp(-decay)[:, np.newaxis] + added.reshape(matrix.shape)
    trained = np.maximum(trained, _FLOOR, where=matrix > 0.0, out=trained)
    total = trained.sum(axis=1, keepdims=True)
    return np.asarray(trained / np.where(total > 0.0, total, 1.0))


def _update_columns(
    matrix: FloatArray, source: IntArray, target: IntArray, weight: FloatArray
) -> FloatArray:
    """Apply the updates with Eq. 6 as printed; normalise the rows at the end."""
    if not weight.size:
        return matrix
    first = np.array(matrix)
    first[source[0], target[0]] += weight[0]
    # Only before the first sample do columns not sum to 1. After it the update of
    # columns equals that of rows, so the same closed form applies.
    total = first.sum(axis=0)
    first /= np.where(total > 0.0, total, 1.0)
    trained = _update_rows(first.T, target[1:], source[1:], weight[1:]).T
    return np.asarray(trained / trained.sum(axis=1, keepdims=True))
