"""The chain as an estimator in the manner of scikit-learn: fit, sample, score."""

import math
from collections.abc import Sequence
from inspect import Parameter, signature
from itertools import pairwise
from numbers import Integral, Real
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from gaitchain.chain.expectation import path_costs
from gaitchain.chain.layered_chain import (
    FloatArray,
    IntArray,
    LayeredChain,
    check_gaits,
    check_layer_sizes,
)
from gaitchain.chain.policy import check_nodes, cost_to_go, forbid, look_ahead
from gaitchain.chain.training import train_batch
from gaitchain.errors import ChainError, NotFittedError

Seed = int | np.random.Generator | None
_MOST_NODE = 2**63 - 1  # that an index can be
_MOST_EDGES = 50_000_000  # of all layers: 400 MB for each number of an edge
_MOST_DRAWN = 100_000_000
_SAME_COST = 1e-9  # an edge's, but for the rounding of sums


class LayeredChainModel:
    """A Markov chain of layers that learns from sequences and what each of them cost.

    A sequence visits one node of each of L layers in turn. `fit` learns

        P[k, l] ~ prior / N_l + sum over the sequences through k, l of (1 - cost),

    and costs of the edges whose sum is the expected cost of a sequence. Learned state
    has a trailing underscore: `chain_`, the transition matrices `transmat_`, the
    probabilities of the first node `startprob_`, the edges' costs `edge_costs_`, and
    `layer_sizes_`.
    """

    chain_: LayeredChain
    transmat_: tuple[FloatArray, ...]
    startprob_: FloatArray
    edge_costs_: tuple[FloatArray, ...]
    layer_sizes_: tuple[int, ...]

    def __init__(
        self,
        layer_sizes: Sequence[int] | None = None,
        *,
        prior: float = 1.0,
        shrink: float | None = None,
        random_state: Seed = None,
    ) -> None:
        """Store the hyper-parameters; `fit` checks them.

        Args:
            layer_sizes: nodes of each layer; None takes those that the data have.
            prior: weight of equal probabilities in each row, in sequences of cost 0.
            shrink: weight of no effect in the costs, in sequences; None estimates it
                for each layer from the data.
            random_state: seed of `sample`, or a generator.
        """
        self.layer_sizes = layer_sizes
        self.prior = prior
        self.shrink = shrink
        self.random_state = random_state

    def fit(self, X: ArrayLike, y: ArrayLike | None = None) -> Self:
        """Learn from sequences.

        Args:
            X: (G, L) node of each layer, from 0.
            y: (G,) cost of each sequence in [0, 1]; 0 for all by default.

        Returns:
            The model itself.

        Raises:
            ChainError: a node, a cost or a hyper-parameter cannot be.
        """
        paths = _integers(X)
        costs = np.zeros(len(paths)) if y is None else _costs(y)
        prior, sizes = _weight("prior", self.prior), self._sizes(paths)
        shrink = None if self.shrink is None else _weight("shrink", self.shrink)
        _generator(self.random_state)  # which only `sample` needs
        chain = train_batch(sizes, paths, costs, prior, cyclic=False)
        edges = path_costs(sizes, paths, costs, shrink)
        first = np.full(sizes[0], prior / sizes[0])
        first += np.bincount(paths[:, 0], 1.0 - costs, sizes[0])
        self.chain_, self.transmat_ = chain, chain.transitions
        self.startprob_, self.edge_costs_ = first / first.sum(), edges
        self.layer_sizes_ = sizes
        return self

    def sample(self, n_samples: int = 1, random_state: Seed = None) -> IntArray:
        """Draw sequences, (n_samples, L).

        Args:
            n_samples: how many.
            random_state: in place of the model's own.

        Raises:
            NotFittedError: before `fit`.
            ChainError: `n_samples` is no whole number from 1 to 100 million, or the
                seed cannot be one.
        """
        chain = self._fitted()
        if not (_is_whole(n_samples) and 1 <= n_samples <= _MOST_DRAWN):
            raise ChainError(
                f"n_samples={n_samples!r}: draw 1 or more, a whole number up to "
                f"{_MOST_DRAWN}"
            )
        rng = _generator(self.random_state if random_state is None else random_state)
        first = rng.choice(len(self.startprob_), n_samples, p=self.startprob_)
        return chain.sample(rng, n_samples, first)

    def score_samples(self, X: ArrayLike) -> FloatArray:
        """Return the log-likelihood of each sequence, (G,).

        Args:
            X: (G, L) sequences.

        Raises:
            NotFittedError: before `fit`.
            ChainError: a node does not exist.
        """
        paths = self._paths(X)
        # A sum, as the product of hundreds of layers is too small for a number.
        found = np.log(self.startprob_)[paths[:, 0]]
        for layer, matrix in enumerate(self.transmat_):
            found += np.log(matrix[paths[:, layer], paths[:, layer + 1]])
        return found

    def score(self, X: ArrayLike, y: ArrayLike | None = None) -> float:
        """Return the mean log-likelihood of sequences; larger is better.

        Args:
            X: (G, L) sequences.
            y: ignored, for tools that pass it.

        Raises:
            NotFittedError: before `fit`.
            ChainError: a node does not exist.
        """
        return float(self.score_samples(X).mean())

    def best_path(self, start: int | None = None, end: int | None = None) -> IntArray:
        """Return the sequence of least expected cost, (L,).

        Of those that cost the same it is the likeliest: after `fit` without costs the
        most likely of all.

        Args:
            start: its first node; by default the best one.
            end: its last node; by default the best one.

        Raises:
            NotFittedError: before `fit`.
            ChainError: a node does not exist.
        """
        self._fitted()
        first, last = self.layer_sizes_[0], self.layer_sizes_[-1]
        starts = _chosen("start", start, first)
        ends = np.full(last, np.inf)
        ends[_chosen("end", end, last)] = 0.0
        values = cost_to_go(self.edge_costs_, ends)
        reached = values[0][starts]
        cheapest = starts[reached <= reached.min() + _SAME_COST]
        paths = look_ahead(self._unlikely(values), cheapest)
        return np.asarray(paths[np.argmax(self.score_samples(paths))])

    def expected_cost(self, X: ArrayLike) -> FloatArray:
        """Return the expected cost of each sequence, (G,).

        Args:
            X: (G, L) sequences.

        Raises:
            NotFittedError: before `fit`.
            ChainError: a node does not exist.
        """
        paths = self._paths(X)
        found = np.zeros(len(paths))
        for layer, costs in enumerate(self.edge_costs_):
            found += costs[paths[:, layer], paths[:, layer + 1]]
        return found

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """Return the hyper-parameters; `deep` is for tools that pass it.

        Those that a subclass takes by any other keyword are not among them.

        Raises:
            ChainError: a subclass takes some by place alone, which have no name.
        """
        known = signature(type(self)).parameters.values()
        if many := [p.name for p in known if p.kind is Parameter.VAR_POSITIONAL]:
            raise ChainError(
                f"{type(self).__name__}(*{many[0]}): hyper-parameters need names; "
                "declare each in the constructor"
            )
        names = [p.name for p in known if p.kind is not Parameter.VAR_KEYWORD]
        return {name: getattr(self, name) for name in names}

    def set_params(self, **params: Any) -> Self:
        """Set hyper-parameters, and return the model.

        Raises:
            ChainError: there is no such one.
        """
        known = self.get_params()
        for name, value in params.items():
            if name not in known:
                raise ChainError(f"{name}: no hyper-parameter; there are {[*known]}")
            setattr(self, name, value)
        return self

    def __sklearn_tags__(self) -> Any:
        """Tell scikit-learn what the model is: no classifier, and it needs no costs."""
        # Imported here, as only scikit-learn asks, and the chain works without it.
        from sklearn.utils import InputTags, Tags, TargetTags  # noqa: PLC0415

        wanted = TargetTags(required=False)
        return Tags(estimator_type=None, target_tags=wanted, input_tags=InputTags())

    def __repr__(self) -> str:
        given = ", ".join(f"{n}={v!r}" for n, v in self.get_params().items())
        return f"{type(self).__name__}({given})"

    def _unlikely(self, values: Sequence[FloatArray]) -> tuple[FloatArray, ...]:
        """Return -log of each edge's probability, +inf off the cheapest paths.

        Args:
            values: the costs to go from all nodes.
        """
        layers = zip(self.edge_costs_, values[:-1], values[1:], strict=True)
        allowed = [
            costs + there <= here[:, np.newaxis] + _SAME_COST
            for costs, here, there in layers
        ]
        return forbid([-np.log(matrix) for matrix in self.transmat_], allowed)

    def _sizes(self, paths: IntArray) -> tuple[int, ...]:
        """Return the nodes of each layer, as given or as the data have them."""
        if self.layer_sizes is not None:
            sizes = check_layer_sizes(_whole_numbers(self.layer_sizes))
        else:
            sizes = check_layer_sizes([n + 1 for n in paths.max(axis=0).tolist()])
        edges = sum(here * there for here, there in pairwise(sizes))
        if edges > _MOST_EDGES:
            raise ChainError(
                f"layers of up to {max(sizes)} nodes have {edges} edges, at most "
                f"{_MOST_EDGES}: number the nodes from 0 on without gaps"
            )
        return sizes

    def _paths(self, given: ArrayLike) -> IntArray:
        """Return sequences (G, L) of nodes that the fitted chain has."""
        return check_gaits(self._fitted().layer_sizes, _integers(given))

    def _fitted(self) -> LayeredChain:
        if not hasattr(self, "chain_"):
            raise NotFittedError("the chain has not learned yet: call fit first")
        return self.chain_


def _integers(paths: ArrayLike) -> IntArray:
    """Return sequences as (G, L) integers.

    Raises:
        ChainError: they are something else.
    """
    if _any_masked(paths):
        raise ChainError("sequences with masked nodes: give all L nodes of each")
    try:
        given = np.asarray(paths)
    except ValueError:
        raise ChainError("sequences of different lengths: give all L nodes") from None
    if (
        given.ndim != 2
        or 0 in given.shape
        or not np.issubdtype(given.dtype, np.integer)
    ):
        raise ChainError(
            f"sequences of shape {given.shape} and type {given.dtype}: need one or "
            "more rows of integers (G, L)"
        )
    if given.min() < 0:
        raise ChainError(f"node {given.min()}: nodes are numbered from 0")
    if given.max() > _MOST_NODE:
        raise ChainError(f"node {given.max()}: nodes go up to {_MOST_NODE}")
    return given.astype(np.int64, copy=False)


def _costs(given: ArrayLike) -> FloatArray:
    """Return costs as numbers; `check_samples` sees to their shape and limits.

    Raises:
        ChainError: they are no numbers, or some are masked.
    """
    try:
        if _any_masked(given):
            raise ValueError("some are masked")
        costs = np.asarray(given)
        if costs.dtype.kind in "biufO":  # objects may be numbers, such as fractions
            return costs.astype(np.float64)
        why = f"type {costs.dtype}"
    except (TypeError, ValueError, OverflowError) as error:
        why = str(error)
    raise ChainError(f"costs y ({why}): need (G,) numbers from 0 to 1")


def _any_masked(given: ArrayLike) -> bool:
    """Return whether an array, or one of a list, has masked numbers."""
    arrays = given if isinstance(given, list | tuple) else [given]
    return any(map(np.ma.is_masked, arrays))


def _chosen(name: str, node: int | None, size: int) -> IntArray:
    """Return the given node of a layer, or all of them, as indices."""
    if node is None:
        return np.arange(size)
    return np.atleast_1d(check_nodes(name, node, size))


def _weight(name: str, value: object) -> float:
    """Return a hyper-parameter as a number; those who use it see to its limits.

    Raises:
        ChainError: it is none.
    """
    if isinstance(value, Real) and not isinstance(value, bool):
        try:
            return float(value)
        except OverflowError:
            return math.inf
    raise ChainError(f"{name}={value!r}: need a finite weight, such as 1.0")


def _whole_numbers(sizes: Sequence[int]) -> Sequence[int]:
    """Return the sizes of layers; `check_layer_sizes` sees to their limits.

    Raises:
        ChainError: they are no whole numbers.
    """
    try:
        if all(map(_is_whole, given := tuple(sizes))):
            return given
    except TypeError:
        pass  # one number, say
    raise ChainError(
        f"layer_sizes={sizes!r}: need a whole number for each layer, such as (3, 4)"
    )


def _is_whole(value: object) -> bool:
    return isinstance(value, Integral) and not isinstance(value, bool)


def _generator(seed: Seed) -> np.random.Generator:
    """Return the generator of a seed.

    Raises:
        ChainError: it cannot be a seed.
    """
    try:
        return np.random.default_rng(seed)
    except (TypeError, ValueError):
        raise ChainError(
            f"random_state={seed!r}: need a whole number from 0 on, a Generator or None"
        ) from None
