"""Where replays come closest to a log: from near on, by groups of numbers. Ours.

What a joint's rows tell of its numbers is long and narrow: a servo that is softer and
has less friction moves nearly alike. A search that narrows its spread in each round
ends on the way. So each group of numbers has a CMA-ES of its own [Hansen01], which
keeps going where steps of before led, and all of them are replayed together. Of a
stand, whose rows tell of all numbers at once, one group does.
"""

from typing import Any

import numpy as np

from gaitchain.identify.joint_search import Group, JointSearch
from gaitchain.messages import Array

_LEAST_PART = 1e-6  # added to a spread of 1: what was selected may lie in a plane


class JointClimb:
    """Numbers that are drawn, replayed and told apart in generations."""

    def __init__(
        self, search: JointSearch, bounds: Array, count: int, seed: int
    ) -> None:
        """Begin where a search has led.

        Args:
            search: of the same numbers.
            bounds: (P, 2) least and most of each.
            count: replays in a generation.
            seed: of the draws.
        """
        self._prior, self._groups, self._count = search.prior, search.groups, count
        found, spreads = search.searched
        self._found = np.clip(found, *bounds.T)
        seeds = np.random.default_rng(seed).integers(2**31, size=len(spreads))
        self._climbers = [
            self._climber(group, spread, bounds[group.numbers], int(own))
            for group, spread, own in zip(self._groups, spreads, seeds, strict=True)
        ]

    def _climber(self, group: Group, spread: Array, bounds: Array, seed: int) -> Any:
        from cmaes import CMA  # noqa: PLC0415 - slow, brings scipy.stats

        size = len(spread)
        sigma = float(np.sqrt(np.trace(spread) / size))
        return CMA(
            mean=self._found[group.numbers],
            sigma=sigma,
            cov=spread / sigma**2 + _LEAST_PART * np.eye(size),
            bounds=bounds,
            population_size=self._count,
            seed=seed,
        )

    @property
    def found(self) -> Array:
        """(P,) the best numbers so far."""
        return self._found.copy()

    def ask(self) -> Array:
        """Draw numbers for the replays of a generation, (count, P)."""
        drawn = np.tile(self._found, (self._count, 1))
        for group, climber in zip(self._groups, self._climbers, strict=True):
            drawn[:, group.numbers] = [climber.ask() for _ in drawn]
        return drawn

    def tell(self, tried: Array, missed: Array) -> None:
        """Move each group to where the better replays had it.

        Args:
            tried: (count, P) numbers that were asked for.
            missed: (count, S) squared residuals of each sensor, over their variance.
        """
        before = self.found
        for group, climber in zip(self._groups, self._climbers, strict=True):
            own = tried[:, group.numbers]
            cost = missed[:, group.columns].sum(axis=1)
            cost += self._prior.unlikely(own, group.numbers, before)
            climber.tell([*zip(own, cost.tolist(), strict=True)])
            self._found[group.numbers] = climber.mean
