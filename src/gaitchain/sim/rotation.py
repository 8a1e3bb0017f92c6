"""Rotations as MuJoCo has them."""

import mujoco
import numpy as np

from gaitchain.messages import Array


def quaternion(rotation: Array) -> Array:
    """Return the quaternion of a rotation matrix.

    Args:
        rotation: (3, 3) axes of the turned frame in columns.

    Returns:
        (4,) w, x, y, z.
    """
    result = np.empty(4)
    mujoco.mju_mat2Quat(result, np.ascontiguousarray(rotation).ravel())
    return result
