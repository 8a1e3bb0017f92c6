"""Rotation matrices of three numbers, (3, 3), for the online path. Compiled."""

import math

import numpy as np

from gaitchain.kinematics import Array
from gaitchain.online.compiled import compiled


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
def pitched(a: Array, angle: float) -> Array:
    """Return a R_y(angle); the angle alone costs less than a whole product."""
    c, s = math.cos(angle), math.sin(angle)
    result = np.empty((3, 3))
    for i in range(3):
        result[i, 0] = c * a[i, 0] - s * a[i, 2]
        result[i, 1] = a[i, 1]
        result[i, 2] = s * a[i, 0] + c * a[i, 2]
    return result


@compiled
def rolled(a: Array, angle: float) -> Array:
    """Return a R_x(angle)."""
    c, s = math.cos(angle), math.sin(angle)
    result = np.empty((3, 3))
    for i in range(3):
        result[i, 0] = a[i, 0]
        result[i, 1] = c * a[i, 1] + s * a[i, 2]
        result[i, 2] = c * a[i, 2] - s * a[i, 1]
    return result


@compiled
def yaw_rotation(angle: float) -> Array:
    """Return R_z(angle)."""
    c, s = math.cos(angle), math.sin(angle)
    result = np.zeros((3, 3))
    result[0, 0], result[0, 1] = c, -s
    result[1, 0], result[1, 1] = s, c
    result[2, 2] = 1.0
    return result


@compiled
def hip_rotation(joints: Array) -> Array:
    """Return R_z(yaw) R_x(roll) R_y(pitch) of the thigh in the pelvis frame."""
    return pitched(rolled(yaw_rotation(joints[0]), joints[1]), joints[2])
