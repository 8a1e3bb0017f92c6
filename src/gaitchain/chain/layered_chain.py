"""The layered Markov chain of key poses: Eq. 4, gait probability, removal of nodes.

A gait is one pose index per key moment, so an array of gaits has shape (..., L).
The last key moment with the legs' roles exchanged is the first one of the next step. A
*cyclic* chain therefore has equal first and last layers: node j of the last layer is
node j of the next step's first layer, and L - 1 matrices define the chain.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from numbers import Integral
from typing import TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from gaitchain.errors import ChainError

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
_Number = TypeVar("_Number", np.float64, np.int64)

ROW_SUM_TOLERANCE = 1e-9


@dataclass(frozen=True, eq=False)
class LayeredChain:
    """Transition probabilities between consecutive key moments (Eq. 4).

    Raises:
        ChainError: a matrix is missing, not 2-D, does not fit its neighbour, has an
            entry that is not a probability, or a row that does not sum to 1.
    """

    transitions: tuple[FloatArray, ...]
    """transitions[i][k, l] = P(pose l of layer i + 1 | pose k of layer i), L - 1 of
    them, read-only."""
    cyclic: bool = True
    """Whether the last layer is the first layer of the next step (ours, see above)."""

    def __post_init__(self) -> None:
        frozen = tuple(freeze(np.asarray(m, np.float64)) for m in self.transitions)
        object.__setattr__(self, "transitions", frozen)
        sizes = matrix_sizes(frozen)
        for layer, matrix in enumerate(frozen):
            _check_rows(layer, matrix)
        if self.cyclic and sizes[0] != sizes[-1]:
            raise ChainError(
                f"a cyclic chain needs equal first and last layers, got {sizes[0]} "
                f"and {sizes[-1]} nodes; pass cyclic=False for an open chain"
            )

    @classmethod
    def uniform(cls, layer_sizes: Sequence[int], cyclic: bool = True) -> "LayeredChain":
        """Create the untrained chain of L layers, P = 1 / N_{i+1} on every edge."""
        pairs = pairwise(check_layer_sizes(layer_sizes))
        return cls(tuple(np.full(pair, 1.0 / pair[1]) for pair in pairs), cyclic)

    @property
    def layer_sizes(self) -> tuple[int, ...]:
        """Poses per key moment, L of them."""
        return matrix_sizes(self.transitions)

    def is_stochastic(self) -> bool:
        """Whether every row sums to 1 within `ROW_SUM_TOLERANCE`."""
        return all(
            bool(np.all(np.abs(matrix.sum(axis=1) - 1.0) <= ROW_SUM_TOLERANCE))
            for matrix in self.transitions
        )

    def gait_probability(
        self, gaits: IntArray, first: FloatArray | None = None
    ) -> FloatArray:
        """Compute the probability of each gait, pro(Phi(A)) of Sec. IV-B.

        Args:
            gaits: pose indices, shape (..., L).
            first: probability of each pose of layer 1, shape (N_1,). Without it the
                result is conditional on the first pose of the gait.

        Returns:
            Probabilities, shape (...).

        Raises:
            ChainError: an index or the length of `first` does not fit the chain.
        """
        indices = check_gaits(self.layer_sizes, gaits)
        result = np.ones(indices.shape[:-1])
        if first is not None:
            if np.shape(first) != self.layer_sizes[:1]:
                raise ChainError(
                    f"first has shape {np.shape(first)}, but layer 1 has "
                    f"{self.layer_sizes[0]} nodes: pass one probability for each"
                )
            result = result * np.asarray(first)[indices[..., 0]]
        for layer, matrix in enumerate(self.transitions):
            result = result * matrix[indices[..., layer], indices[..., layer + 1]]
        return result

    def sample(
        self, rng: np.random.Generator, count: int, first: IntArray | None = None
    ) -> IntArray:
        """Draw `count` gaits, shape (count, L).

        Args:
            rng: source of randomness.
            count: number of gaits.
            first: (count,) their first poses; drawn uniformly by default.

        Raises:
            ChainError: `count` is no whole number >= 0, or a first pose does not exist.
        """
        _check_count(count)
        gaits = np.empty((count, len(self.transitions) + 1), dtype=np.int64)
        if first is None:
            first = rng.integers(self.layer_sizes[0], size=count)
        gaits[:, 0] = self._check_first(first, count)
        for layer, matrix in enumerate(self.transitions):
            cumulative = np.cumsum(matrix, axis=1)
            # The last value becomes exactly 1, so a draw below 1 never selects an edge
            # of probability 0 at the end of a row.
            cumulative /= cumulative[:, -1:]
            draws = rng.random(count)
            for row, members in members_by_row(gaits[:, layer], matrix.shape[0]):
                gaits[members, layer + 1] = np.searchsorted(
                    cumulative[row], draws[members], side="right"
                )
        return gaits

    def keep(self, kept: Sequence[IntArray]) -> "LayeredChain":
        """Remove all other nodes with their edges, and renormalise the rows (Fig. 5).

        Args:
            kept: per layer the rising indices of the poses that are kept.

        Returns:
            The smaller chain.

        Raises:
            ChainError: the indices do not fit, the two ends of a cyclic chain keep
                different nodes, or a row loses every edge that it had.
        """
        groups = self._check_kept(kept)
        cut = []
        for layer, matrix in enumerate(self.transitions):
            part = matrix[np.ix_(groups[layer], groups[layer + 1])]
            total = part.sum(axis=1, keepdims=True)
            if not np.all(total > 0.0):
                row = groups[layer][int(np.argmin(total))]
                raise ChainError(
                    f"node {row} of layer {layer + 1} would keep no edge of positive "
                    "probability; keep one of its successors or drop it as well"
                )
            cut.append(part / total)
        return LayeredChain(tuple(cut), self.cyclic)

    def _check_first(self, first: IntArray, count: int) -> IntArray:
        if np.shape(first) != (count,):
            raise ChainError(f"first has shape {np.shape(first)}: need ({count},)")
        column = np.asarray(first)[:, np.newaxis]
        return check_gaits(self.layer_sizes[:1], column)[:, 0]

    def _check_kept(self, kept: Sequence[IntArray]) -> list[IntArray]:
        sizes = self.layer_sizes
        if len(kept) != len(sizes):
            raise ChainError(f"kept has {len(kept)} layers, the chain {len(sizes)}")
        groups = [np.asarray(group, dtype=np.int64) for group in kept]
        for layer, (group, size) in enumerate(zip(groups, sizes, strict=True)):
            inside = group.size > 0 and group[0] >= 0 and group[-1] < size
            if not (inside and np.all(np.diff(group) > 0)):
                raise ChainError(
                    f"layer {layer + 1} cannot keep {group.tolist()}: needs at least "
                    f"one index, rising, from 0..{size - 1}"
                )
        if self.cyclic and not np.array_equal(groups[0], groups[-1]):
            raise ChainError(
                f"a cyclic chain keeps the same nodes at both ends, got "
                f"{groups[0].tolist()} and {groups[-1].tolist()}"
            )
        return groups


def draw_gaits(
    layer_sizes: Sequence[int], count: int, rng: np.random.Generator
) -> IntArray:
    """Select pose sequences at random, every pose equally likely (Sec. V).

    Args:
        layer_sizes: poses per key moment, L of them.
        count: number of gaits N_r.
        rng: source of randomness.

    Returns:
        Pose indices, shape (N_r, L).

    Raises:
        ChainError: the sizes form no chain, or `count` is no whole number >= 0.
    """
    sizes = check_layer_sizes(layer_sizes)
    _check_count(count)
    return rng.integers(np.array(sizes), size=(count, len(sizes)), dtype=np.int64)


def check_layer_sizes(layer_sizes: Sequence[int]) -> tuple[int, ...]:
    """Return the sizes as a tuple, or raise ChainError if they cannot form a chain."""
    sizes = tuple(int(size) for size in layer_sizes)
    if len(sizes) < 2 or min(sizes) < 1:
        raise ChainError(f"layer sizes {sizes}: need two or more layers of >= 1 node")
    return sizes


def check_gaits(layer_sizes: Sequence[int], gaits: IntArray) -> IntArray:
    """Return the gaits as int64 (..., L), or raise ChainError for an invalid index."""
    indices, length = np.asarray(gaits), len(layer_sizes)
    if indices.shape[-1:] != (length,) or not np.issubdtype(indices.dtype, np.integer):
        raise ChainError(
            f"sequences of shape {indices.shape} and type {indices.dtype}: "
            f"need integers of shape (..., {length})"
        )
    for layer, size in enumerate(layer_sizes):
        column = indices[..., layer]
        if column.size and (column.min() < 0 or column.max() >= size):
            worst = column[(column < 0) | (column >= size)].flat[0]
            raise ChainError(f"node {worst} of layer {layer + 1}: need 0..{size - 1}")
    return indices.astype(np.int64, copy=False)


def members_by_row(source: IntArray, rows: int) -> Iterator[tuple[int, IntArray]]:
    """Yield each row that occurs in `source`, with its positions there, rising."""
    order = np.argsort(source, kind="stable")
    ends = np.cumsum(np.bincount(source, minlength=rows))
    for row, members in enumerate(np.split(order, ends[:-1])):
        if members.size:
            yield row, members


def freeze(values: NDArray[_Number]) -> NDArray[_Number]:
    """Return a read-only copy of an array."""
    copy = np.array(values)
    copy.setflags(write=False)
    return copy


def matrix_sizes(matrices: Sequence[FloatArray]) -> tuple[int, ...]:
    """Return the L layer sizes of L - 1 chained matrices, or raise ChainError."""
    shapes = [np.shape(matrix) for matrix in matrices]
    if not shapes or any(len(s) != 2 or math.prod(s) == 0 for s in shapes):
        raise ChainError(f"shapes {shapes}: need one or more 2-D, non-empty matrices")
    for layer, (left, right) in enumerate(pairwise(shapes)):
        if left[1] != right[0]:
            raise ChainError(
                f"layer {layer + 2} has {left[1]} nodes as a target but {right[0]} as "
                "a source; both must be equal"
            )
    return (shapes[0][0], *(shape[1] for shape in shapes))


def _check_count(count: object) -> None:
    whole = isinstance(count, Integral) and not isinstance(count, bool)
    if not (whole and cast(int, count) >= 0):
        raise ChainError(f"count={count!r}: need a whole number of them, 0 or more")


def _check_rows(layer: int, matrix: FloatArray) -> None:
    if not np.all(np.isfinite(matrix)) or matrix.min() < 0.0:
        bad = matrix[~(np.isfinite(matrix) & (matrix >= 0.0))].flat[0]
        raise ChainError(f"layer {layer + 1} has a probability of {bad}: need >= 0")
    sums = matrix.sum(axis=1)
    row = int(np.argmax(np.abs(sums - 1.0)))
    if abs(sums[row] - 1.0) > ROW_SUM_TOLERANCE:
        raise ChainError(
            f"layer {layer + 1}, row {row} sums to {sums[row]:.12g}; a row of "
            f"conditional probabilities sums to 1 within {ROW_SUM_TOLERANCE:g}"
        )
