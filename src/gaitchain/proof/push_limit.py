"""The pushes that fell half, and one in twenty, of the walks, from each side. Ours.

The critical impulses J of a side, one for each walk, are taken for log-normal. With
mean m and deviation s of their n logarithms, the quantile q_p of the logarithms is in

    m - t s / sqrt(n),    t of the noncentral t law, n - 1, -z_p sqrt(n)            (1)

which holds exactly for any n >= 2 if the logarithms are normal. Without a law of J
nothing could be said of one in twenty by fewer than 59 walks. A walk that falls without
a push has no J and tells nothing of pushes: it is counted, and left out of the law.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from gaitchain.build.push import MOST, RESOLUTION, PushTest

HALF, FEW = 0.5, 0.05
"""Parts of the walks that fall."""
_FEWEST = 2  # walks that have a spread


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
    fell_alone: int
    """Walks that fell without a push."""
    j50: Impulse | None
    """Half of the other walks fall; None if there are fewer than two."""
    j5: Impulse | None
    """One in twenty of them falls."""
    critical_ns: tuple[float, ...]
    """Of each walk, 0 if it fell without a push [N s]."""
    withstood: int
    """Walks that withstood the hardest push; that one is taken for theirs."""


def push_limits(
    tests: Sequence[PushTest], scale_ns: float, confidence: float = 0.95
) -> tuple[PushLimit, ...]:
    """Fit the critical impulses of each side, in the order of the sides.

    Args:
        tests: two or more walks of each side.
        scale_ns: m sqrt(g h) of the robot, see `push.impulse_unit_ns` [N s].
        confidence: of each interval for itself, with equal parts at its ends.
    """
    limits = []
    for side in dict.fromkeys(test.direction_deg for test in tests):
        found = tuple(t.critical_ns for t in tests if t.direction_deg == side)
        parts = np.array(found) / scale_ns
        alone = sum(impulse == 0.0 for impulse in found)
        most = sum(impulse >= MOST * scale_ns for impulse in found)
        logs = np.log(parts[parts > 0.0])
        j50, j5 = (
            log_normal_quantile(logs, p, confidence).times(scale_ns)
            if len(logs) >= _FEWEST
            else None
            for p in (HALF, FEW)
        )
        limits.append(PushLimit(side, len(found), alone, j50, j5, found, most))
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
    z, root = float(scipy.stats.norm.ppf(part)), math.sqrt(count)
    ends = 0.5 - 0.5 * confidence, 0.5 + 0.5 * confidence
    high, low = (
        mean - float(scipy.stats.nct.ppf(end, count - 1, -z * root)) * spread / root
        for end in ends
    )
    return Impulse(*(math.exp(x) for x in (mean + z * spread, low, high)))
