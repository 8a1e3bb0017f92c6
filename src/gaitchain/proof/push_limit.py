"""The pushes that fell half, and one in twenty, of the walks, from each side. Ours.

The critical impulses J of a side, one for each walk, are taken for log-normal. With
mean m and deviation s of their n logarithms, the quantile q_p of the logarithms is in

    m - t s / sqrt(n),    t of the noncentral t law, n - 1, -z_p sqrt(n)            (1)

which holds exactly for any n >= 2 if the logarithms are normal. Without a law of J
nothing could be said of one in twenty by fewer than 59 walks.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import nct, norm

from gaitchain.build.push import MOST, RESOLUTION, PushTest

HALF, FEW = 0.5, 0.05
"""Parts of the walks that fall."""


@dataclass(frozen=True)
class Impulse:
    """An impulse after which a part of the walks falls, and where it may be [N s]."""

    ns: float
    low: float
    high: float

    def times(self, scale: float) -> "Impulse":
        """Return the same in another unit."""
        return Impulse(scale * self.ns, scale * self.low, scale * self.high)


@dataclass(frozen=True)
class PushLimit:
    """What walks withstood of pushes from one side."""

    direction_deg: float
    """Of the push, relative to the trunk: 0 forward, +90 to the left [deg]."""
    walks: int
    j50: Impulse
    """Half of the walks fall."""
    j5: Impulse
    """One in twenty falls."""
    critical_ns: tuple[float, ...]
    """Of each walk [N s]."""
    withstood: int
    """Walks that withstood the hardest push; that one is taken for theirs."""


def push_limits(
    tests: Sequence[PushTest], scale_ns: float, confidence: float = 0.95
) -> tuple[PushLimit, ...]:
    """Fit the critical impulses of each side, in the order of the sides.

    Args:
        tests: two or more walks of each side.
        scale_ns: m sqrt(g h) of the robot, see `push.impulse_scale` [N s].
        confidence: of each interval for itself, with equal parts at its ends.
    """
    limits = []
    for side in dict.fromkeys(test.direction_deg for test in tests):
        found = tuple(t.critical_ns for t in tests if t.direction_deg == side)
        parts = np.array(found) / scale_ns
        # Who falls without a push has no logarithm; the resolution hides it.
        logs = np.log(np.maximum(parts, 0.5 * RESOLUTION))
        j50, j5 = (
            log_normal_quantile(logs, p, confidence).times(scale_ns)
            for p in (HALF, FEW)
        )
        most = int(np.sum(parts > MOST - RESOLUTION))
        limits.append(PushLimit(side, len(found), j50, j5, found, most))
    return tuple(limits)


def log_normal_quantile(logs: np.ndarray, part: float, confidence: float) -> Impulse:
    """Return a quantile of what has these logarithms, with its interval by (1).

    Args:
        logs: (n,) logarithms of impulses over m sqrt(g h), n >= 2.
        part: of the quantile, 0 to 1.
        confidence: of the interval.
    """
    count, mean = len(logs), float(np.mean(logs))
    # Bisection ends at a resolution, so that walks may seem to be all alike.
    least = RESOLUTION / math.sqrt(12.0) * math.exp(-mean)
    spread = max(float(np.std(logs, ddof=1)), least)
    z, root = float(norm.ppf(part)), math.sqrt(count)
    ends = 0.5 - 0.5 * confidence, 0.5 + 0.5 * confidence
    high, low = (
        mean - float(nct.ppf(end, count - 1, -z * root)) * spread / root for end in ends
    )
    return Impulse(*(math.exp(x) for x in (mean + z * spread, low, high)))
