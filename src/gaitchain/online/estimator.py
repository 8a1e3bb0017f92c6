"""From gyro, accelerometer and encoders to the base relative to the support foot.

Nothing here knows where the robot really is. The trunk's tilt comes from the gyro; in
the long run the accelerometer holds it while standing, and while walking the support
foot, flat on a ground whose slope was felt while standing. Position and velocity come
from the legs, taking the support foot to stand still. Ours.
"""

import math

import numpy as np

from gaitchain.kinematics import Array
from gaitchain.online.compiled import compiled
from gaitchain.online.legs import GRAVITY, Legs, com_from_pelvis, leg_links
from gaitchain.online.rotations import product, rotation, turned
from gaitchain.online.state import Attitude, Foot, Pelvis, Planar, View

_SOON_S = 1e-3  # velocities are differences over this time
_FOOT_RATE = 1.0  # 1/s: how fast a flat support foot corrects the gyro
_FOOT_REACH = 0.05  # rad: a foot tilted further tips, or stands on something
_BIAS_RATE = 0.25  # 1/s^2: how fast it corrects the gyro's bias
_SHAKEN = 2.0  # m/s^2: an accelerometer further from g does more than stand
_TURNING = 0.15  # rad/s: the same for the gyro
_CAUTION = 20  # control periods that an average begins with
_PATIENCE = 100  # the same for the gyro's bias about z
_MOST_BLAME = 0.005  # a gyro is innocent of how a robot comes to rest
_MOST_TICKS = 500  # control periods that a standing robot averages over
_KEPT_TICKS = 100  # of those, what counts when it stands again


@compiled
def sane(
    joints: Array, rates: Array, gyro: Array, accelerometer: Array, most: float
) -> bool:
    """Return whether every measurement is a number of a size below `most`."""
    for values in (joints, rates, gyro, accelerometer):
        for value in values:
            if not abs(value) < most:
                return False
    return True


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


@compiled
def lowest_corner(legs: Legs, foot: Array) -> float:
    """Return the height of a sole's lowest corner over its ankle, negative [m]."""
    along = min(legs.sole_rear * foot[2, 0], legs.sole_front * foot[2, 0])
    across = legs.sole_half_width * abs(foot[2, 1])
    return float(along - across - legs.ankle_height * foot[2, 2])


@compiled
def see_support(
    legs: Legs, attitude: Attitude, side: float, joints: Array, rates: Array
) -> View:
    """Locate pelvis and CoM from the support foot.

    Args:
        legs: the robot.
        attitude: of the trunk.
        side: +1 left, -1 right foot supports.
        joints: (12,) [rad].
        rates: (12,) [rad/s].

    Returns:
        Positions and velocities in the step frame.
    """
    support = 0 if side > 0 else 6
    level = rotation(0.0, attitude.pitch, attitude.roll)
    soon = rotation(
        0.0,
        attitude.pitch + attitude.pitch_rate * _SOON_S,
        attitude.roll + attitude.roll_rate * _SOON_S,
    )
    moved = joints + _SOON_S * rates
    points, foot = leg_links(legs, side, joints[support : support + 6])
    points_soon, _ = leg_links(legs, side, moved[support : support + 6])
    ankle, ankle_soon = turned(level, points[2]), turned(soon, points_soon[2])
    com = com_from_pelvis(legs, joints, level) - ankle
    com_soon = com_from_pelvis(legs, moved, soon) - ankle_soon
    # The heading turns too, and with it every vector of the level frame.
    turn = attitude.yaw_rate
    vx = (com_soon[0] - com[0]) / _SOON_S - turn * com[1]
    vy = (com_soon[1] - com[1]) / _SOON_S + turn * com[0]
    foot = product(level, foot)
    yaw = math.atan2(foot[1, 0], foot[0, 0])
    c, s = math.cos(yaw), math.sin(yaw)
    other, swing_foot = leg_links(legs, -side, joints[6 - support : 12 - support])
    swing_foot = product(level, swing_foot)
    swing = turned(level, other[2]) - ankle
    swing_yaw = math.atan2(swing_foot[1, 0], swing_foot[0, 0])
    low = lowest_corner(legs, swing_foot) - lowest_corner(legs, foot)
    return View(
        Pelvis(
            c * com[0] + s * com[1],
            side * (c * com[1] - s * com[0]),
            c * vx + s * vy,
            side * (c * vy - s * vx),
        ),
        Planar(-(c * ankle[0] + s * ankle[1]), -side * (c * ankle[1] - s * ankle[0])),
        yaw,
        Planar(-foot[1, 2], foot[0, 2]),
        Foot(
            c * swing[0] + s * swing[1],
            side * (c * swing[1] - s * swing[0]),
            -side * (swing_yaw - yaw),
        ),
        swing[2] + low,
    )


def measured_step(legs: Legs, joints: Array, side: float) -> tuple[float, float, float]:
    """Measure a step by the legs while both feet stand: swing foot from support foot.

    Args:
        legs: the robot.
        joints: (12,) [rad].
        side: +1 if the left foot is the one stepped from.

    Returns:
        Step ahead and to the left of the support foot [m], turn to the left [rad].
    """
    support = 0 if side > 0 else 6
    points, foot = leg_links(legs, side, joints[support : support + 6])
    other, landed = leg_links(legs, -side, joints[6 - support : 12 - support])
    x, y, _ = np.asarray(foot.T @ (other[2] - points[2]), dtype=float)
    relative = foot.T @ landed
    return float(x), float(y), math.atan2(relative[1, 0], relative[0, 0])


class Vertical:
    """What holds the gyro in the long run: gravity while standing, then a flat foot.

    While the robot stands still, gravity shows its tilt, the gyro its bias, and the
    feet the slope of the ground. While it walks, the support foot is flat on that
    ground; how it seems to tilt is the gyro's error.
    """

    def __init__(self) -> None:
        """Know nothing yet."""
        self.bias: Array = np.zeros(3)
        """Of the gyro [rad/s]."""
        self.slope = Planar(0.0, 0.0)
        """Roll and pitch of the ground about heading 0 [rad]."""
        self._ticks = 0
        self._still = False

    def stand(
        self, attitude: Attitude, gyro: Array, accelerometer: Array, period_s: float
    ) -> Attitude:
        """Lean towards gravity's direction, ever slower; blame the gyro for the rest.

        A robot that stands may still sway, so the tilt's rate is no bias; what gravity
        keeps correcting is one. About z, where gravity says nothing, the mean is taken.
        """
        x, y, z = accelerometer
        shaken = abs(math.hypot(x, y, z) - GRAVITY) > _SHAKEN
        self._still = not shaken and math.hypot(*gyro) < _TURNING
        if not self._still:
            return attitude
        self._ticks = min(self._ticks + 1, _MOST_TICKS)
        gain = 1.0 / (self._ticks + _CAUTION)
        roll = math.atan2(y, z) - attitude.roll
        pitch = math.atan2(-x, math.hypot(y, z)) - attitude.pitch
        blame = 0.25 * min(gain, _MOST_BLAME) ** 2 / period_s  # critically damped
        turn = (gyro[2] - self.bias[2]) / (self._ticks + _PATIENCE)
        self.bias = self.bias + np.array([-blame * roll, -blame * pitch, turn])
        return attitude._replace(
            roll=attitude.roll + gain * roll, pitch=attitude.pitch + gain * pitch
        )

    def note_slope(self, attitude: Attitude, view: View) -> None:
        """Take the ground's slope from the flat foot of a standing robot."""
        if not self._still:
            return
        x, y = _turn(view.foot_tilt, attitude.yaw)
        part = 1.0 / (self._ticks + _CAUTION)
        self.slope = Planar(
            self.slope.x + part * (x - self.slope.x),
            self.slope.y + part * (y - self.slope.y),
        )

    def leave_stand(self) -> None:
        """Trust the average less the next time the robot stands."""
        self._ticks = min(self._ticks, _KEPT_TICKS)

    def walk(self, attitude: Attitude, view: View, period_s: float) -> Attitude:
        """Correct tilt and bias by the support foot.

        Args:
            attitude: the trunk's.
            view: of the support foot, by that attitude.
            period_s: control period [s].

        Returns:
            The corrected attitude.
        """
        ground = _turn(self.slope, -attitude.yaw)
        reach = _FOOT_REACH
        roll = min(max(view.foot_tilt.x - ground[0], -reach), reach)
        pitch = min(max(view.foot_tilt.y - ground[1], -reach), reach)
        # Not about z: a foot that turns on the ground would pass for a bias.
        drift = np.array([_BIAS_RATE * roll, _BIAS_RATE * pitch, 0.0])
        self.bias = self.bias + drift * period_s
        gain = _FOOT_RATE * period_s
        return attitude._replace(
            roll=attitude.roll - gain * roll, pitch=attitude.pitch - gain * pitch
        )


def _turn(vector: Planar, angle: float) -> tuple[float, float]:
    c, s = math.cos(angle), math.sin(angle)
    return c * vector.x - s * vector.y, s * vector.x + c * vector.y
