"""What a walk of strides senses: the trunk's orientation, and where the CoM is."""

import math

from gaitchain.kinematics import Array
from gaitchain.messages import Sensors
from gaitchain.online.estimator import Vertical, turn_attitude
from gaitchain.online.gains import Gains
from gaitchain.online.legs import Legs
from gaitchain.online.rotations import rotation
from gaitchain.online.state import SINGLE, STAND, Attitude, GaitState, View
from gaitchain.online.weigh import weigh_offset

_LOOK_EVERY = 4  # control periods between corrections by the support foot
_NEAR = 0.1  # of the leg: a robot further off its plan may tip its foot
_HASTE = 50  # control periods that weighing begins with: its pelvis must not sway


class Senses:
    """Attitude and weight, learned while standing still and used while walking."""

    def __init__(self, legs: Legs, period_s: float) -> None:
        """Begin upright, facing ahead; the control period is in seconds."""
        self._legs, self._period = legs, period_s
        self.attitude = Attitude(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        """Of the trunk."""
        self.view: View | None = None
        """Of the latest tick; None before the first one."""
        self.targets: Array | None = None
        """(2 n,) that the servos follow [rad]; None before the first tick."""
        self._vertical = Vertical()
        self._unlooked = 0

    def leave_stand(self) -> None:
        """Trust what standing showed less the next time."""
        self._vertical.leave_stand()

    def sense(
        self, sensors: Sensors, state: GaitState, gains: Gains, offset: Array
    ) -> None:
        """Take the trunk's orientation from the sensors.

        Args:
            sensors: of this control period.
            state: of the walk.
            gains: of the robot.
            offset: (2,) of the CoM [m]; changed in place where the servos tell.
        """
        gyro, period = sensors.angular_velocity, self._period
        self.attitude = turn_attitude(self.attitude, gyro - self._vertical.bias, period)
        if state.phase == STAND:
            self.attitude = self._vertical.stand(
                self.attitude, gyro, sensors.acceleration, period
            )
            if self.view is not None:
                self._vertical.note_slope(self.attitude, self.view)
                self._weigh(sensors, gains, offset)
        elif state.phase == SINGLE and self.view is not None:
            # Slow against a step: every few periods are enough.
            self._unlooked += 1
            if self._unlooked >= _LOOK_EVERY:
                self._unlooked = 0
                if math.hypot(*state.error) < _NEAR * self._legs.leg:
                    self.attitude = self._vertical.walk(
                        self.attitude, self.view, _LOOK_EVERY * period
                    )

    def _weigh(self, sensors: Sensors, gains: Gains, offset: Array) -> None:
        """Learn where the CoM is from what the servos carry."""
        still = self._vertical.still_ticks
        if self.targets is None or not still or not gains.learning:
            return
        level = rotation(0.0, self.attitude.pitch, self.attitude.roll)
        position, velocity = sensors.joint_position, sensors.joint_velocity
        off = weigh_offset(self._legs, position, velocity, self.targets, level)
        if off is not None:
            most = gains.offset_reach
            offset += (off.clip(-most, most) - offset) / (still + _HASTE)
