"""Where the replays of hung legs come close to a log: joint by joint. Ours.

While the trunk is held, what a joint's encoder shows tells of its own servo first, and
of the others' little. So one round of replays, each with other numbers for all joints,
is a round for each joint: it selects those of its own numbers with which its own rows
were missed least; what servos have in common is selected by the rows of all. That is
the cross-entropy method [Rubinstein99], a few numbers at a time. It needs no slope of
what play and friction make rough.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gaitchain.messages import Array

_KEPT = 1 / 6  # of the replays
_RENEWED = 0.7  # part of the spread that a round sets anew

Indices = NDArray[np.int64]


class Group(NamedTuple):
    """Numbers that are selected together."""

    numbers: Indices
    """Which they are."""
    columns: Indices
    """The sensors whose rows tell of them."""


class Searched(NamedTuple):
    """How far a search is after a round."""

    found: Array
    """(P,) the best numbers so far."""
    spreads: list[Array]
    """Of each group the covariance from which its numbers are drawn next."""


class GroupPrior:
    """What is believed of some numbers, given all others."""

    def __init__(self, mean: Array, covariance: Array) -> None:
        """Keep it.

        Args:
            mean: (P,) of all numbers.
            covariance: (P, P).
        """
        self._mean, self._known = mean, np.linalg.inv(covariance)

    def unlikely(self, tried: Array, numbers: Indices, rest: Array) -> Array:
        """Return how little a group's numbers are believed, given the other ones, (M,).

        It is twice the negative logarithm of their density, but for a constant.

        Args:
            tried: (M, G) the group's numbers.
            numbers: (G,) which they are.
            rest: (P,) all numbers; the group's own do not count.
        """
        others = np.setdiff1d(np.arange(len(rest)), numbers)
        own = self._known[np.ix_(numbers, numbers)]
        pull = self._known[np.ix_(numbers, others)] @ (rest - self._mean)[others]
        off = tried - (self._mean[numbers] - np.linalg.solve(own, pull))
        return np.asarray(np.einsum("ij,jk,ik->i", off, own, off))


class JointSearch:
    """Numbers that are drawn, replayed and selected in rounds."""

    def __init__(self, mean: Array, covariance: Array, groups: Sequence[Group]) -> None:
        """Begin with what is believed.

        Args:
            mean: (P,) of all numbers.
            covariance: (P, P).
            groups: what is searched; other numbers stay what they are.
        """
        self.prior = GroupPrior(mean, covariance)
        self.found = mean.copy()
        """(P,) the best numbers so far."""
        self.groups, self._begun = groups, False
        self._covariance = covariance
        self._spreads = [covariance[np.ix_(g.numbers, g.numbers)] for g in groups]

    @property
    def searched(self) -> Searched:
        """How far it is."""
        return Searched(self.found, self._spreads)

    def go_on(self, searched: Searched) -> None:
        """Go on from where a round, of this search or one like it, has led."""
        self.found, self._spreads = searched
        self._begun = True

    def draw(self, count: int, rng: np.random.Generator) -> Array:
        """Draw numbers for so many replays, (count, P); the first are the best so far.

        At first they are as alike as they are believed to be.
        """
        drawn = np.tile(self.found, (count, 1))
        if not self._begun:
            numbers = np.concatenate([group.numbers for group in self.groups])
            spread = self._covariance[np.ix_(numbers, numbers)]
            drawn[:, numbers] += _normal(spread, count, rng)
        else:
            for group, spread in zip(self.groups, self._spreads, strict=True):
                drawn[:, group.numbers] += _normal(spread, count, rng)
        drawn[0] = self.found
        return drawn

    def select(self, tried: Array, missed: Array) -> None:
        """Move each group to where the best replays had it.

        Args:
            tried: (M, P) numbers.
            missed: (M, S) squared residuals of each sensor, over their variance.
        """
        kept = max(round(_KEPT * len(tried)), 2)
        worth = np.log(kept + 0.5) - np.log(np.arange(1, kept + 1))
        worth /= worth.sum()
        before, self._begun = self.found.copy(), True
        for at, (numbers, columns) in enumerate(self.groups):
            cost = missed[:, columns].sum(axis=1)
            cost += self.prior.unlikely(tried[:, numbers], numbers, before)
            best = tried[np.argsort(cost, kind="stable")[:kept]][:, numbers]
            self.found[numbers] = worth @ best
            off = best - self.found[numbers]
            spread = (worth[:, None] * off).T @ off
            self._spreads[at] = _RENEWED * spread + (1.0 - _RENEWED) * self._spreads[at]


def _normal(covariance: Array, count: int, rng: np.random.Generator) -> Array:
    return rng.multivariate_normal(np.zeros(len(covariance)), covariance, count)
