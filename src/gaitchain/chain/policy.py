"""Policies that choose the next pose: greedy (the paper) and look-ahead; their regret.

Edge costs have one number per edge of the layered chain, edge_costs[i][k, l] from pose
k of layer i to pose l of layer i + 1. A cost of +inf forbids the edge.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gaitchain.chain.layered_chain import (
    FloatArray,
    IntArray,
    check_gaits,
    matrix_sizes,
)
from gaitchain.errors import ChainError


@dataclass(frozen=True)
class Regret:
    """Cost of each policy above that of the best gait from the same start pose."""

    greedy: float
    """Mean regret of `greedy` over the start poses / (max - min cost)."""
    look_ahead: float
    """Mean regret of `look_ahead` over the start poses / (max - min cost)."""
    greedy_absolute: float
    """Mean regret of `greedy`, in units of the cost."""
    look_ahead_absolute: float
    """Mean regret of `look_ahead`, in units of the cost."""


def greedy(
    edge_costs: Sequence[FloatArray],
    start: ArrayLike,
    allowed_last: ArrayLike | None = None,
) -> IntArray:
    """Choose the edge of least expected cost at each key moment (Sec. V, argmin f).

    Ours: f is defined for sequences, so the cost of an edge is the expected cost of the
    gaits through it.

    Args:
        edge_costs: L - 1 matrices, shape (N_i, N_{i+1}).
        start: pose of layer 1, or an array of them, shape (...).
        allowed_last: indices of the poses allowed in the last layer; None allows all.

    Returns:
        Pose indices, shape (..., L).

    Raises:
        ChainError: an index or a cost does not fit, or a chosen pose has no successor.
    """
    costs, last, first = _checked(edge_costs, start, allowed_last)
    ahead = [np.zeros(matrix.shape[1]) for matrix in costs[:-1]] + [last]
    return _follow(costs, ahead, first)


def look_ahead(
    edge_costs: Sequence[FloatArray],
    start: ArrayLike,
    allowed_last: ArrayLike | None = None,
) -> IntArray:
    """Choose the path with the least sum of edge costs up to the last key moment.

    Ours: Bellman's rule, next = argmin_l (c[k, l] + V[l]), with V of `cost_to_go`.
    Arguments, result and errors are those of `greedy`.
    """
    costs, last, first = _checked(edge_costs, start, allowed_last)
    return _follow(costs, cost_to_go(costs, last)[1:], first)


def cost_to_go(
    edge_costs: Sequence[FloatArray], last_costs: FloatArray | None = None
) -> tuple[FloatArray, ...]:
    """Compute the cost of the cheapest path from each pose to the last layer.

    Ours: V_L = last_costs, V_i[k] = min_l (c_i[k, l] + V_{i+1}[l]); +inf where no path
    is allowed.

    Args:
        edge_costs: L - 1 matrices, shape (N_i, N_{i+1}).
        last_costs: cost of ending at each pose, shape (N_L,); +inf forbids the pose.
            None for zeros.

    Returns:
        Per layer the cost to go, shape (N_i,), L arrays.

    Raises:
        ChainError: a shape does not fit, or a cost is NaN or -inf.
    """
    costs = _check_costs(edge_costs)
    size = costs[-1].shape[1]
    last = np.zeros(size) if last_costs is None else np.asarray(last_costs, float)
    if last.shape != (size,) or np.any(np.isnan(last) | (last == -np.inf)):
        raise ChainError(
            f"last_costs of shape {last.shape}: need ({size},), finite or +inf"
        )
    values = [last]
    for matrix in reversed(costs):
        values.append((matrix + values[-1]).min(axis=1))
    return tuple(reversed(values))


def forbid(
    costs: Sequence[FloatArray], allowed: Sequence[NDArray[np.bool_]]
) -> tuple[FloatArray, ...]:
    """Set the cost of every edge that is not allowed to +inf."""
    pairs = zip(costs, allowed, strict=True)
    return tuple(np.where(mask, cost, np.inf) for cost, mask in pairs)


def exhaustive(gaits: IntArray, costs: FloatArray, start: int) -> IntArray:
    """Return the cheapest of the enumerated gaits that begin at `start`.

    Args:
        gaits: pose indices, shape (G, L).
        costs: cost of each gait, shape (G,).
        start: pose of layer 1.

    Returns:
        Pose indices, shape (L,); the first such row if several cost the same.

    Raises:
        ChainError: no gait begins there, a shape does not fit, or a cost is NaN.
    """
    table, true = np.asarray(gaits), np.asarray(costs, dtype=np.float64)
    if table.ndim != 2 or not table.shape[1] or true.shape != table.shape[:1]:
        raise ChainError(
            f"gaits {table.shape} and costs {true.shape}: need (G, L) and (G,)"
        )
    if np.isnan(true).any():
        raise ChainError(f"cost of gait {np.argmax(np.isnan(true))} is NaN")
    rows = np.flatnonzero(table[:, 0] == start)
    if not rows.size:
        raise ChainError(
            f"no gait starts at pose {start}; starts are {np.unique(table[:, 0])}"
        )
    best: IntArray = table[rows[np.argmin(true[rows])]]
    return best


def regret(
    edge_costs: Sequence[FloatArray],
    path_costs: Sequence[FloatArray],
    gaits: IntArray,
    costs: FloatArray,
) -> Regret:
    """Compare both policies with the exhaustive optimum from each start pose.

    Ours: regret = mean over starts of f(policy's gait) - min f from that start.

    Args:
        edge_costs: L - 1 matrices, shape (N_i, N_{i+1}), for `greedy`.
        path_costs: L - 1 matrices of the same shapes, for `look_ahead`.
        gaits: all gaits, shape (G, L).
        costs: true cost of each, shape (G,), finite.

    Returns:
        The regret of both policies, relative to max - min cost and absolute.

    Raises:
        ChainError: a shape does not fit, or a policy's gait is not among `gaits`.
    """
    sizes = matrix_sizes(_check_costs(edge_costs))
    ahead_sizes = matrix_sizes(_check_costs(path_costs))
    if ahead_sizes != sizes:
        raise ChainError(
            f"path_costs of {ahead_sizes} poses per layer: need {sizes}, as edge_costs"
        )
    indices, true = check_gaits(sizes, gaits), np.asarray(costs, dtype=np.float64)
    if indices.ndim != 2 or true.shape != indices.shape[:1] or not true.size:
        raise ChainError(
            f"gaits {indices.shape} and costs {true.shape}: need (G, L), (G,), G >= 1"
        )
    if not np.all(np.isfinite(true)):
        raise ChainError(f"cost of gait {np.argmin(np.isfinite(true))} is not finite")
    starts = np.unique(indices[:, 0])
    optimum = np.full(sizes[0], np.inf)
    np.minimum.at(optimum, indices[:, 0], true)
    absolute = [
        float(np.mean(_look_up(chosen, indices, true, sizes) - optimum[starts]))
        for chosen in (greedy(edge_costs, starts), look_ahead(path_costs, starts))
    ]
    # If all costs are equal the regret is 0, whatever the scale.
    scale = float(np.ptp(true)) or 1.0
    return Regret(absolute[0] / scale, absolute[1] / scale, absolute[0], absolute[1])


def _look_up(
    chosen: IntArray, gaits: IntArray, costs: FloatArray, sizes: tuple[int, ...]
) -> FloatArray:
    codes = np.ravel_multi_index(tuple(gaits.T), sizes)
    wanted = np.ravel_multi_index(tuple(chosen.T), sizes)
    order = np.argsort(codes)
    place = np.minimum(np.searchsorted(codes[order], wanted), codes.size - 1)
    rows = order[place]
    missing = codes[rows] != wanted
    if np.any(missing):
        raise ChainError(
            f"gait {chosen[np.argmax(missing)].tolist()} of a policy has no true cost; "
            "pass all gaits (pruning.all_gaits) or forbid its edges with +inf"
        )
    return np.asarray(costs[rows])


def _follow(
    costs: Sequence[FloatArray], ahead: Sequence[FloatArray], start: IntArray
) -> IntArray:
    """Follow argmin of edge cost + value of the next pose, layer by layer."""
    path = [start]
    for layer, (matrix, value) in enumerate(zip(costs, ahead, strict=True)):
        total = matrix[path[-1]] + value
        stuck = ~np.isfinite(total.min(axis=-1))
        if np.any(stuck):
            node = int(path[-1][stuck].flat[0])
            raise ChainError(
                f"no allowed path leads on from node {node} of layer {layer + 1}: all "
                "its edges or ends are forbidden (+inf); allow one, or use look_ahead, "
                "which avoids dead ends where a path exists"
            )
        path.append(np.argmin(total, axis=-1).astype(np.int64, copy=False))
    return np.stack(path, axis=-1)


def _checked(
    edge_costs: Sequence[FloatArray], start: ArrayLike, allowed_last: ArrayLike | None
) -> tuple[tuple[FloatArray, ...], FloatArray, IntArray]:
    """Return the costs, the terminal cost (0 or +inf) and the start poses."""
    costs = _check_costs(edge_costs)
    last = np.zeros(costs[-1].shape[1])
    if allowed_last is not None:
        allowed = check_nodes("allowed_last", allowed_last, last.size)
        last[:] = np.inf
        last[allowed] = 0.0
    return costs, last, check_nodes("start", start, costs[0].shape[0])


def check_nodes(name: str, nodes: ArrayLike, size: int) -> IntArray:
    """Return nodes of a layer as an array of indices.

    Args:
        name: what they are, for the message.
        nodes: one, or an array of them.
        size: number of the layer's nodes.

    Raises:
        ChainError: one does not exist, or is no index.
    """
    values = np.asarray(nodes)
    integer = np.issubdtype(values.dtype, np.integer)
    if not integer or np.any((values < 0) | (values >= size)):
        raise ChainError(
            f"{name}={values.tolist()}: need node indices in 0..{size - 1}"
        )
    return values.astype(np.int64, copy=False)


def _check_costs(edge_costs: Sequence[FloatArray]) -> tuple[FloatArray, ...]:
    costs = tuple(np.asarray(matrix, dtype=np.float64) for matrix in edge_costs)
    matrix_sizes(costs)
    for layer, matrix in enumerate(costs):
        if np.any(np.isnan(matrix) | (matrix == -np.inf)):
            raise ChainError(
                f"edge costs of layer {layer + 1} hold NaN or -inf: need numbers, or "
                "+inf to forbid an edge"
            )
    return costs
