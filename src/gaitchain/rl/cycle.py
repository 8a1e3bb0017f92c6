"""The mean cycle of two steps of a motion, as polynomials in the phase."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gaitchain.errors import CommandError
from gaitchain.messages import Array
from gaitchain.rl.frames import Motion
from gaitchain.robot.turn import in_heading

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


def cycle_bounds(motion: Motion, planned_s: float, frames: int) -> Array:
    """Return when the whole cycles of a motion begin, and the last one ends [s].

    Those of a walk are cut where its phase begins anew, as a step that balance makes
    longer or shorter moves all that follow. The last one is whole if it lacks no more
    than what comes after its last phase. A robot that stands has those of the plan.

    Args:
        motion: a walk, which began at phase 0; or a robot that stands.
        planned_s: planned time of a cycle [s].
        frames: number of phases N.

    Raises:
        CommandError: the motion holds no whole cycle.
    """
    last_s = float(motion.time[-1]) if len(motion.time) else 0.0
    whole = int(last_s / planned_s + 1.0 / frames + _SLACK)
    bounds: Array = planned_s * np.arange(whole + 1, dtype=float)
    if motion.phase.any():
        bounds = _walked_bounds(motion, planned_s, frames)
    if len(bounds) < 2:
        raise CommandError(
            f"a motion of {last_s:g} s holds no whole cycle of {planned_s:g} s: walk "
            f"it for longer, such as {2.0 * planned_s:g} s, as steps may be late"
        )
    return bounds


def _walked_bounds(motion: Motion, planned_s: float, frames: int) -> Array:
    time, phase = motion.time, motion.phase
    wraps = np.flatnonzero(np.diff(phase, prepend=1.0) < -0.5)
    runs = np.flatnonzero(phase > 0.0)
    # A late step waits at phase 0 for the next: the first frame beyond tells its start.
    first = runs[np.unique(np.searchsorted(runs, wraps[wraps <= runs[-1]]))]
    bounds = time[first] - phase[first] * planned_s
    if not phase[-1]:  # still waits, or has just begun
        return np.append(bounds, time[-1])
    if phase[-1] + 1.0 / frames + _SLACK < 1.0:
        return np.asarray(bounds)
    return np.append(bounds, time[-1] + (1.0 - phase[-1]) * planned_s)


def mean_period(motions: Sequence[Motion], planned_s: float, frames: int) -> float:
    """Return the mean time of a cycle over the motions that walk [s].

    Args:
        motions: walks; without any the planned time is returned.
        planned_s: see `cycle_bounds`.
        frames: see `cycle_bounds`.
    """
    walks = [motion for motion in motions if motion.phase.any()]
    bounds = [cycle_bounds(motion, planned_s, frames) for motion in walks]
    each = [float(np.diff(found).mean()) for found in bounds]
    return float(np.mean(each)) if each else planned_s


def mean_cycle(motion: Motion, planned_s: float, frames: int) -> Cycle:
    """Return the mean over all whole cycles of a motion, phase by phase.

    Velocities are those of the mean cycle: by the mean time of a cycle they move the
    robot as far as it went.

    Args:
        motion: see `cycle_bounds`.
        planned_s: see `cycle_bounds`.
        frames: number of phases N.

    Raises:
        CommandError: the motion holds no whole cycle.
    """
    bounds = cycle_bounds(motion, planned_s, frames)
    each_s = np.diff(bounds)[:, None]
    times = bounds[:-1, None] + np.arange(frames) / frames * each_s
    pace = each_s / each_s.mean()

    def mean(values: Array, weight: Array | float = 1.0) -> Array:
        found = [np.interp(times, motion.time, column) for column in values.T]
        return np.stack([(weight * rows).mean(axis=0) for rows in found], axis=1)

    vx, vy, up = motion.qvel[:, :3].T
    velocity = np.stack([*in_heading(motion.heading, vx, vy), up], axis=1)
    return Cycle(
        mean(motion.qpos[:, 7:]),
        mean(motion.qvel[:, 6:], pace),
        mean(motion.contact),
        mean(velocity, pace),
        mean(motion.qvel[:, 3:6], pace),
    )


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
