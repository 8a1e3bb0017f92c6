"""The attitude of a robot that is not balanced: it falls, lies, and gets up. Ours.

The balance has Euler angles, which are singular at 90 deg of pitch, and the soles to
correct them. Here the gyro turns two directions, as the trunk sees them, and gravity
corrects which one is up wherever the trunk rests.
"""

import math

import numpy as np

from gaitchain.balance.rotations import about, rotation
from gaitchain.balance.state import Attitude
from gaitchain.messages import GRAVITY, Array, Sensors

_SETTLING_S = 0.5  # how fast the accelerometer corrects the gyro
_SHAKEN = 3.0  # m/s^2: further from g the accelerometer says nothing of the vertical
_TURNING, _RESTS_S = 0.05, 0.5  # rad/s, s: below that for longer, it rests
_SILENT_S = 0.25  # a gyro that says nothing for longer has lost the heading
_STILL = 1e-9  # rad


class Lying:
    """Follows a trunk by gyro and accelerometer alone, however it lies."""

    def __init__(self, attitude: Attitude, bias: Array, period_s: float) -> None:
        """Begin where the robot was balanced last.

        Args:
            attitude: of the trunk then.
            bias: (3,) of the gyro, as a stand showed it [rad/s].
            period_s: between two calls of `feel` [s].
        """
        turn = rotation(attitude.yaw, attitude.pitch, attitude.roll)
        # The floor's x axis and the vertical, in the axes of the trunk.
        self._ahead, self._up = turn[0], turn[2]
        self._began, self._bias, self._period_s = attitude.yaw, bias.copy(), period_s
        self._silent_s, self._lost, self._still_s = 0.0, False, 0.0

    def feel(self, sensors: Sensors, *, measured: bool) -> None:
        """Go on by one control period.

        Args:
            sensors: whole numbers all.
            measured: whether the gyro's are of now.
        """
        self._silent_s = 0.0 if measured else self._silent_s + self._period_s
        self._lost = self._lost or self._silent_s > _SILENT_S
        off = sensors.angular_velocity - self._bias
        self._turn(off * self._period_s)
        self._learn(off)
        self._settle(sensors.acceleration)

    @property
    def tilt(self) -> tuple[float, float]:
        """Roll and pitch, as the Euler angles of the balance [rad]."""
        ahead, left, up = self._up.tolist()
        return math.atan2(left, up), math.atan2(-ahead, math.hypot(left, up))

    @property
    def yaw(self) -> float | None:
        """Heading, which means something once the trunk is upright again [rad].

        None where the gyro said nothing for too long.
        """
        if self._lost:
            return None
        aside = self._up[1] * self._ahead[2] - self._up[2] * self._ahead[1]
        found = math.atan2(aside, self._ahead[0])
        return self._began + math.remainder(found - self._began, math.tau)

    def _turn(self, angle: Array) -> None:
        """Turn what rests against the trunk, which turned by a vector (3,) [rad]."""
        size = math.hypot(*angle)
        if size > _STILL:
            back = about(angle / size, -size)
            self._ahead, self._up = back @ self._ahead, back @ self._up

    def _learn(self, off: Array) -> None:
        """Learn the gyro's bias of a trunk that rests: it may lie there for long.

        Args:
            off: (3,) what the gyro says beyond the bias known so far [rad/s].
        """
        still = math.hypot(*off) < _TURNING
        self._still_s = self._still_s + self._period_s if still else 0.0
        if self._still_s > _RESTS_S:
            self._bias += off * (self._period_s / _SETTLING_S)

    def _settle(self, acceleration: Array) -> None:
        """Draw the vertical toward what is felt; the floor's x axis stays level."""
        size = math.hypot(*acceleration)
        up, ahead = self._up, self._ahead
        if abs(size - GRAVITY) < _SHAKEN:
            up = up + (acceleration / size - up) * (self._period_s / _SETTLING_S)
        self._up = up / max(math.hypot(*up), _STILL)
        ahead = ahead - (ahead @ self._up) * self._up
        self._ahead = np.asarray(ahead / max(math.hypot(*ahead), _STILL))
