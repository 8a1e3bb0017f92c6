"""What an accelerometer shows of a trunk that is held upright. Ours."""

import math

import numpy as np

from gaitchain.messages import Array

MOST_TILT_DEG = 45.0
"""More than an upright trunk has from its z; a walk counts 50 as a fall."""
_AXES = "xyz"


def tilt_deg(pulling: Array) -> float:
    """Return the angle between an acceleration (3,) and the trunk's z [deg]."""
    return angle_deg(pulling, np.array([0.0, 0.0, 1.0]))


def angle_deg(one: Array, other: Array) -> float:
    """Return the angle between two vectors (3,) [deg]."""
    size = max(float(np.linalg.norm(one) * np.linalg.norm(other)), 1e-9)
    return math.degrees(math.acos(min(max(float(one @ other) / size, -1.0), 1.0)))


def nearest_axis(vector: Array) -> str:
    """Return the axis along which a vector (3,) is longest, with its sign."""
    most = int(np.argmax(np.abs(vector)))
    return f"{'-' if vector[most] < 0.0 else '+'}{_AXES[most]}"
