"""Bounds, and numbers that must lie within them in every control period. Compiled."""

from gaitchain.balance.compiled import compiled
from gaitchain.messages import Array


@compiled
def sane(
    joints: Array, rates: Array, gyro: Array, accelerometer: Array, most: Array
) -> bool:
    """Return whether every measurement is a number of a size below its limit.

    Args:
        joints: (2 n,) [rad].
        rates: (2 n,) [rad/s].
        gyro: (3,) [rad/s].
        accelerometer: (3,) [m/s^2].
        most: (4,) limits, of each of these arrays.
    """
    for i in range(len(joints)):
        if not (abs(joints[i]) < most[0] and abs(rates[i]) < most[1]):
            return False
    for i in range(len(gyro)):
        if not (abs(gyro[i]) < most[2] and abs(accelerometer[i]) < most[3]):
            return False
    return True


@compiled
def inside(values: Array, lower: Array, upper: Array) -> bool:
    """Return whether every value is a number from its lower to its upper bound."""
    for i in range(len(values)):  # noqa: SIM110 - Numba compiles no generators
        if not lower[i] <= values[i] <= upper[i]:
            return False
    return True
