"""Falls by the step that the robot was in: each edge of the chain is a stratum. Ours.

A walk has N_i visits to an edge and Y_i = 0 or 1 falls in it, so that the edge has a
rate of its own, with the interval of `rate_test`. All edges' intervals hold together:
with E edges, each of the 2 E ends is wrong with a probability of at most a / 2 E
(Bonferroni).
"""

from collections import Counter
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gaitchain.gait.qualification import StepStrata, StepStratum
from gaitchain.proof.rate_test import rate_interval

SELDOM = 10
"""Visits below which a step was hardly walked."""
_Edge = tuple[int, int]


class StepTally:
    """Counts of visits and falls; its memory does not grow with the walks."""

    def __init__(self, allowed: NDArray[np.bool_]) -> None:
        """Begin without a walk.

        Args:
            allowed: (N_1, N_4) steps that the robot may make.
        """
        self._allowed: list[_Edge] = [(a, b) for a, b in np.argwhere(allowed).tolist()]
        self._walks: dict[_Edge, Counter[tuple[int, bool]]] = {}

    def add(self, steps: Sequence[_Edge], *, fell: bool) -> None:
        """Count a walk's steps; a fall is in the last one of them."""
        visits = Counter((first, last) for first, last in steps)
        for edge, times in visits.items():
            here = fell and edge == tuple(steps[-1])
            self._walks.setdefault(edge, Counter())[times, here] += 1

    def report(self, longest: int, confidence: float) -> StepStrata:
        """Return what is known of the steps.

        Args:
            longest: most steps of a walk.
            confidence: of all intervals together.
        """
        edges = sorted({*self._allowed, *self._walks})
        each = 1.0 - (1.0 - confidence) / max(2 * len(edges), 1)
        found = [self._stratum(edge, longest, each) for edge in edges]
        walked = [s for s in found if s.walked]
        highs = [s.high for s in walked]
        return StepStrata(
            allowed=len(self._allowed),
            walked=len(walked),
            never=tuple((s.first, s.last) for s in found if not s.walked),
            seldom=tuple(s for s in walked if s.walked < SELDOM),
            fell_on=tuple(s for s in walked if s.falls),
            high=tuple(np.quantile(highs, [0.0, 0.5, 1.0]).tolist()) if highs else (),
        )

    def _stratum(self, edge: _Edge, longest: int, confidence: float) -> StepStratum:
        kinds = self._walks.get(edge, Counter())
        walks = [(times, fell, n) for (times, fell), n in kinds.items()]
        visits = sum(times * n for times, _, n in walks)
        falls = sum(n for _, fell, n in walks if fell)
        low, high = rate_interval(walks, longest, confidence)
        return StepStratum(*edge, visits, falls, low, high)
