"""Convert a reduced pose to the twelve servo angles of the box robot."""

import numpy as np

from gaitchain.messages import Array
from gaitchain.robot.kinematics import (
    SUPPORT_CRUS,
    SUPPORT_FEMUR,
    SUPPORT_SWAY,
    SWING_CRUS,
    SWING_FEMUR,
    SWING_SWAY,
    TRUNK,
)


def joint_angles(q: Array, left_support: bool) -> Array:
    """Decompose a reduced pose into joint angles with level soles.

    Each thigh's lean and sway relative to the trunk make one rotation,
    R_y(-q3) R_x(-theta) R_y(q) = R_z(yaw) R_x(roll) R_y(pitch), solved in closed form;
    the ankle joints cancel the lean and sway of the crus, so that the feet stay level.

    Args:
        q: (..., 7) reduced pose [rad].
        left_support: whether the left leg is the support leg.

    Returns:
        (..., 12) joint angles [rad] in the order of `JOINT_NAMES`.
    """
    side = 1.0 if left_support else -1.0
    trunk = q[..., TRUNK]
    support = _leg(
        q[..., SUPPORT_FEMUR], q[..., SUPPORT_CRUS], -side * q[..., SUPPORT_SWAY], trunk
    )
    swing = _leg(
        q[..., SWING_FEMUR], q[..., SWING_CRUS], -side * q[..., SWING_SWAY], trunk
    )
    legs = (support, swing) if left_support else (swing, support)
    return np.concatenate(legs, axis=-1)


def _leg(femur: Array, crus: Array, tilt: Array, trunk: Array) -> Array:
    sin_t, cos_t = np.sin(tilt), np.cos(tilt)
    sin_p, cos_p = np.sin(trunk), np.cos(trunk)
    sin_f, cos_f = np.sin(femur), np.cos(femur)
    yaw = np.arctan2(sin_p * sin_t, cos_t)
    roll = np.arcsin(cos_p * sin_t)
    pitch = np.arctan2(
        cos_p * sin_f * cos_t - sin_p * cos_f, sin_p * sin_f + cos_p * cos_f * cos_t
    )
    return np.stack([yaw, roll, pitch, crus - femur, -crus, -tilt], axis=-1)
