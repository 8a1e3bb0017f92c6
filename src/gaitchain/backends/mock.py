"""A backend with perfect tracking: the plan without physics."""

import numpy as np

from gaitchain.backends.base import TORQUE_UNIT, LinkHealth, joint_angles
from gaitchain.errors import BackendError
from gaitchain.gait.limits import check_period
from gaitchain.messages import GRAVITY, Array, Sensors


class MockBackend:
    """Joints that reach every target within one control period."""

    physical = False
    has_imu = False
    load_unit = TORQUE_UNIT

    def __init__(self, period_s: float) -> None:
        """Set the control period [s].

        Raises:
            CommandError: it is none.
        """
        check_period(period_s)
        self._period_s = period_s
        self._ticks = 0
        self._position: Array = np.zeros(0)
        self._velocity: Array = np.zeros(0)

    def connect(self, position: Array) -> None:
        """Start at the joint angles (2 n,) [rad].

        Raises:
            CommandError: they are no finite numbers.
        """
        self._ticks = 0
        self._position = joint_angles(position, np.size(position)).copy()
        self._velocity = np.zeros_like(self._position)

    def read(self) -> Sensors:
        """Return the targets as measurements; the accelerometer measures gravity.

        Raises:
            BackendError: it is not connected.
        """
        self._check_connected()
        return Sensors(
            time=self._ticks * self._period_s,
            joint_position=self._position.copy(),
            joint_velocity=self._velocity.copy(),
            angular_velocity=np.zeros(3),
            acceleration=np.array([0.0, 0.0, GRAVITY]),
        )

    def write(self, position: Array) -> None:
        """Move the joints to the targets (2 n,) [rad].

        Raises:
            BackendError: it is not connected.
            CommandError: they are other than finite angles of its joints.
        """
        self._check_connected()
        reached = joint_angles(position, self._position.size).copy()
        self._velocity = (reached - self._position) / self._period_s
        self._position = reached
        self._ticks += 1

    def _check_connected(self) -> None:
        if not self._position.size:
            raise BackendError("not connected: call connect with the joints' angles")

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
