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
    counts = [np.bincount(g, minlength=w) for g, w in zip(groups, widths, strict=True)]
    mean, residual = float(values.mean()), values - values.mean()
    noise = max(float(residual.var()) / 2.0, _LEAST)
    scales = [noise / len(groups)] * len(groups)
    effects, variances = [np.zeros(w) for w in widths], [np.zeros(w) for w in widths]
    for _ in range(_SWEEPS):
        unsure = 0.0
        for i, (group, count) in enumerate(zip(groups, counts, strict=True)):
            weight = count + noise / scales[i]
            residual = residual + effects[i][group]
            effects[i] = np.bincount(group, residual, widths[i]) / weight
            residual = residual - effects[i][group]
            variances[i] = noise / weight
            square = (effects[i] ** 2 + variances[i])[count > 0].mean()
            scales[i] = max(float(square), _LEAST)
            unsure += float(count @ variances[i])
        mean, residual = mean + residual.mean(), residual - residual.mean()
        noise = max(float(residual @ residual + unsure) / residual.size, _LEAST)
    return Effects(float(mean), tuple(effects), tuple(variances), noise)
