"""Gauss-Newton steps by slopes of another, smoother robot, which are kept. Ours.

Play and friction make a replay rough: on which side of its play a gear rests, and
whether a sole sticks, changes with any number, so that slopes of the robot itself lead
nowhere far from where it is explained. A robot without either bears the same weight
with the same stiffness. Its slopes J are smooth, and nearly the same far around, so
that they are taken once, number by number, and kept for the steps that follow, as in
the chord method [Kelley95]. With residuals r(p) of the robot itself,

    p' = p - a (J^T W J + B^-1)^-1 (J^T W r(p) + B^-1 (p - m))                     (1)

a the best of a few parts; m, B and W = diag(1 / s^2) as in `fit`. A step that makes
nothing better ends it.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from gaitchain.messages import Array

PARTS = 1.0, 0.7, 0.5, 0.3, 0.15, 0.06
"""Parts of a step that are tried."""
MOST_STEPS = 8
"""Steps with the same slopes, at most."""

Missed = Callable[[Array], Array]
"""From (M, P) numbers to (M, N, S) residuals: N rows of S sensors."""


class GaussianPrior(NamedTuple):
    """What is believed of the numbers beside the residuals."""

    mean: Array
    """(P,)."""
    precision: Array
    """(P, P), the inverse of its covariance."""
    least: Array
    """(P,) bounds."""
    most: Array
    """(P,)."""

    def cost(self, numbers: Array) -> float:
        """Return how unlikely numbers are, (p - m)^T B^-1 (p - m)."""
        off = numbers - self.mean
        return float(off @ self.precision @ off)


def slopes(ahead: Array, behind: Array, missed: Missed) -> Array:
    """Return the central differences of residuals, (N, S, P).

    Args:
        ahead: (P, P) in row i the numbers with the i-th moved up.
        behind: (P, P) the same moved down; one that moves nowhere has slopes 0.
        missed: residuals of the smooth robot; NaN where it fell, which is no slope.
    """
    up, down = np.split(missed(np.concatenate([ahead, behind])), 2)
    moved = np.diag(ahead - behind)
    still = moved == 0.0
    own = (up - down) / np.where(still, 1.0, moved)[:, None, None]
    own[still] = 0.0
    return np.moveaxis(np.nan_to_num(own, nan=0.0), 0, -1)


def follow(
    start: Array,
    slope: Array,
    prior: GaussianPrior,
    missed: Missed,
    weights: Callable[[Array], Array],
) -> Array:
    """Return where steps (1) by the same slopes lead, (P,).

    Args:
        start: (P,) numbers.
        slope: (N, S, P) by `slopes`.
        prior: what is believed.
        missed: residuals of the robot itself.
        weights: from residuals (N, S) to 1 / s of each sensor, (S,).
    """
    found, rows = start, missed(start[None])[0]
    for _ in range(MOST_STEPS):
        scale = weights(rows)
        step = _step(found, rows * scale, slope * scale[:, None], prior)
        ahead = found + np.outer(PARTS, step)
        tried = np.array([found, *np.clip(ahead, prior.least, prior.most)])
        seen = np.array([rows, *missed(tried[1:])])
        costs = np.sum((seen * scale) ** 2, axis=(1, 2))
        costs += [prior.cost(numbers) for numbers in tried]
        best = int(np.argmin(costs))
        if best == 0:
            break
        found, rows = tried[best], seen[best]
    return found


def _step(found: Array, rows: Array, slope: Array, prior: GaussianPrior) -> Array:
    """Return a whole step of (1) for weighted residuals (N, S) and slopes (N, S, P)."""
    flat = slope.reshape(-1, len(found))
    back = flat.T @ rows.ravel() + prior.precision @ (found - prior.mean)
    return np.asarray(-np.linalg.solve(flat.T @ flat + prior.precision, back))
