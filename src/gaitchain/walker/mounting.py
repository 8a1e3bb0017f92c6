"""What encoders and an IMU mean that are not mounted as in the robot's file. Ours.

An encoder that shows d more than its joint's angle, and the servo that obeys it, are
taken d back and sent d more. What the IMU measures is turned into the trunk's frame.
"""

from dataclasses import replace

import numpy as np

from gaitchain.messages import Array, JointTargets, Sensors
from gaitchain.robot.identified import Identified
from gaitchain.robot.turn import turn_matrix


class Mounting:
    """The map between what a robot's parts show and what is true of it."""

    def __init__(self, found: Identified) -> None:
        """Take the offsets of the encoders and the turn of the IMU."""
        self._offset, self._turn = found.offset, turn_matrix(found.tilt)

    def sensed(self, sensors: Sensors) -> Sensors:
        """Return the sensors of a robot that is mounted as in its file."""
        return replace(
            sensors,
            joint_position=self.angles(sensors.joint_position),
            angular_velocity=self._turn @ sensors.angular_velocity,
            acceleration=self._turn @ sensors.acceleration,
        )

    def angles(self, shown: Array) -> Array:
        """Return the joints' angles (2 n,) for those of their encoders [rad]."""
        return np.asarray(shown - self._offset)

    def asked(self, targets: JointTargets) -> JointTargets:
        """Return the targets to send."""
        motors = targets.motors
        if motors is not None:
            motors = replace(motors, position=motors.position + self._offset)
        return replace(targets, position=targets.position + self._offset, motors=motors)
