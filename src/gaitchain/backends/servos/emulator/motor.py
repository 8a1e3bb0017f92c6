"""How an emulated servo moves: a first-order lag with limited speed."""

import math

from gaitchain.backends.servos.table import DEG_PER_COUNT


class Motor:
    """A motor that follows a goal; positions are in counts."""

    def __init__(self, angle_deg: float, speed_deg_s: float, lag_s: float) -> None:
        """Start at rest.

        Args:
            angle_deg: initial angle [deg].
            speed_deg_s: speed limit [deg/s].
            lag_s: time constant of the lag [s].
        """
        self.position = angle_deg / DEG_PER_COUNT
        """[counts]"""
        self.velocity = 0.0
        """[counts/s]"""
        self._speed, self._lag = speed_deg_s / DEG_PER_COUNT, lag_s

    def follow(self, goal: float, elapsed_s: float) -> None:
        """Move towards a goal: first at the speed limit, then by the lag."""
        elapsed_s = max(0.0, elapsed_s)
        error = goal - self.position
        near = self._speed * self._lag
        straight = min(elapsed_s, max(0.0, (abs(error) - near) / self._speed))
        error -= math.copysign(self._speed * straight, error)
        error *= math.exp(-(elapsed_s - straight) / self._lag)
        self.position = goal - error
        speed = error / self._lag
        self.velocity = max(-self._speed, min(self._speed, speed))
