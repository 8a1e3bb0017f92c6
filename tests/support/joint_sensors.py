"""Sensors of joints that can be written down, and a search on them."""

import numpy as np

from gaitchain.identify.joint_search import Group, JointSearch

JOINTS, OWN = 4, 3
SIZE = JOINTS * OWN + 2  # and two numbers that no sensor tells of
GROUPS = [
    Group(np.arange(OWN * j, OWN * j + OWN), np.array([j])) for j in range(JOINTS)
]


def rough(tried, true, rows=40):
    """Residuals whose slopes mislead: a sine of each number's error on top of it."""
    off = (tried - true)[:, : JOINTS * OWN].reshape(len(tried), JOINTS, OWN)
    phases = np.linspace(0.0, 1.0, rows)[:, None, None]
    waves = np.cos(np.pi * phases * np.arange(1, OWN + 1))
    return np.sum(waves * (off + 0.12 * np.sin(8.0 * off))[:, None], axis=-1)


def searched(true, rounds, covariance, seed=0, count=96):
    search = JointSearch(np.zeros(SIZE), covariance, GROUPS)
    rng = np.random.default_rng(seed)
    for _ in range(rounds):
        tried = search.draw(count, rng)
        search.select(tried, 1e4 * np.sum(rough(tried, true) ** 2, axis=1))
    return search
