"""Logistic regression with normal priors; the core has no statistics library. Ours."""

import numpy as np

from gaitchain.chain.layered_chain import FloatArray

_ROUNDS, _CONVERGED = 50, 1e-8


def fit_logistic(
    features: FloatArray, happened: FloatArray, trials: FloatArray, spread: FloatArray
) -> FloatArray:
    """Fit the weights w of p = 1 / (1 + exp(-x w)) by Newton's method.

    The weights are normal with mean 0 beforehand, so that those which the samples do
    not show stay near 0, and one that nothing contradicts stays finite.

    Args:
        features: (N, F) x of each sample.
        happened: (N,) how often it happened.
        trials: (N,) how often it could have.
        spread: (F,) standard deviation of each weight beforehand.

    Returns:
        (F,) the most probable weights.
    """
    weights, precision = np.zeros(features.shape[1]), 1.0 / spread**2
    for _ in range(_ROUNDS):
        chance = logistic(features @ weights)
        slope = features.T @ (happened - trials * chance) - precision * weights
        curved = (features * (trials * chance * (1.0 - chance))[:, None]).T @ features
        step = np.linalg.solve(curved + np.diag(precision), slope)
        weights += step
        if np.abs(step).max() < _CONVERGED:
            break
    return weights


def logistic(score: FloatArray) -> FloatArray:
    """Return 1 / (1 + exp(-score))."""
    return np.asarray(1.0 / (1.0 + np.exp(-score)))
