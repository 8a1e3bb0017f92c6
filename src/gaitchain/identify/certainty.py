"""How well replays tell numbers: by their slopes, less the noise of those. Ours.

Replays with numbers d above and below what was found differ by twice J d + e, where e
is what play, friction and contacts make rough. Slopes K of a regression over M of such
pairs have errors of their own, so that K^T K says more than there is. In expectation

    E(K^T K) = J^T J + N,   N = sum_i var(e_i) (D^T D)^-1                          (1)

over all rows i, D (M, P) the numbers, var(e_i) by what the regression leaves. Without
N, numbers that no row tells seem to be known, the better the rougher the rows are.
"""

import numpy as np

from gaitchain.messages import Array

ALIKE = 0.01
"""Numbers that differ by less in a round's replays share their slope."""


def fisher_information(moved: Array, rows: Array) -> Array:
    """Return J^T J of (1), (P, P), which may have negative directions by chance.

    Args:
        moved: (M, P) half of what numbers differ by in pairs of opposite replays.
        rows: (M, R) half of what their rows differ by, in deviations of each row.

    Returns:
        (P, P); nothing where as few pairs as slopes leave no roughness to be seen.
    """
    size = np.maximum(np.linalg.norm(moved, axis=0), 1e-12)
    left, lengths, right = np.linalg.svd(moved / size, full_matrices=False)
    seen = lengths > ALIKE * lengths.max(initial=0.0)
    inverse = (right[seen].T / lengths[seen]) @ left[:, seen].T / size[:, None]
    slopes = inverse @ rows
    free = len(moved) - int(seen.sum())
    if free <= 0:
        return np.zeros((len(size), len(size)))
    rough = np.sum((rows - moved @ slopes) ** 2)
    noise = rough / free * inverse @ inverse.T
    return np.asarray(slopes @ slopes.T - noise)


def posterior_covariance(covariance: Array, told: Array) -> Array:
    """Return the covariance of what was believed, and of what rows tell.

    Args:
        covariance: (P, P) before.
        told: (P, P) by `fisher_information`; directions that are told less than nothing
            are as before.
    """
    factor = np.linalg.cholesky(covariance)
    gained, directions = np.linalg.eigh(factor.T @ told @ factor)
    axes = factor @ directions
    return np.asarray((axes / (1.0 + np.maximum(gained, 0.0))) @ axes.T)
