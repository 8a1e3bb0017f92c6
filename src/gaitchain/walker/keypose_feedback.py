"""Balance feedback for the paper's walk: sensors and planned angles to targets."""

import math

import numpy as np

from gaitchain.balance.attitude import Vertical, turn_attitude
from gaitchain.balance.gains import derive_gains
from gaitchain.balance.keypose_balance import (
    Correction,
    JointMotion,
    Stance,
    correct_ankles,
)
from gaitchain.balance.leg_kinematics import legs_of
from gaitchain.balance.state import Attitude
from gaitchain.messages import GRAVITY, Array, Sensors
from gaitchain.robot.robot import Robot

_NEAR = 0.1  # leg lengths of DCM error: beyond it the support foot may tip


class SplineBalance:
    """Correct planned joint angles by feedback at the ankles."""

    def __init__(self, robot: Robot, hip_height: float, period_s: float) -> None:
        """Derive the gains from the robot.

        Args:
            robot: the robot.
            hip_height: hips above the ankles [m].
            period_s: control period [s].
        """
        self._legs, self._period_s = legs_of(robot), period_s
        self._gains = derive_gains(self._legs)
        self._leg_length = robot.reduced.leg_length
        self._omega = math.sqrt(GRAVITY / (hip_height + robot.reduced.ankle_height))
        self._vertical = Vertical()
        self.attitude = Attitude()
        self._before: Array | None = None
        self._latest: Correction | None = None

    def correct(
        self, planned: Array, sensors: Sensors, *, left: bool, single: bool, still: bool
    ) -> Array:
        """Compute the servo targets; call once per control period.

        Args:
            planned: (12,) joint angles [rad].
            sensors: measurements of this control period.
            left: whether the left leg is the support leg.
            single: whether it is in single support.
            still: whether the robot is to stand.

        Returns:
            (12,) joint targets [rad].
        """
        self._sense(sensors, still=still, single=single)
        before = planned if self._before is None else self._before
        side = 1.0 if left else -1.0
        self._latest = correct_ankles(
            self._legs,
            self._gains,
            Stance(self.attitude, self._omega, side, single and not still),
            JointMotion(planned, (planned - before) / self._period_s),
            JointMotion(sensors.joint_position, sensors.joint_velocity),
        )
        self._before = planned
        return np.asarray(self._latest.targets)

    def _sense(self, sensors: Sensors, *, still: bool, single: bool) -> None:
        gyro, period = sensors.angular_velocity, self._period_s
        bias = self._vertical.bias
        self.attitude = turn_attitude(self.attitude, gyro - bias, period)
        if still:
            self.attitude = self._vertical.stand(
                self.attitude, gyro, sensors.acceleration, period
            )
            if self._latest is not None:
                self._vertical.note_slope(self.attitude, self._latest.view)
            return
        self._vertical.leave_stand()
        if single and self._latest is not None:
            off = math.hypot(*self._latest.error) / self._leg_length
            if off < _NEAR:
                tilt = self._latest.view.foot_tilt
                self.attitude = self._vertical.walk(self.attitude, tilt, period)
