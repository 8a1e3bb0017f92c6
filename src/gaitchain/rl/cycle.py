"""The mean cycle of two steps of a motion, as polynomials in the phase."""

from typing import NamedTuple

import numpy as np

from gaitchain.errors import CommandError
from gaitchain.messages import Array
from gaitchain.rl.frames import Motion

DEGREES = tuple(range(5, 16))
"""Degrees that are tried."""
_SLACK = 1e-9  # cycles: a period is a sum of times, rounded


class Cycle(NamedTuple):
    """One mean cycle of a motion at N evenly spaced phases, from 0 to below 1."""

    joints: Array
    """(N, n) [rad]"""
    rates: Array
    """(N, n) [rad/s]"""
    contact: Array
    """(N, 2) part of the cycles in which the left, the right foot is in contact."""
    velocity: Array
    """(N, 3) of the base in the frame of its heading [m/s]"""
    turn: Array
    """(N, 3) angular velocity of the base in its own frame [rad/s]"""

    @property
    def rows(self) -> Array:
        """All of it, (N, 2 n + 8), in this order."""
        return np.concatenate(self, axis=1)


def whole_cycles(last_s: float, period_s: float, frames: int) -> int:
    """Return how many whole cycles a motion holds.

    The last phase of a cycle is the N-th part of it before its end, and needs no later
    frame.

    Args:
        last_s: time of the motion's last frame [s].
        period_s: time of a cycle [s].
        frames: number of phases N.
    """
    return int(last_s / period_s + 1.0 / frames + _SLACK)


def mean_cycle(motion: Motion, period_s: float, frames: int) -> Cycle:
    """Return the mean over all whole cycles of a motion.

    Args:
        motion: a walk, which began at phase 0; or a robot that stands.
        period_s: time of a cycle [s].
        frames: number of phases N.

    Raises:
        CommandError: the motion holds no whole cycle.
    """
    last_s = float(motion.time[-1]) if len(motion.time) else 0.0
    whole = whole_cycles(last_s, period_s, frames)
    if whole < 1:
        raise CommandError(
            f"a motion of {last_s:g} s holds no whole cycle of {period_s:g} s: walk it "
            "for longer"
        )
    phases = np.arange(frames) / frames
    times = (np.arange(whole)[:, None] + phases) * period_s
    velocity = _in_heading(motion.heading, motion.qvel[:, :3])
    parts = (
        motion.qpos[:, 7:],
        motion.qvel[:, 6:],
        motion.contact,
        velocity,
        motion.qvel[:, 3:6],
    )
    return Cycle(*(_mean_at(times, motion.time, part) for part in parts))


def _mean_at(times: Array, known: Array, values: Array) -> Array:
    columns = [np.interp(times, known, column).mean(axis=0) for column in values.T]
    return np.stack(columns, axis=1)


def _in_heading(heading: Array, velocity: Array) -> Array:
    """Turn velocities (F, 3) from the world into the frame of the heading."""
    cos, sin = np.cos(heading), np.sin(heading)
    ahead, aside, up = velocity.T
    turned = cos * ahead + sin * aside, cos * aside - sin * ahead, up
    return np.stack(turned, axis=1)


def fit_polynomials(rows: Array, degree: int) -> Array:
    """Fit a polynomial in the phase to each column, also at phase 1, which is 0 again.

    Args:
        rows: (N, D) values at phases 0, 1 / N, ... below 1.
        degree: of the polynomials.

    Returns:
        (D, degree + 1) coefficients, the constant first.
    """
    closed = np.concatenate([rows, rows[:1]])
    phases = np.linspace(0.0, 1.0, len(closed))
    fitted = np.polynomial.legendre.Legendre
    found = []
    for column in closed.T:
        series = fitted.fit(phases, column, degree, domain=[0.0, 1.0])
        power = series.convert(kind=np.polynomial.Polynomial, domain=[-1.0, 1.0])
        found.append(np.pad(power.coef, (0, degree + 1 - len(power.coef))))
    return np.array(found)


def evaluate_single(coefficients: Array, frames: int) -> Array:
    """Evaluate polynomials as 32-bit readers do, (frames, D)."""
    phases = (np.arange(frames) / frames).astype(np.float32)[:, None]
    value = np.zeros((frames, len(coefficients)), np.float32)
    for coefficient in coefficients.astype(np.float32).T[::-1]:
        value = value * phases + coefficient
    return value.astype(np.float64)


def best_degree(cycles: list[Cycle]) -> tuple[int, float]:
    """Return the degree whose joint angles are nearest, and the largest error [rad].

    A high degree follows the motion better, but is worse in 32 bits.
    """
    errors = {}
    for degree in DEGREES:
        worst = 0.0
        for cycle in cycles:
            read = evaluate_single(fit_polynomials(cycle.joints, degree), len(cycle[0]))
            worst = max(worst, float(np.abs(read - cycle.joints).max()))
        errors[degree] = worst
    best = min(errors, key=lambda degree: errors[degree])
    return best, errors[best]
