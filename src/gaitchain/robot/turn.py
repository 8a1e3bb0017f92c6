"""Rotations in NumPy, as matrices, headings and quaternions.

`balance.rotations` has those of the compiled control step; code without such a step
does not wait until it is compiled.
"""

import numpy as np

from gaitchain.messages import Array


def turn_matrix(angles: Array) -> Array:
    """Return R_z(yaw) R_y(pitch) R_x(roll), (3, 3), of angles (3,) [rad]."""
    (sx, sy, sz), (cx, cy, cz) = np.sin(angles), np.cos(angles)
    roll = np.array([[1.0, 0.0, 0.0], [0.0, cx, -sx], [0.0, sx, cx]])
    pitch = np.array([[cy, 0.0, sy], [0.0, 1.0, 0.0], [-sy, 0.0, cy]])
    yaw = np.array([[cz, -sz, 0.0], [sz, cz, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(yaw @ pitch @ roll)


def in_heading(heading: Array, x: Array, y: Array) -> tuple[Array, Array]:
    """Turn level vectors from the world into the axes of a heading.

    Args:
        heading: (...) [rad].
        x: (...) their x in the world.
        y: (...) their y in the world.

    Returns:
        (...) each: ahead, and to the left.
    """
    cos, sin = np.cos(heading), np.sin(heading)
    return cos * x + sin * y, cos * y - sin * x


def quaternion(turn: Array) -> Array:
    """Return the quaternion of a rotation matrix, (4,) w, x, y, z.

    The columns of 4 q q^T are q times each of its numbers; the longest loses no digits.

    Args:
        turn: (3, 3) axes of the turned frame in columns.
    """
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = turn.tolist()
    outer = np.array(
        [
            [1.0 + xx + yy + zz, zy - yz, xz - zx, yx - xy],
            [zy - yz, 1.0 + xx - yy - zz, xy + yx, xz + zx],
            [xz - zx, xy + yx, 1.0 - xx + yy - zz, yz + zy],
            [yx - xy, xz + zx, yz + zy, 1.0 - xx - yy + zz],
        ]
    )
    column = outer[np.argmax(np.diagonal(outer))]
    return np.asarray(column / np.linalg.norm(column))
