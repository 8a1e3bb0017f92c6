"""Remove redundant poses: Eq. 2, eps independent poses, zeta independent gaits."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from gaitchain.chain.layered_chain import (
    FloatArray,
    IntArray,
    LayeredChain,
    check_gaits,
    check_layer_sizes,
    freeze,
)
from gaitchain.errors import ChainError

# Replaces a probability of 0, so that every distance is finite: between two zeros it is
# 0, between 0 and any other probability it is large.
_FLOOR = float(np.finfo(np.float64).tiny)

_DistanceTo = Callable[[int, IntArray], FloatArray]


@dataclass(frozen=True, eq=False)
class Pruned:
    """A pruned chain, and the nodes of the old chain that it kept."""

    kept: tuple[IntArray, ...]
    """Per layer the rising indices, into the old chain, of the poses that are kept."""
    chain: LayeredChain
    """The chain of these poses, rows renormalised."""

    def __post_init__(self) -> None:
        frozen = tuple(freeze(np.asarray(group, np.int64)) for group in self.kept)
        object.__setattr__(self, "kept", frozen)


def inner_distance(transition: FloatArray, base: float = math.e) -> FloatArray:
    """Compute the pose inner distance D_I of one layer (Eq. 2).

    ``D_I(k, l) = mean over source poses n of |log(pro(n, k) / pro(n, l))|``. The united
    probability is pro(n, k) = pro(n) P[n, k], so pro(n) cancels and P is enough.

    Ours: the natural logarithm by default (the base of the paper's lg is not given); a
    probability of 0 is replaced by the least normal float64, so that D_I is finite.

    Args:
        transition: P into the layer, shape (N_source, N).
        base: base of the logarithm, > 1; it only scales the distance.

    Returns:
        Distances, shape (N, N), symmetric with a zero diagonal.

    Raises:
        ChainError: the base is not above 1, or P is no matrix of numbers >= 0.
    """
    matrix = np.asarray(transition, dtype=np.float64)
    if matrix.ndim != 2 or not np.all((matrix >= 0.0) & (matrix < math.inf)):
        raise ChainError(
            f"transition of shape {matrix.shape}: need (N_source, N), finite and >= 0"
        )
    if not (math.isfinite(base) and base > 1.0):
        raise ChainError(f"base={base}: need a finite base above 1, such as e or 10")
    logs = np.log(np.maximum(matrix, _FLOOR)).T / math.log(base)  # (N, N_source)
    logs = np.ascontiguousarray(logs)
    distance = np.zeros((logs.shape[0], logs.shape[0]))
    # Each pose is compared with the later ones only: N^2 memory, and exact symmetry.
    for pose in range(logs.shape[0] - 1):
        apart = np.abs(logs[pose + 1 :] - logs[pose]).mean(axis=1)
        distance[pose, pose + 1 :] = distance[pose + 1 :, pose] = apart
    return distance


def pose_distances(chain: LayeredChain, base: float = math.e) -> tuple[FloatArray, ...]:
    """Compute D_I of every layer (Eq. 2): (N_i, N_i) from the transitions into it.

    Ours: layer 1 of a cyclic chain is the last layer of the step before, so both have
    the same matrix. Layer 1 of an open chain has no predecessor; its matrix is zero.
    """
    later = tuple(inner_distance(matrix, base) for matrix in chain.transitions)
    size = chain.layer_sizes[0]
    return (later[-1] if chain.cyclic else np.zeros((size, size)), *later)


def independent_group(
    distance: FloatArray, costs: FloatArray, epsilon: float
) -> IntArray:
    """Choose an eps independent pose group (Definition 2.2).

    Ours: of the many maximal groups, the one chosen greedily in order of rising cost
    (equal costs by index), so that the best pose of each cluster is kept. Kept poses
    are at least eps apart, and each removed pose is less than eps from a kept one. The
    group can grow with eps.

    Args:
        distance: D_I of the layer, shape (N, N).
        costs: cost of each pose, shape (N,).
        epsilon: least distance, >= 0; 0 keeps every pose.

    Returns:
        Rising indices of the kept poses.

    Raises:
        ChainError: epsilon is negative, or the shapes or values do not fit.
    """
    table, order = np.asarray(distance), _order(costs)
    if table.shape != (order.size, order.size) or not np.all(np.isfinite(table)):
        shape = (order.size, order.size)
        raise ChainError(f"distance {table.shape}: need finite numbers of {shape}")
    return _separate(order, epsilon, "epsilon", lambda one, rest: table[one, rest])


def prune(
    chain: LayeredChain,
    costs: Sequence[FloatArray],
    epsilon: float,
    base: float = math.e,
    *,
    layers: Sequence[int] | None = None,
    classes: Sequence[IntArray] | None = None,
) -> Pruned:
    """Reduce each layer to its eps independent group (Fig. 5, Sec. IV-D.2).

    Ours: all distances are computed before any node is removed, so the order of the
    layers does not matter. The first and the last layer of a cyclic chain have the same
    group, chosen by the costs of the last; either one in `layers` stands for both.
    Poses of different classes are never redundant to each other.

    Args:
        chain: the trained chain.
        costs: per layer the cost of each pose, shape (N_i,).
        epsilon: least pose inner distance, >= 0.
        base: base of the logarithm in Eq. 2, > 1.
        layers: 0-based layers to prune; None for all except layer 0 of an open chain.
        classes: per layer a label for each pose, (N_i,); one class by default.

    Raises:
        ChainError: a layer, a cost, a class or epsilon is not allowed.
    """
    sizes = chain.layer_sizes
    if len(costs) != len(sizes):
        raise ChainError(f"costs has {len(costs)} layers, the chain {len(sizes)}")
    allowed = _prunable(chain, layers)
    kept = [np.arange(size, dtype=np.int64) for size in sizes]
    for layer in sorted(allowed - {0}):
        distance = inner_distance(chain.transitions[layer - 1], base)
        labels = np.zeros(sizes[layer]) if classes is None else classes[layer]
        kept[layer] = _groups(distance, costs[layer], epsilon, labels)
    if chain.cyclic:
        kept[0] = kept[-1]
    return Pruned(tuple(kept), chain.keep(kept))


def gait_distance(gaits: IntArray, distances: Sequence[FloatArray]) -> FloatArray:
    """Average the pose inner distances of two gaits over the key moments.

    Ours: the paper defines the gait distance only as "similarly". Arguments are those
    of `independent_gaits`; the result has shape (G, G).
    """
    indices = check_gaits([len(table) for table in distances], gaits)
    return _between(indices[:, np.newaxis], indices[np.newaxis], distances)


def independent_gaits(
    gaits: IntArray,
    distances: Sequence[FloatArray],
    costs: FloatArray,
    zeta: float,
) -> IntArray:
    """Choose a zeta independent gait group, greedy in order of rising cost.

    Ours, by analogy with the pose group. Each kept gait is compared only with the gaits
    that are neither kept nor removed yet, so no (G, G) matrix is needed.

    Args:
        gaits: pose indices, shape (G, L).
        distances: D_I per layer, shape (N_i, N_i); zeros where a layer has none.
        costs: f of each gait, shape (G,).
        zeta: least gait distance, >= 0; 0 keeps every gait.

    Returns:
        Rising row numbers of the kept gaits.

    Raises:
        ChainError: zeta is negative, or the shapes or values do not fit.
    """
    indices = check_gaits([len(table) for table in distances], gaits)
    order = _order(costs)
    if indices.shape[:-1] != order.shape:
        raise ChainError(
            f"gaits {indices.shape}, {order.size} costs: one cost per gait"
        )

    def distance_to(one: int, rest: IntArray) -> FloatArray:
        return _between(indices[one], indices[rest], distances)

    return _separate(order, zeta, "zeta", distance_to)


def all_gaits(layer_sizes: Sequence[int], limit: int = 100_000) -> IntArray:
    """Enumerate every gait, the last key moment varying fastest.

    Returns:
        Pose indices, shape (N_1 N_2 ... N_L, L).

    Raises:
        ChainError: there are more gaits than `limit`.
    """
    sizes = check_layer_sizes(layer_sizes)
    total = math.prod(sizes)
    if total > limit:
        raise ChainError(
            f"layers {sizes} make {total} gaits, over the limit of {limit}; prune the "
            "chain, raise the limit, or sample with draw_gaits"
        )
    return np.indices(sizes, dtype=np.int64).reshape(len(sizes), total).T.copy()


def _groups(
    distance: FloatArray, costs: FloatArray, epsilon: float, labels: ArrayLike
) -> IntArray:
    """Choose an eps independent group of each class; return them together."""
    each, values = np.asarray(labels), np.asarray(costs)
    if not each.shape == values.shape == distance.shape[:1]:
        raise ChainError(
            f"costs {values.shape}, classes {each.shape}: need one of each for "
            f"{len(distance)} poses"
        )
    found = []
    for label in np.unique(each):
        of = np.flatnonzero(each == label)
        apart = distance[np.ix_(of, of)]
        found.append(of[independent_group(apart, values[of], epsilon)])
    return np.sort(np.concatenate(found))


def _separate(
    order: IntArray, least: float, name: str, distance_to: _DistanceTo
) -> IntArray:
    """Repeatedly keep the first element and remove those nearer to it than `least`."""
    if math.isnan(least) or least < 0.0:
        raise ChainError(f"{name}={least}: need a distance >= 0 (0 keeps everything)")
    if least == 0.0:
        return np.sort(order)
    kept, remaining = [], order
    while remaining.size:
        best, rest = int(remaining[0]), remaining[1:]
        kept.append(best)
        remaining = rest[distance_to(best, rest) >= least]
    return np.sort(np.array(kept, dtype=np.int64))


def _order(costs: FloatArray) -> IntArray:
    values = np.asarray(costs, dtype=np.float64)
    if values.ndim != 1 or np.any(np.isnan(values)):
        raise ChainError(f"costs of shape {values.shape}: need a 1-D array, no NaN")
    return np.argsort(values, kind="stable").astype(np.int64, copy=False)


def _prunable(chain: LayeredChain, layers: Sequence[int] | None) -> set[int]:
    last = len(chain.layer_sizes) - 1
    first = 0 if chain.cyclic else 1
    allowed = set(range(first, last + 1) if layers is None else layers)
    for layer in allowed:
        if not first <= layer <= last:
            raise ChainError(f"layer {layer} cannot be pruned: need {first}..{last}")
    ends = {0, last}
    return allowed | ends if chain.cyclic and allowed & ends else allowed


def _between(
    one: IntArray, other: IntArray, distances: Sequence[FloatArray]
) -> FloatArray:
    layers = enumerate(distances)
    apart = [table[one[..., layer], other[..., layer]] for layer, table in layers]
    return np.asarray(sum(apart) / len(apart))
