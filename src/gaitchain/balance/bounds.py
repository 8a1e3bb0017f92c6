"""Bounds, and numbers that must lie within them in every control period. Compiled."""

from gaitchain.balance.compiled import compiled
from gaitchain.messages import Array


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
def inside(values: Array, lower: Array, upper: Array) -> bool:
    """Return whether every value is a number from its lower to its upper bound."""
    for i in range(len(values)):  # noqa: SIM110 - Numba compiles no generators
        if not lower[i] <= values[i] <= upper[i]:
            return False
    return True
