"""Motion between key poses: the paper's timing and cubic Hermite segments."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gaitchain.errors import CommandError
from gaitchain.messages import Array


@dataclass(frozen=True)
class Timing:
    """Times of one step: swing up T_a, swing down T_b, double support T_c.

    See Sec. II-A and VI-B; the paper's "twenty percent" is the double support
    (row 4 of `docs/paper_map.md`).
    """

    step: float = 3.0
    """T, one step [s]."""
    rise: float = 0.6
    """T_a, toe-off to the swing foot's highest point [s]."""
    fall: float = 1.8
    """T_b, highest point to heel contact [s]."""

    def __post_init__(self) -> None:
        positive = self.rise > 0 and self.fall > 0 and self.double_support > 0
        if not (positive and math.isfinite(self.step)):
            raise CommandError(
                f"T = {self.step} s, T_a = {self.rise} s, T_b = {self.fall} s: each "
                "must be positive and finite, and T_a + T_b less than T"
            )

    @property
    def double_support(self) -> float:
        """T_c, duration of the double support [s]."""
        return self.step - self.rise - self.fall

    @property
    def key_times(self) -> tuple[float, float, float, float]:
        """The key moments 0, T_a, T_a + T_b, T of a step [s]."""
        return 0.0, self.rise, self.rise + self.fall, self.step

    @property
    def segments(self) -> tuple[float, float, float]:
        """Durations between the key moments: T_a, T_b, T_c [s]."""
        return self.rise, self.fall, self.double_support


class State(NamedTuple):
    """State phi = [q, dq, ddq] of the reduced biped."""

    q: Array
    """(..., 7) [rad]"""
    dq: Array
    """(..., 7) [rad/s]"""
    ddq: Array
    """(..., 7) [rad/s^2]"""


class StepMotion:
    """A step through its four key poses along cubic Hermite segments.

    Each key pose has its own velocity, so a segment depends on its two ends only (the
    Markov property), and q and dq are continuous between segments. A natural C2 spline
    would overshoot in sway (row 17 of `docs/paper_map.md`).
    """

    def __init__(self, key_times: Sequence[float], q: Array, dq: Array) -> None:
        """Interpolate key poses.

        Args:
            key_times: the K key times, as `Timing.key_times` [s].
            q: (..., K, 7) key poses [rad].
            dq: (..., K, 7) their velocities [rad/s].
        """
        self._key_times = np.asarray(key_times, dtype=np.float64)
        self._coefficients = _hermite(np.diff(self._key_times)[:, None], q, dq)

    def at(self, time_s: Array) -> State:
        """Evaluate the motion.

        Args:
            time_s: (N,) times since the step's start [s].

        Returns:
            Pose, velocity and acceleration, each (..., N, 7).
        """
        last = len(self._key_times) - 2
        segment = np.searchsorted(self._key_times, time_s, side="right") - 1
        segment = np.clip(segment, 0, last)
        since = (time_s - self._key_times[segment])[:, None]
        at, rate, square, cubic = (c[..., segment, :] for c in self._coefficients)
        return State(
            _polynomial((at, rate, square, cubic), since),
            _polynomial((rate, 2.0 * square, 3.0 * cubic), since),
            _polynomial((2.0 * square, 6.0 * cubic), since),
        )


class SplineSegment:
    """One cubic Hermite segment between two key poses, evaluated online."""

    def __init__(self, duration_s: float, start: State, end: State) -> None:
        """Join two key poses; their accelerations are not used."""
        self.duration_s = duration_s
        self._coefficients = _cubic(duration_s, start, end)

    def q(self, time_s: float) -> Array:
        """Return the pose at a time since the segment's start, held beyond its ends.

        Returns:
            (7,) joint angles [rad].
        """
        t = min(max(time_s, 0.0), self.duration_s)
        a, b, c, d = self._coefficients
        return np.asarray(((a * t + b) * t + c) * t + d)


def end_accelerations(duration_s: Array, q: Array, dq: Array) -> Array:
    """Compute the accelerations at both ends of the segments between key poses.

    ddq(0) = 6 (q1 - q0) / h^2 - (4 dq0 + 2 dq1) / h,
    ddq(h) = -6 (q1 - q0) / h^2 + (2 dq0 + 4 dq1) / h.

    Args:
        duration_s: (K - 1,) durations h [s].
        q: (..., K, 7) key poses [rad].
        dq: (..., K, 7) velocities [rad/s].

    Returns:
        (..., K - 1, 2, 7) accelerations at the start and the end of each segment.
    """
    h = np.asarray(duration_s)[:, None]
    rise = 6.0 * np.diff(q, axis=-2) / h**2
    before, after = dq[..., :-1, :], dq[..., 1:, :]
    start = rise - (4.0 * before + 2.0 * after) / h
    end = -rise + (2.0 * before + 4.0 * after) / h
    return np.stack([start, end], axis=-2)


def _hermite(h: Array, q: Array, dq: Array) -> tuple[Array, Array, Array, Array]:
    """Return the coefficients of all segments, constant term first, (..., K - 1, 7).

    q(t) = q_0 + dq_0 t + ((slope - dq_0) / h - c) t^2 + c / h t^3, with
    c = (dq_0 + dq_1 - 2 slope) / h and slope = (q_1 - q_0) / h.
    """
    start, rate = q[..., :-1, :], dq[..., :-1, :]
    slope = np.diff(q, axis=-2) / h
    bend = (rate + dq[..., 1:, :] - 2.0 * slope) / h
    return start, rate, (slope - rate) / h - bend, bend / h


def _polynomial(coefficients: Sequence[Array], x: Array) -> Array:
    """Evaluate polynomials whose constant term comes first.

    The powers are added in this order, not in Horner's, because SciPy's PPoly rounds in
    the same way: libraries that were built with it are reproduced byte for byte.
    """
    result, power = coefficients[0] + coefficients[1] * x, x
    for coefficient in coefficients[2:]:
        power = power * x
        result += coefficient * power
    return result


def _cubic(h: float, start: State, end: State) -> tuple[Array, Array, Array, Array]:
    slope = (end.q - start.q) / h
    cubic = (start.dq + end.dq - 2.0 * slope) / h**2
    square = (3.0 * slope - 2.0 * start.dq - end.dq) / h
    return cubic, square, start.dq, start.q
