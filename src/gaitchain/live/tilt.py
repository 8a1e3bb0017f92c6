"""How far the trunk leans, by gyro and accelerometer alone.

On purpose not the estimator that the walk balances by: what guards it shall not share
its mistakes.
"""

import math

import numpy as np

from gaitchain.messages import Array, Sensors

_SETTLING_S = 0.5  # how fast the accelerometer corrects the gyro
_GRAVITY, _SHAKEN = 9.81, 3.0  # m/s^2: further from g the accelerometer is not asked


class TiltSense:
    """The vertical in the trunk's frame."""

    def __init__(self) -> None:
        """Know nothing yet."""
        self._up: Array | None = None

    @property
    def felt(self) -> bool:
        """Whether gravity was felt yet."""
        return self._up is not None

    def feel(self, sensors: Sensors, elapsed_s: float) -> float:
        """Return the trunk's angle from the vertical [rad], 0 until it was felt.

        Args:
            sensors: whole numbers all.
            elapsed_s: since the sensors before [s].
        """
        acceleration = sensors.acceleration
        size = math.sqrt(float(acceleration @ acceleration))
        resting = abs(size - _GRAVITY) < _SHAKEN
        if self._up is None:
            if not resting:
                return 0.0
            self._up = acceleration / size
        # A vector at rest turns against the trunk.
        up = self._up - np.cross(sensors.angular_velocity, self._up) * elapsed_s
        if resting:
            up = up + (acceleration / size - up) * min(elapsed_s / _SETTLING_S, 1.0)
        self._up = up / max(math.sqrt(float(up @ up)), 1e-6)
        return math.acos(min(max(float(self._up[2]), -1.0), 1.0))
