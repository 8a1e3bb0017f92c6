"""What encoders and an IMU mean that are not mounted as in the robot's file. Ours.

An encoder that shows d more than its joint's angle, and the servo that obeys it, are
taken d back and sent d more. What the IMU measures is turned into the trunk's frame.
"""

from dataclasses import replace

import numpy as np

from gaitchain.messages import Array, JointTargets, Sensors
from gaitchain.robot.identified import Identified


class Mounting:
    """The map between what a robot's parts show and what is true of it."""

    def __init__(self, found: Identified) -> None:
        """Take the offsets of the encoders and the turn of the IMU."""
        self._offset, self._turn = found.offset, turned(found.tilt)

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


def turned(angles: Array) -> Array:
    """Return R_z(yaw) R_y(pitch) R_x(roll), (3, 3), of angles (3,) [rad]."""
    (sx, sy, sz), (cx, cy, cz) = np.sin(angles), np.cos(angles)
    roll = np.array([[1.0, 0.0, 0.0], [0.0, cx, -sx], [0.0, sx, cx]])
    pitch = np.array([[cy, 0.0, sy], [0.0, 1.0, 0.0], [-sy, 0.0, cy]])
    yaw = np.array([[cz, -sz, 0.0], [sz, cz, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(yaw @ pitch @ roll)
