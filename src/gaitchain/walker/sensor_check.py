"""Measurements that are no numbers, or absurd ones, and the last good ones instead."""

import math
from dataclasses import replace
from typing import Any

import numpy as np

from gaitchain.messages import Sensors

ABSURD = 1000.0
"""No robot measures this [rad, rad/s, m/s^2]."""
MEASURED = ("joint_position", "joint_velocity", "angular_velocity", "acceleration")
"""What a walk needs of `Sensors`."""


def unsound(sensors: Sensors) -> list[str]:
    """Return the names of what holds a number that cannot be."""
    return [n for n in MEASURED if not np.all(np.abs(getattr(sensors, n)) < ABSURD)]


def mended(sensors: Sensors, good: Sensors) -> Sensors:
    """Return the sensors with good numbers in place of those that cannot be.

    Args:
        sensors: as measured.
        good: whole ones.
    """
    whole: dict[str, Any] = {}
    if not math.isfinite(sensors.time):
        whole["time"] = good.time
    for name in MEASURED:
        values = getattr(sensors, name)
        sound = np.abs(values) < ABSURD
        whole[name] = np.where(sound, values, getattr(good, name))
    return replace(sensors, **whole)
