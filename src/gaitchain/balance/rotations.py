"""Rotation matrices of three numbers, (3, 3), for the online path. Compiled."""

import math

import numpy as np

from gaitchain.balance.compiled import compiled
from gaitchain.messages import Array


@compiled
def rotation(yaw: float, pitch: float, roll: float) -> Array:
    """Return R_z(yaw) R_y(pitch) R_x(roll), (3, 3)."""
    cy, sy = math.cos(yaw), math.sin(yaw)
    cp, sp = math.cos(pitch), math.sin(pitch)
    cr, sr = math.cos(roll), math.sin(roll)
    result = np.empty((3, 3))
    result[0, 0] = cy * cp
    result[0, 1] = cy * sp * sr - sy * cr
    result[0, 2] = cy * sp * cr + sy * sr
    result[1, 0] = sy * cp
    result[1, 1] = sy * sp * sr + cy * cr
    result[1, 2] = sy * sp * cr - cy * sr
    result[2, 0] = -sp
    result[2, 1] = cp * sr
    result[2, 2] = cp * cr
    return result


@compiled
def product(a: Array, b: Array) -> Array:
    """Return the product of two 3 x 3 matrices."""
    result = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            result[i, j] = a[i, 0] * b[0, j] + a[i, 1] * b[1, j] + a[i, 2] * b[2, j]
    return result


@compiled
def turned(a: Array, v: Array) -> Array:
    """Return a v."""
    result = np.empty(3)
    for i in range(3):
        result[i] = a[i, 0] * v[0] + a[i, 1] * v[1] + a[i, 2] * v[2]
    return result


@compiled
def turned_back(a: Array, v: Array) -> Array:
    """Return the transpose of a times v."""
    result = np.empty(3)
    for i in range(3):
        result[i] = a[0, i] * v[0] + a[1, i] * v[1] + a[2, i] * v[2]
    return result


@compiled
def about(axis: Array, angle: float) -> Array:
    """Return the rotation about a unit vector, by Rodrigues' formula, (3, 3)."""
    x, y, z = axis[0], axis[1], axis[2]
    c, s = math.cos(angle), math.sin(angle)
    d = 1.0 - c
    result = np.empty((3, 3))
    result[0, 0], result[1, 1], result[2, 2] = (
        c + d * x * x,
        c + d * y * y,
        c + d * z * z,
    )
    result[0, 1], result[1, 0] = d * x * y - s * z, d * x * y + s * z
    result[0, 2], result[2, 0] = d * x * z + s * y, d * x * z - s * y
    result[1, 2], result[2, 1] = d * y * z - s * x, d * y * z + s * x
    return result
