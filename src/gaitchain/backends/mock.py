"""A backend with perfect tracking: the plan without physics."""

import numpy as np

from gaitchain.backends.base import TORQUE_UNIT, LinkHealth
from gaitchain.messages import GRAVITY, Array, Sensors


class MockBackend:
    """Joints that reach every target within one control period."""

    physical = False
    has_imu = False
    load_unit = TORQUE_UNIT

    def __init__(self, period_s: float) -> None:
        """Set the control period [s]."""
        self._period_s = period_s
        self._ticks = 0
        self._position: Array = np.zeros(0)
        self._velocity: Array = np.zeros(0)

    def connect(self, position: Array) -> None:
        """Start at the joint angles (2 n,) [rad]."""
        self._ticks = 0
        self._position = np.array(position)
        self._velocity = np.zeros_like(self._position)

    def read(self) -> Sensors:
        """Return the targets as measurements; the accelerometer measures gravity."""
        return Sensors(
            time=self._ticks * self._period_s,
            joint_position=self._position.copy(),
            joint_velocity=self._velocity.copy(),
            angular_velocity=np.zeros(3),
            acceleration=np.array([0.0, 0.0, GRAVITY]),
        )

    def write(self, position: Array) -> None:
        """Move the joints to the targets (2 n,) [rad]."""
        self._velocity = (position - self._position) / self._period_s
        self._position = np.array(position)
        self._ticks += 1

    def engage(self) -> None:
        """Do nothing: there is no torque."""

    def release(self) -> None:
        """Do nothing: there is no torque."""

    def loads(self) -> Array:
        """Return NaN (2 n,): no torque is known."""
        return np.full(len(self._position), np.nan)

    def health(self) -> LinkHealth:
        """Return a link without losses."""
        return LinkHealth(sent=self._ticks)

    def close(self) -> None:
        """Do nothing: there is no connection."""
