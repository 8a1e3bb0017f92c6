"""What a walk of strides senses: the trunk's orientation, and where the CoM is."""

import math

from gaitchain.balance.attitude import Vertical, turn_attitude
from gaitchain.balance.com_estimator import weigh_offset
from gaitchain.balance.compiled import compiled
from gaitchain.balance.gains import Gains
from gaitchain.balance.leg_kinematics import Legs
from gaitchain.balance.packed_state import Row, WalkRow, attitude_in, put_attitude
from gaitchain.balance.rotations import rotation
from gaitchain.balance.state import SINGLE, STAND
from gaitchain.messages import Array, Sensors

_LOOK_EVERY = 4  # control periods between corrections by the support foot
_NEAR = 0.1  # of the leg: a robot further off its plan may tip its foot
_HASTE = 50  # control periods that weighing begins with: its pelvis must not sway


@compiled
def turn_trunk(numbers: Row, gyro: Array, bias: Array) -> None:
    """Integrate the gyro, (3,) [rad/s], into the attitude of a walk's row, (1,)."""
    walk = numbers[0]
    turned = turn_attitude(attitude_in(walk.attitude), gyro - bias, walk.times.period)
    put_attitude(walk.attitude, turned)


class Senses:
    """Attitude and weight, learned while standing still and used while walking."""

    def __init__(self, legs: Legs, gains: Gains, period_s: float, row: WalkRow) -> None:
        """Keep the attitude of a walk's row; the control period is in seconds."""
        self._legs, self._gains, self._period = legs, gains, period_s
        self._row = row
        self.targets: Array | None = None
        """(2 n,) that the servos follow [rad]; None before the first tick."""
        self._vertical = Vertical()
        self._unlooked = 0

    def leave_stand(self) -> None:
        """Trust what standing showed less the next time."""
        self._vertical.leave_stand()

    def sense(self, sensors: Sensors, offset: Array) -> None:
        """Take the trunk's orientation from the sensors.

        Args:
            sensors: of this control period.
            offset: (2,) of the CoM [m]; changed in place where the servos tell.
        """
        row, phase = self._row, self._row.phase
        turn_trunk(row.numbers, sensors.angular_velocity, self._vertical.bias)
        if phase == STAND:
            self._stand(sensors, offset)
        elif phase == SINGLE and self.targets is not None:
            # Slow against a step: every few periods are enough.
            self._unlooked += 1
            if self._unlooked >= _LOOK_EVERY:
                self._unlooked = 0
                self._look()

    def _stand(self, sensors: Sensors, offset: Array) -> None:
        """Learn all that a robot shows while it stands."""
        row, vertical = self._row, self._vertical
        row.attitude = vertical.stand(
            row.attitude, sensors.angular_velocity, sensors.acceleration, self._period
        )
        if self.targets is not None:
            vertical.note_slope(row.attitude, row.view)
            self._weigh(sensors, self.targets, offset)

    def _look(self) -> None:
        """Correct the attitude by the support foot."""
        row = self._row
        if math.hypot(*row.error) < _NEAR * self._legs.leg:
            row.attitude = self._vertical.walk(
                row.attitude, row.view, _LOOK_EVERY * self._period
            )

    def _weigh(self, sensors: Sensors, targets: Array, offset: Array) -> None:
        """Learn where the CoM is from what the servos carry."""
        still, gains = self._vertical.still_ticks, self._gains
        if not still or not gains.learning:
            return
        attitude = self._row.attitude
        level = rotation(0.0, attitude.pitch, attitude.roll)
        position, velocity = sensors.joint_position, sensors.joint_velocity
        off = weigh_offset(self._legs, position, velocity, targets, level)
        if off is not None:
            most = gains.offset_reach
            offset += (off.clip(-most, most) - offset) / (still + _HASTE)
