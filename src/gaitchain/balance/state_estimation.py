"""State estimation of a walk of strides: the trunk's orientation, the CoM's offset."""

import math

import numpy as np

from gaitchain.balance.attitude import Vertical, turn_attitude
from gaitchain.balance.com_estimator import weigh_offset
from gaitchain.balance.compiled import compiled
from gaitchain.balance.gains import Gains
from gaitchain.balance.leg_kinematics import Legs
from gaitchain.balance.packed_state import OfRow, Row, part, put
from gaitchain.balance.rotations import rotation
from gaitchain.balance.state import (
    SETTLE,
    SINGLE,
    STAND,
    Attitude,
    Planar,
    StepTimes,
    View,
)
from gaitchain.messages import Array, Sensors

NEAR = 0.1
"""DCM error over the leg's length beyond which the support foot may tip."""
_LOOK_EVERY = 4  # control periods between corrections by the support foot
_FIRST_S = 0.5  # of standing that weighing begins with: its pelvis may sway
_WEIGH_EVERY = 2  # control periods: weighing takes longer than the rest of a period


@compiled
def turn_trunk(numbers: Row, gyro: Array, bias: Array) -> None:
    """Integrate the gyro, (3,) [rad/s], into the attitude of a walk's row, (1,)."""
    walk = numbers[0]
    put(walk.attitude, turn_attitude(walk.attitude, gyro - bias, walk.times.period))


class StateEstimator(OfRow):
    """Estimate attitude and CoM offset: learned in a stand, used while walking."""

    _attitude: Attitude = part("attitude")
    _com_offset: Planar = part("com_offset")
    _error: Planar = part("state", "error")
    _foot_tilt: Planar = part("measured", "foot_tilt")
    _phase: int = part("state", "phase")
    _view: View = part("measured")

    def __init__(
        self, legs: Legs, gains: Gains, times: StepTimes, numbers: Row
    ) -> None:
        """Keep attitude and CoM offset in a walk's row, (1,)."""
        self._legs, self._gains, self._period = legs, gains, times.period
        self.numbers = numbers
        self.reset()

    def reset(self) -> None:
        """Forget what was learned; the row is left as it is."""
        self.targets: Array | None = None
        """(2 n,) latest servo targets [rad]; None before the first control step."""
        self._vertical = Vertical(
            self._period, foot_tells_roll=bool(self._legs.foot_tells_roll)
        )
        self._unlooked = self._unweighed = 0

    @property
    def gyro_bias(self) -> Array:
        """(3,) of the gyro [rad/s]."""
        return self._vertical.bias.copy()

    def leave_stand(self) -> None:
        """Give what standing showed less weight the next time."""
        self._vertical.leave_stand()

    def update(self, sensors: Sensors) -> None:
        """Take the trunk's orientation from the sensors; in a stand the CoM, too."""
        phase = self._phase
        turn_trunk(self.numbers, sensors.angular_velocity, self._vertical.bias)
        if not self._vertical.foot_tells_roll and phase not in (STAND, SETTLE):
            speed = self._view.com.vx
            self._attitude = self._vertical.lean(
                self._attitude, sensors.acceleration, speed
            )
        if phase == STAND:
            self._stand(sensors)
        elif phase == SETTLE:
            self._attitude = self._vertical.settle(
                self._attitude, sensors.angular_velocity, sensors.acceleration
            )
        elif phase == SINGLE and self.targets is not None:
            # Slow against a step: every few periods are enough.
            self._unlooked += 1
            if self._unlooked >= _LOOK_EVERY:
                self._unlooked = 0
                self._look()

    def _stand(self, sensors: Sensors) -> None:
        """Learn all that a robot shows while it stands."""
        vertical, gyro = self._vertical, sensors.angular_velocity
        self._attitude = vertical.stand(self._attitude, gyro, sensors.acceleration)
        if self.targets is not None:
            vertical.note_slope(self._attitude, self._view)
            self._weigh(sensors, self.targets)

    def _look(self) -> None:
        """Correct the attitude by the support foot."""
        if math.hypot(*self._error) < NEAR * self._legs.leg:
            span_s = _LOOK_EVERY * self._period
            self._attitude = self._vertical.walk(
                self._attitude, self._foot_tilt, span_s
            )

    def _weigh(self, sensors: Sensors, targets: Array) -> None:
        """Learn where the CoM is from what the servos carry."""
        still, gains = self._vertical.still_ticks, self._gains
        if not still or not gains.learning:
            return
        self._unweighed = (self._unweighed + 1) % _WEIGH_EVERY
        if self._unweighed:
            return
        attitude = self._attitude
        level = rotation(0.0, attitude.pitch, attitude.roll)
        position, velocity = sensors.joint_position, sensors.joint_velocity
        off = weigh_offset(self._legs, position, velocity, targets, level)
        if off is not None:
            most, offset = gains.offset_reach, np.array(self._com_offset)
            part = _WEIGH_EVERY / (still + _FIRST_S / self._period)
            offset += part * (off.clip(-most, most) - offset)
            self._com_offset = Planar(*offset)
