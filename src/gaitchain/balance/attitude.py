"""From gyro and accelerometer to the trunk's orientation.

The gyro is integrated. Its drift is corrected by the accelerometer while the robot
stands, and while it walks by the support foot, which lies flat on a ground whose slope
was measured while standing. A foot whose ankle does not roll stands on an edge of its
sole and says nothing about roll; a narrow one stays as it landed, and it landed by the
very attitude that it is to correct: there the accelerometer goes on, slowly. Ours.
"""

import math

import numpy as np

from gaitchain.balance.compiled import compiled
from gaitchain.balance.state import Attitude, Planar, View
from gaitchain.messages import GRAVITY, Array

_RATE = 1.0  # 1/s: how fast a flat foot, or gravity in a rest, corrects the gyro
_REACH = 0.05  # rad: a foot tilted further tips, or stands on something
_LEAN_RATE = 0.4  # 1/s: how fast gravity does in walking, where the foot does not tell
_LEAN_REACH = 0.5  # rad: more than that is an impact
_BIAS_RATE = 0.25  # 1/s^2: how fast it corrects the gyro's bias
_SMOOTH_S = 0.1  # over which a standing robot's sensors are averaged: its soles chatter
_SHAKEN = 2.0  # m/s^2: an accelerometer further from g does more than stand
_TURNING = 0.15  # rad/s: the same for the gyro
_FIRST_S = 0.2  # of standing that an average begins with
_FIRST_Z_S = 1.0  # the same for the gyro's bias about z
_MOST_RATE = 0.5  # 1/s, of the bias: the sway of a robot that comes to rest is none
_MOST_S = 5.0  # of standing that an average is over
_KEPT_S = 1.0  # of that, what counts when it stands again


@compiled
def turn_attitude(attitude: Attitude, gyro: Array, period_s: float) -> Attitude:
    """Integrate the gyro.

    Args:
        attitude: of one control period ago.
        gyro: (3,) angular velocity in the trunk's frame, without its bias [rad/s].
        period_s: control period [s].

    Returns:
        The attitude now.
    """
    sin_r, cos_r = math.sin(attitude.roll), math.cos(attitude.roll)
    pitch = min(max(attitude.pitch, -1.4), 1.4)  # Euler angles end at 90 deg
    turning = sin_r * gyro[1] + cos_r * gyro[2]
    roll_rate = gyro[0] + math.tan(pitch) * turning
    pitch_rate = cos_r * gyro[1] - sin_r * gyro[2]
    yaw_rate = turning / math.cos(pitch)
    return Attitude(
        attitude.roll + roll_rate * period_s,
        pitch + pitch_rate * period_s,
        attitude.yaw + yaw_rate * period_s,
        roll_rate,
        pitch_rate,
        yaw_rate,
    )


class Vertical:
    """Correct the integrated gyro: by gravity while standing, then by a flat foot.

    While the robot stands still, gravity shows its tilt, the gyro its bias, and the
    feet the slope of the ground. While it walks, the support foot is flat on that
    ground; how it seems to tilt is the gyro's error.
    """

    def __init__(self, period_s: float, *, foot_tells_roll: bool = True) -> None:
        """Begin with no bias and a level ground.

        Args:
            period_s: control period [s].
            foot_tells_roll: whether soles lie flat, see `Legs.foot_tells_roll`.
        """
        self.foot_tells_roll = foot_tells_roll
        """Whether the support foot corrects the roll; else `lean` does."""
        self.bias: Array = np.zeros(3)
        """Of the gyro [rad/s]."""
        self.slope = Planar(0.0, 0.0)
        """Roll and pitch of the ground about heading 0 [rad]."""
        self._period_s = period_s
        self._ticks = 0.0  # control periods of standing that an average is over
        self._still = False
        self._smooth: Array | None = None  # accelerometer and gyro of a standing robot

    def stand(self, attitude: Attitude, gyro: Array, accelerometer: Array) -> Attitude:
        """Turn the attitude toward gravity's direction, ever slower; learn the bias.

        A robot that stands may still sway, so the tilt's rate is no bias; what gravity
        keeps correcting is one. About z, where gravity says nothing, the mean is taken.
        """
        self._sense(gyro, accelerometer)
        if not self._still:
            return attitude
        period = self._period_s
        self._ticks = min(self._ticks + 1.0, _MOST_S / period)
        gain = 1.0 / self._weight(_FIRST_S)
        roll, pitch = self._off_gravity(attitude)
        most = _MOST_RATE * period
        bias_gain = 0.25 * min(gain, most) ** 2 / period  # critically damped
        turn = (gyro[2] - self.bias[2]) / self._weight(_FIRST_Z_S)
        self.bias = self.bias + np.array([-bias_gain * roll, -bias_gain * pitch, turn])
        return _turned(attitude, roll, pitch, gain)

    def settle(self, attitude: Attitude, gyro: Array, accelerometer: Array) -> Attitude:
        """Turn the attitude toward gravity's direction, as slowly as a flat foot does.

        A wrong attitude keeps the robot from coming to rest, so a stand cannot correct
        it. A robot that comes to rest sways: no bias of the gyro is learned.
        """
        self._sense(gyro, accelerometer)
        if not self._still:
            return attitude
        roll, pitch = map(_limited, self._off_gravity(attitude))
        return _turned(attitude, roll, pitch, _RATE * self._period_s)

    def _sense(self, gyro: Array, accelerometer: Array) -> None:
        """Smooth both sensors; judge by them whether the trunk stands still.

        What soles do that chatter has no mean. Single samples that look still have one.
        """
        now = np.concatenate((accelerometer, gyro))
        before = now if self._smooth is None else self._smooth
        self._smooth = before + self._period_s / _SMOOTH_S * (now - before)
        felt, turning = self._smooth[:3], self._smooth[3:]
        shaken = abs(math.hypot(*felt) - GRAVITY) > _SHAKEN
        self._still = not shaken and math.hypot(*turning) < _TURNING

    def _off_gravity(self, attitude: Attitude) -> tuple[float, float]:
        """Return what the attitude lacks to gravity's roll and pitch [rad]."""
        assert self._smooth is not None
        x, y, z = self._smooth[:3]
        roll, pitch = math.atan2(y, z), math.atan2(-x, math.hypot(y, z))
        return roll - attitude.roll, pitch - attitude.pitch

    @property
    def still_ticks(self) -> float:
        """Control periods that it has stood; 0 where it does not stand still."""
        return self._ticks if self._still else 0.0

    def _weight(self, first_s: float) -> float:
        """Return how many control periods an average is over.

        Args:
            first_s: of standing that it begins with [s].
        """
        return self._ticks + first_s / self._period_s

    def note_slope(self, attitude: Attitude, view: View) -> None:
        """Take the ground's slope from the flat foot of a standing robot."""
        if not self._still:
            return
        x, y = _turn(view.foot_tilt, attitude.yaw)
        part = 1.0 / self._weight(_FIRST_S)
        self.slope = Planar(
            self.slope.x + part * (x - self.slope.x),
            self.slope.y + part * (y - self.slope.y),
        )

    def leave_stand(self) -> None:
        """Give the average less weight the next time the robot stands."""
        self._ticks = min(self._ticks, _KEPT_S / self._period_s)
        self._smooth = None

    def walk(self, attitude: Attitude, foot_tilt: Planar, span_s: float) -> Attitude:
        """Correct tilt and bias by the support foot.

        Args:
            attitude: the trunk's.
            foot_tilt: of the support foot, by that attitude, see `View` [rad].
            span_s: since it was corrected before [s].

        Returns:
            The corrected attitude.
        """
        ground = _turn(self.slope, -attitude.yaw)
        roll = _limited(ground[0] - foot_tilt.x) if self.foot_tells_roll else 0.0
        pitch = _limited(ground[1] - foot_tilt.y)
        # Not about z: a foot that turns on the ground would pass for a bias.
        self.bias[0] -= _BIAS_RATE * roll * span_s
        self.bias[1] -= _BIAS_RATE * pitch * span_s
        return _turned(attitude, roll, pitch, _RATE * span_s)

    def lean(self, attitude: Attitude, accelerometer: Array, speed: float) -> Attitude:
        """Correct roll and its bias by gravity, so slowly that steps average out.

        In the mean of two steps nothing but a curve accelerates the trunk aside. It is
        for robots whose support foot does not tell.

        Args:
            attitude: the trunk's.
            accelerometer: (3,) in the trunk's frame [m/s^2].
            speed: ahead over the ground [m/s].

        Returns:
            The corrected attitude.
        """
        aside = accelerometer[1] - speed * attitude.yaw_rate
        off = math.atan2(aside, accelerometer[2]) - attitude.roll
        roll = min(max(off, -_LEAN_REACH), _LEAN_REACH)
        period = self._period_s
        self.bias[0] -= 0.25 * _LEAN_RATE**2 * roll * period  # critically damped
        return _turned(attitude, roll, 0.0, _LEAN_RATE * period)


def _turned(attitude: Attitude, roll: float, pitch: float, part: float) -> Attitude:
    """Return the attitude with a part of a roll and a pitch [rad] more."""
    return attitude._replace(
        roll=attitude.roll + part * roll, pitch=attitude.pitch + part * pitch
    )


def _limited(angle: float) -> float:
    return min(max(angle, -_REACH), _REACH)


def _turn(vector: Planar, angle: float) -> tuple[float, float]:
    c, s = math.cos(angle), math.sin(angle)
    return c * vector.x - s * vector.y, s * vector.x + c * vector.y
