"""What an agent sees of a walk: the sensors of a robot, its command and its phase."""

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gaitchain.errors import CommandError
from gaitchain.messages import Array, Sensors

Observation = NDArray[np.float32]
_ANGLE, _RATE, _GYRO, _ACCELERATION = 2.0 * math.pi, 100.0, 50.0, 500.0


class Layout(NamedTuple):
    """Where the parts of an observation are; n joints, a numbers in an action.

    Sensors are those of a robot, with the noise of the world: no ground truth.
    """

    joint_position: slice
    """(n,) relative to the standing pose [rad]"""
    joint_velocity: slice
    """(n,) [rad/s]"""
    angular_velocity: slice
    """(3,) gyro in the trunk's frame [rad/s]"""
    acceleration: slice
    """(3,) accelerometer in the trunk's frame, 9.81 upward at rest [m/s^2]"""
    command: slice
    """(3,) vx, vy, yaw rate as parts of the library's limits, see `CommandRange`"""
    phase: slice
    """(2,) sine and cosine of the place in the cycle of two steps"""
    action: slice
    """(a,) the previous action"""

    @classmethod
    def of(cls, joints: int, actions: int) -> "Layout":
        """Return the layout for numbers of joints and of actions."""
        ends = np.cumsum([0, joints, joints, 3, 3, 3, 2, actions]).tolist()
        return cls(*(slice(begin, end) for begin, end in pairwise(ends)))

    @property
    def size(self) -> int:
        """Length of an observation."""
        return int(self.action.stop)

    def bounds(self) -> Observation:
        """Return the largest absolute value of each number, (size,)."""
        most = (_ANGLE, _RATE, _GYRO, _ACCELERATION, 1.0, 1.0, 1.0)
        found = np.empty(self.size, np.float32)
        for part, value in zip(self, most, strict=True):
            found[part] = value
        return found

    def check(self, observation: Observation) -> None:
        """Refuse an observation of another size.

        Raises:
            CommandError: it is none of this layout.
        """
        if np.shape(observation) != (self.size,):
            raise CommandError(
                f"an observation of shape {np.shape(observation)}: need {self.size} "
                "numbers, as the environment with action='targets' gives for this robot"
            )

    def sensors(self, observation: Observation, stand: Array, time_s: float) -> Sensors:
        """Return what the robot measured, from an observation.

        Args:
            observation: (size,) of the environment.
            stand: (n,) standing pose [rad].
            time_s: of the measurement [s].
        """
        seen = np.asarray(observation, np.float64)
        return Sensors(
            time=time_s,
            joint_position=seen[self.joint_position] + stand,
            joint_velocity=seen[self.joint_velocity],
            angular_velocity=seen[self.angular_velocity],
            acceleration=seen[self.acceleration],
        )


def phase_signal(phase: float) -> tuple[float, float]:
    """Return sine and cosine of a phase in [0, 1)."""
    angle = 2.0 * math.pi * phase
    return math.sin(angle), math.cos(angle)
