"""The chain as an estimator in the manner of scikit-learn: fit, sample, score."""

from collections.abc import Sequence
from inspect import signature
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from gaitchain.chain.expectation import path_costs
from gaitchain.chain.layered_chain import FloatArray, IntArray, LayeredChain
from gaitchain.chain.policy import look_ahead
from gaitchain.chain.training import train_batch
from gaitchain.errors import ChainError, NotFittedError

Seed = int | np.random.Generator | None


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
        costs = np.zeros(len(paths)) if y is None else np.asarray(y, np.float64)
        sizes = self._sizes(paths)
        chain = train_batch(sizes, paths, costs, self.prior, cyclic=False)
        edges = path_costs(sizes, paths, costs, self.shrink)
        first = np.full(sizes[0], self.prior / sizes[0])
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
            ChainError: `n_samples` is below 1.
        """
        chain = self._fitted()
        if n_samples < 1:
            raise ChainError(f"n_samples={n_samples}: draw 1 or more")
        seed = self.random_state if random_state is None else random_state
        rng = np.random.default_rng(seed)
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
        chain = self._fitted()
        return np.asarray(np.log(chain.gait_probability(_integers(X), self.startprob_)))

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

        Args:
            start: its first node; by default the best one.
            end: its last node; by default the best one.

        Raises:
            NotFittedError: before `fit`.
            ChainError: a node does not exist.
        """
        self._fitted()
        starts = np.arange(self.layer_sizes_[0]) if start is None else [start]
        paths = look_ahead(self.edge_costs_, starts, None if end is None else [end])
        return np.asarray(paths[np.argmin(self.expected_cost(paths))])

    def expected_cost(self, X: ArrayLike) -> FloatArray:
        """Return the expected cost of each sequence, (G,).

        Args:
            X: (G, L) sequences.

        Raises:
            NotFittedError: before `fit`.
            ChainError: a node does not exist.
        """
        chain = self._fitted()
        paths = _integers(X)
        chain.gait_probability(paths)  # refuses nodes that do not exist
        found = np.zeros(len(paths))
        for layer, costs in enumerate(self.edge_costs_):
            found += costs[paths[:, layer], paths[:, layer + 1]]
        return found

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """Return the hyper-parameters; `deep` is for tools that pass it."""
        return {name: getattr(self, name) for name in signature(type(self)).parameters}

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

    def __repr__(self) -> str:
        given = ", ".join(f"{n}={v!r}" for n, v in self.get_params().items())
        return f"{type(self).__name__}({given})"

    def _sizes(self, paths: IntArray) -> tuple[int, ...]:
        if self.layer_sizes is not None:
            return tuple(self.layer_sizes)
        return tuple((paths.max(axis=0) + 1).tolist())

    def _fitted(self) -> LayeredChain:
        if not hasattr(self, "chain_"):
            raise NotFittedError("the chain has not learned yet: call fit first")
        return self.chain_


def _integers(paths: ArrayLike) -> IntArray:
    """Return sequences as (G, L) integers.

    Raises:
        ChainError: they are something else.
    """
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
    return given.astype(np.int64, copy=False)
