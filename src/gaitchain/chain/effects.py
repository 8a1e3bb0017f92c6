"""Effects of groups on a cost, each as strong as the samples show. Ours.

A cost is modelled as y = mean + sum of one effect for each grouping + noise. Effects
of a grouping are normal with mean 0 and a variance of their own. Both the variances
and the noise are estimated from the samples (mean-field expectation maximisation), so
that effects which the samples do not show shrink to 0: empirical Bayes.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gaitchain.chain.layered_chain import FloatArray, IntArray

_SWEEPS = 200
_LEAST = 1e-12  # variance of an effect


class Effects(NamedTuple):
    """A fit: the mean, and normal effects of the groups."""

    mean: float
    means: tuple[FloatArray, ...]
    """For each grouping the means of its effects, (width,)."""
    variances: tuple[FloatArray, ...]
    """For each grouping the variances of its effects, (width,)."""
    noise: float
    """Variance of what no grouping explains."""

    def drawn(self, rng: np.random.Generator) -> tuple[FloatArray, ...]:
        """Draw effects as the samples leave them possible (Thompson sampling)."""
        pairs = zip(self.means, self.variances, strict=True)
        return tuple(rng.normal(mean, np.sqrt(variance)) for mean, variance in pairs)


def estimate_effects(
    groups: Sequence[IntArray], widths: Sequence[int], values: FloatArray
) -> Effects:
    """Fit the effects of several groupings at once.

    With n samples in a group and residuals r the effect is sum r / (n + s2 / v), its
    variance s2 / (n + s2 / v); v is the mean square of a grouping's effects and s2 that
    of the noise, both with the variances of what they are estimated from.

    Args:
        groups: for each grouping the group of each sample, (G,).
        widths: number of groups of each grouping.
        values: (G,) the samples.

    Returns:
        The effects.
    """
    fit = _Fit(groups, widths, values)
    for _ in range(_SWEEPS):
        fit.sweep()
    return Effects(fit.mean, tuple(fit.means), tuple(fit.variances), fit.noise)


class _Fit:
    """The estimates so far, and the residual that they leave."""

    def __init__(
        self, groups: Sequence[IntArray], widths: Sequence[int], values: FloatArray
    ) -> None:
        self._groups, self._residual = groups, values - values.mean()
        self._counts: list[FloatArray] = [
            np.bincount(group, minlength=width).astype(np.float64)
            for group, width in zip(groups, widths, strict=True)
        ]
        self.mean = float(values.mean())
        self.noise = max(float(self._residual.var()) / 2.0, _LEAST)
        self._scales = [self.noise / len(groups)] * len(groups)
        self.means: list[FloatArray] = [np.zeros(width) for width in widths]
        self.variances: list[FloatArray] = [np.zeros(width) for width in widths]

    def sweep(self) -> None:
        """Improve the effects of each grouping in turn, then mean and noise."""
        unsure = sum(self._improve(i) for i in range(len(self._groups)))
        left = float(self._residual.mean())
        self.mean, self._residual = self.mean + left, self._residual - left
        square = float(self._residual @ self._residual)
        self.noise = max((square + unsure) / self._residual.size, _LEAST)

    def _improve(self, i: int) -> float:
        """Improve one grouping; return the samples' variance that it leaves unsure."""
        group, count = self._groups[i], self._counts[i]
        weight = count + self.noise / self._scales[i]
        residual = self._residual + self.means[i][group]
        self.means[i] = np.bincount(group, residual, count.size) / weight
        self._residual = residual - self.means[i][group]
        self.variances[i] = self.noise / weight
        square = (self.means[i] ** 2 + self.variances[i])[count > 0.0].mean()
        self._scales[i] = max(float(square), _LEAST)
        return float(count @ self.variances[i])
