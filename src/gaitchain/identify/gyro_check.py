"""Whether a gyro turns as far as gravity does in the accelerometer beside it. Ours.

A trunk that stands or is held turns by some degrees to and fro about level axes, and
gravity turns in it as far.
"""

from typing import NamedTuple

import numpy as np

from gaitchain.identify.log import Measured
from gaitchain.messages import Array

# By gyro, hidden robots turn by 0.1 to 0.9 of what gravity does; in deg/s, by 57 times
# that.
TIMES, BEYOND_DEG = 5.0, 5.0
"""Most that a gyro may show: times of what gravity does, and more of drift [deg]."""
_MEAN_S = 0.25  # over which accelerations are averaged, most of which are knocks
_LEAST_ROWS = 100


class Turned(NamedTuple):
    """RMS of turns about level axes, from their mean."""

    gyro_deg: float
    gravity_deg: float

    @property
    def possible(self) -> bool:
        """Whether both may be of one motion."""
        return self.gyro_deg <= TIMES * self.gravity_deg + BEYOND_DEG


def turns(seen: Measured) -> Turned | None:
    """Return how far a trunk turned by gyro and by gravity; None without an IMU."""
    felt = np.column_stack([seen.angular_velocity, seen.acceleration])
    there = np.isfinite(felt).all(axis=1)
    if there.sum() < _LEAST_ROWS:
        return None
    time_s, rate, pull = seen.time_s[there], felt[there, :3], felt[there, 3:]
    up = pull.mean(axis=0)
    up /= max(float(np.linalg.norm(up)), 1e-9)
    return Turned(_by_gyro(time_s, rate, up), _by_gravity(time_s, pull, up))


def _by_gyro(time_s: Array, rate: Array, up: Array) -> float:
    """Return the RMS of a rate's integral across `up`, without drift [deg]."""
    steps = 0.5 * (rate[1:] + rate[:-1]) * np.diff(time_s)[:, None]
    angle = np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])
    level = angle - np.outer(angle @ up, up)
    line = np.column_stack([np.ones_like(time_s), time_s - time_s.mean()])
    off = level - line @ np.linalg.lstsq(line, level, rcond=None)[0]
    return float(np.degrees(np.sqrt(np.mean(np.sum(off**2, axis=1)))))


def _by_gravity(time_s: Array, pull: Array, up: Array) -> float:
    """Return the RMS of the angle between a smoothed acceleration and `up` [deg]."""
    period_s = max(float(np.median(np.diff(time_s))), 1e-3)
    count = max(1, min(round(_MEAN_S / period_s), len(pull) // 2))
    sums = np.cumsum(np.vstack([np.zeros(3), pull]), axis=0)
    mean = sums[count:] - sums[:-count]
    along = mean @ up
    across = np.linalg.norm(mean - np.outer(along, up), axis=1)
    return float(np.degrees(np.sqrt(np.mean(np.arctan2(across, along) ** 2))))
