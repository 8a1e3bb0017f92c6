"""Logistic regression with normal priors; the core has no statistics library. Ours."""

from typing import NamedTuple

import numpy as np

from gaitchain.chain.layered_chain import FloatArray

_ROUNDS, _CONVERGED = 50, 1e-8


class Fitted(NamedTuple):
    """Weights, and how well they are known."""

    weights: FloatArray
    """(F,) the most probable ones."""
    covariance: FloatArray
    """(F, F) by Laplace's approximation: the inverse curvature there."""

    def error_of_chance(self, feature: FloatArray) -> float:
        """Return the standard error of the chance of a sample, (F,)."""
        chance = float(logistic(feature @ self.weights))
        spread = float(np.sqrt(feature @ self.covariance @ feature))
        return chance * (1.0 - chance) * spread

    def drawn(self, count: int, rng: np.random.Generator) -> FloatArray:
        """Draw weights from what the samples leave possible, (count, F)."""
        return rng.multivariate_normal(self.weights, self.covariance, count)


def fit_logistic(
    features: FloatArray, happened: FloatArray, trials: FloatArray, spread: FloatArray
) -> Fitted:
    """Fit the weights w of p = 1 / (1 + exp(-x w)) by Newton's method.

    The weights are normal with mean 0 beforehand, so that those which the samples do
    not show stay near 0, and one that nothing contradicts stays finite.

    Args:
        features: (N, F) x of each sample.
        happened: (N,) how often it happened.
        trials: (N,) how often it could have.
        spread: (F,) standard deviation of each weight beforehand.

    Returns:
        The weights and their covariance.
    """
    weights, precision = np.zeros(features.shape[1]), 1.0 / spread**2
    for _ in range(_ROUNDS):
        chance = logistic(features @ weights)
        slope = features.T @ (happened - trials * chance) - precision * weights
        weight = (trials * chance * (1.0 - chance))[:, None]
        curved = (features * weight).T @ features + np.diag(precision)
        step = np.linalg.solve(curved, slope)
        weights += step
        if np.abs(step).max() < _CONVERGED:
            break
    return Fitted(weights, np.asarray(np.linalg.inv(curved), dtype=float))


def logistic(score: FloatArray) -> FloatArray:
    """Return 1 / (1 + exp(-score))."""
    return np.asarray(1.0 / (1.0 + np.exp(-score)))
