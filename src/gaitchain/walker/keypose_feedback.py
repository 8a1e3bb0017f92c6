"""Balance feedback for the paper's walk: sensors and planned angles to targets."""

import math

import numpy as np

from gaitchain.balance.attitude import Vertical, turn_attitude
from gaitchain.balance.curves import beyond
from gaitchain.balance.gains import derive_gains
from gaitchain.balance.keypose_balance import (
    Correction,
    JointMotion,
    Stance,
    correct_ankles,
)
from gaitchain.balance.keypose_lead import KeyposeLead
from gaitchain.balance.leg_kinematics import legs_of
from gaitchain.balance.state import Attitude
from gaitchain.balance.state_estimation import NEAR
from gaitchain.messages import GRAVITY, Array, Sensors
from gaitchain.robot.robot import Robot

_FOLLOWED = 0.3  # dead zones: errors of a robot whose servos follow the plan


class AnkleBalance:
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
        self._vertical = Vertical(
            period_s, foot_tells_roll=bool(self._legs.foot_tells_roll)
        )
        self.attitude = Attitude()
        self._before: Array | None = None
        self._latest: Correction | None = None

    def correct(
        self, planned: Array, sensors: Sensors, *, left: bool, single: bool, still: bool
    ) -> Array:
        """Compute the servo targets; call once per control period.

        Args:
            planned: (2 n,) joint angles [rad].
            sensors: measurements of this control period.
            left: whether the left leg is the support leg.
            single: whether it is in single support.
            still: whether the robot is to stand.

        Returns:
            (2 n,) joint targets [rad].
        """
        self._sense(sensors, still=still, single=single)
        found = self._compare(planned, sensors, left=left, pushing=single and not still)
        return np.asarray(found.targets)

    def _compare(
        self, planned: Array, sensors: Sensors, *, left: bool, pushing: bool
    ) -> Correction:
        """Compare robot and plan; `pushing` is whether the ankles may push."""
        before = planned if self._before is None else self._before
        side = 1.0 if left else -1.0
        self._latest = correct_ankles(
            self._legs,
            self._gains,
            Stance(self.attitude, self._omega, side, pushing),
            JointMotion(planned, (planned - before) / self._period_s),
            JointMotion(sensors.joint_position, sensors.joint_velocity),
        )
        self._before = planned
        return self._latest

    def _sense(self, sensors: Sensors, *, still: bool, single: bool) -> None:
        gyro, period = sensors.angular_velocity, self._period_s
        bias = self._vertical.bias
        self.attitude = turn_attitude(self.attitude, gyro - bias, period)
        if still:
            self.attitude = self._vertical.stand(
                self.attitude, gyro, sensors.acceleration
            )
            if self._latest is not None:
                self._vertical.note_slope(self.attitude, self._latest.view)
            return
        self._vertical.leave_stand()
        if not self._vertical.foot_tells_roll:
            self.attitude = self._vertical.lean(
                self.attitude, sensors.acceleration, 0.0
            )
        if single and self._latest is not None:
            off = math.hypot(*self._latest.error) / self._leg_length
            if off < NEAR:
                tilt = self._latest.view.foot_tilt
                self.attitude = self._vertical.walk(self.attitude, tilt, period)


class ZmpBalance(AnkleBalance):
    """The same for servos that follow the plan: a DCM error shifts the planned ZMP.

    With both feet on the ground that shifts the weight between them.
    """

    def __init__(
        self, robot: Robot, hip_height: float, period_s: float, stand: Array
    ) -> None:
        """Derive the gains from the robot, which stands still.

        Args:
            robot: the robot.
            hip_height: hips above the ankles [m].
            period_s: control period [s].
            stand: (2 n,) its standing pose [rad].
        """
        super().__init__(robot, hip_height, period_s)
        self._lead = KeyposeLead(robot, stand, period_s)

    def correct(
        self, planned: Array, sensors: Sensors, *, left: bool, single: bool, still: bool
    ) -> Array:
        """See `AnkleBalance.correct`."""
        self._sense(sensors, still=still, single=single)
        error = self._compare(planned, sensors, left=left, pushing=False).error
        if still:
            return self._lead.targets(planned, left=left)
        ankle, zone = self._gains.ankle, self._gains.dead_zone
        x = ankle.x * beyond(error.x, _FOLLOWED * zone.x)
        y = ankle.y * beyond(error.y, _FOLLOWED * zone.y)
        return self._lead.targets(planned, left=left, shift=(x, y if left else -y))


def make_balance(
    robot: Robot, hip_height: float, period_s: float, stand: Array
) -> AnkleBalance:
    """Return the balance of a robot: of boxes, or read from a file.

    Arguments are those of `ZmpBalance`.
    """
    if robot.of_boxes:
        return AnkleBalance(robot, hip_height, period_s)
    return ZmpBalance(robot, hip_height, period_s, stand)
