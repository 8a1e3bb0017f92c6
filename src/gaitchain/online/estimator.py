"""From gyro, accelerometer and encoders to the base relative to the support foot.

Nothing here knows where the robot really is: the trunk's tilt comes from the gyro, held
upright in the long run by the accelerometer; position and velocity come from the legs,
taking the support foot to stand still. Ours; compiled, all but `measured_step`.
"""

import math

import numpy as np

from gaitchain.kinematics import Array
from gaitchain.online.compiled import compiled
from gaitchain.online.legs import (
    Legs,
    com_from_pelvis,
    leg_links,
    product,
    rotation,
    turned,
)
from gaitchain.online.state import Attitude, Pelvis, Planar, View

_TILT_RATE = 0.1  # 1/s: how fast the accelerometer corrects the gyro
_TILT_REACH = 0.1  # rad: an accelerometer further off is shaken, not tilted
_SOON_S = 1e-3  # velocities are differences over this time
_LEVEL = 0.3  # rad: beyond this tilt the accelerometer says nothing useful


@compiled
def turn_attitude(
    attitude: Attitude, gyro: Array, accelerometer: Array, period_s: float
) -> Attitude:
    """Integrate the gyro and lean towards the accelerometer's vertical.

    Args:
        attitude: of one control period ago.
        gyro: (3,) angular velocity in the trunk's frame [rad/s].
        accelerometer: (3,) specific force in the trunk's frame [m/s^2].
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
    roll_seen = math.atan2(accelerometer[1], accelerometer[2])
    level = math.hypot(accelerometer[1], accelerometer[2])
    pitch_seen = math.atan2(-accelerometer[0], level)
    gain = _TILT_RATE * period_s
    roll_off = min(max(roll_seen - attitude.roll, -_TILT_REACH), _TILT_REACH)
    pitch_off = min(max(pitch_seen - pitch, -_TILT_REACH), _TILT_REACH)
    return Attitude(
        attitude.roll + roll_rate * period_s + gain * roll_off,
        pitch + pitch_rate * period_s + gain * pitch_off,
        attitude.yaw + yaw_rate * period_s,
        roll_rate,
        pitch_rate,
        yaw_rate,
    )


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
    other, _ = leg_links(legs, -side, joints[6 - support : 12 - support])
    swing = turned(level, other[2])
    return View(
        Pelvis(
            c * com[0] + s * com[1],
            side * (c * com[1] - s * com[0]),
            c * vx + s * vy,
            side * (c * vy - s * vx),
        ),
        Planar(-(c * ankle[0] + s * ankle[1]), -side * (c * ankle[1] - s * ankle[0])),
        yaw,
        swing[2] - ankle[2],
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
