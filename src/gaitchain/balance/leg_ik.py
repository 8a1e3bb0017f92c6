"""Inverse kinematics of one leg of any make, by Newton's method. Compiled.

From the pose of one control period ago two iterations reach the rounding error. A leg
of six joints meets every target exactly; one of five what it can, in the sense of
least squares, and one of seven moves its joints as little as possible.
"""

import math

import numpy as np

from gaitchain.balance.compiled import compiled
from gaitchain.balance.leg_kinematics import Legs, Posture, place_leg, unplaced
from gaitchain.messages import Array

_ITERATIONS = 12
_CLOSE = 1e-8  # m and rad
_PLACE = 1000.0  # rad/m: what a leg of five joints cannot meet is the foot's turn
_NEAR = 3e-5  # rad
_DAMPING = 1e-8  # against the singular knee: keeps steps finite, costs no accuracy
# For six joints or more that cannot reach: steps hardly damped would go round for ever.
_STRETCHED_PLACE = 1.0  # rad/m: no foot is turned to win a millimetre
_STRETCHED_DAMPING = 0.1  # for each metre or radian off: none is left once it is met
_LONGEST = 0.4  # rad: a step of the iteration


@compiled
def leg_joints(legs: Legs, leg: int, ankle: Array, foot: Array, start: Array) -> Array:
    """Solve a leg's inverse kinematics.

    A target out of reach is met in direction, with the leg as straight as it gets.

    Args:
        legs: the robot.
        leg: 0 left, 1 right.
        ankle: (3,) ankle point in the pelvis frame [m].
        foot: (3, 3) rotation of the sole in the pelvis frame.
        start: (n,) where to begin, the pose of a moment ago [rad].

    Returns:
        (n,) joint angles [rad].
    """
    count = start.shape[0]
    found = unplaced(count)
    joints = start.copy()
    error = np.empty(6)
    for _ in range(_ITERATIONS):
        place_leg(legs, leg, joints, found)
        target, stretched = _within_reach(legs, leg, ankle, found)
        off = _miss(found.ankles[leg], found.feet[leg], target, foot, error)
        if off < _CLOSE:
            break
        place, damping = _PLACE, _DAMPING
        if stretched and count > 5:
            place, damping = _STRETCHED_PLACE, _STRETCHED_DAMPING * off
        step = _newton_step(
            found.centres[leg],
            found.axes[leg],
            found.ankles[leg],
            error,
            place,
            damping,
        )
        longest = 0.0
        for j in range(count):
            longest = max(longest, abs(step[j]))
        part = min(1.0, _LONGEST / longest) if longest > 0.0 else 0.0
        for j in range(count):
            joints[j] += part * step[j]
        if longest < _NEAR:  # the error left is about its square
            break
    return joints


@compiled
def _within_reach(
    legs: Legs, leg: int, ankle: Array, found: Posture
) -> tuple[Array, bool]:
    """Draw a target in to where a nearly straight leg can hold it, if need be."""
    hip, end = found.centres[leg, legs.knee - 1], found.centres[leg, legs.knee + 1]
    way = np.empty(3)  # from hip to ankle joint, were the ankle point at the target
    far = 0.0
    for i in range(3):
        way[i] = ankle[i] - found.ankles[leg, i] + end[i] - hip[i]
        far += way[i] * way[i]
    far = math.sqrt(far)
    target = ankle.copy()
    if far > legs.reach:
        for i in range(3):
            target[i] -= (1.0 - legs.reach / far) * way[i]
    return target, far > legs.reach


@compiled
def _miss(at: Array, turn: Array, target: Array, wanted: Array, error: Array) -> float:
    """Write how far a foot is off, position and rotation vector; return the largest."""
    for i in range(3):
        error[i] = target[i] - at[i]
    # The rotation from `turn` to `wanted`: half of the skew part is sin(angle) axis.
    x = y = z = trace = 0.0
    for k in range(3):
        x += wanted[2, k] * turn[1, k] - wanted[1, k] * turn[2, k]
        y += wanted[0, k] * turn[2, k] - wanted[2, k] * turn[0, k]
        z += wanted[1, k] * turn[0, k] - wanted[0, k] * turn[1, k]
        for i in range(3):
            trace += wanted[i, k] * turn[i, k]
    sine = 0.5 * math.sqrt(x * x + y * y + z * z)
    angle = math.atan2(sine, 0.5 * (trace - 1.0))
    part = 0.5 * angle / sine if sine > 1e-12 else 0.5
    error[3], error[4], error[5] = part * x, part * y, part * z
    off = 0.0
    for i in range(6):
        off = max(off, abs(error[i]))
    return off


@compiled
def _newton_step(
    centres: Array,
    axes: Array,
    ankle: Array,
    error: Array,
    place: float,
    damping: float,
) -> Array:
    """Solve (J^T J + d) step = J^T error by Cholesky's method."""
    count = centres.shape[0]
    columns = np.empty((6, count))
    for j in range(count):
        x = ankle[0] - centres[j, 0]
        y = ankle[1] - centres[j, 1]
        z = ankle[2] - centres[j, 2]
        a, b, c = axes[j, 0], axes[j, 1], axes[j, 2]
        columns[0, j] = place * (b * z - c * y)
        columns[1, j] = place * (c * x - a * z)
        columns[2, j] = place * (a * y - b * x)
        columns[3, j], columns[4, j], columns[5, j] = a, b, c
    normal, step = np.empty((count, count)), np.empty(count)
    for i in range(count):
        step[i] = 0.0
        for k in range(6):
            step[i] += columns[k, i] * error[k] * (place if k < 3 else 1.0)
        for j in range(i + 1):
            total = damping if i == j else 0.0
            for k in range(6):
                total += columns[k, i] * columns[k, j]
            normal[i, j] = total
    return _cholesky_solve(normal, step)


@compiled
def _cholesky_solve(lower: Array, value: Array) -> Array:
    """Solve A x = value in place, for the lower half of a positive definite A."""
    count = value.shape[0]
    for i in range(count):
        for j in range(i + 1):
            total = lower[i, j]
            for k in range(j):
                total -= lower[i, k] * lower[j, k]
            lower[i, j] = math.sqrt(total) if i == j else total / lower[j, j]
    for i in range(count):
        for k in range(i):
            value[i] -= lower[i, k] * value[k]
        value[i] /= lower[i, i]
    for i in range(count - 1, -1, -1):
        for k in range(i + 1, count):
            value[i] -= lower[k, i] * value[k]
        value[i] /= lower[i, i]
    return value
