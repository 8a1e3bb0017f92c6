"""Bounds, and numbers that must lie within them in every control period. Compiled."""

from gaitchain.balance.compiled import compiled
from gaitchain.balance.gains import Gains
from gaitchain.balance.leg_kinematics import Legs
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


@compiled
def zmp_ends(legs: Legs, gains: Gains) -> tuple[float, float]:
    """Return between which x of a foot its ZMP may be, from the ankle [m]."""
    rear = max(legs.zmp_rear, gains.firm_rear)
    return rear, min(legs.zmp_front, gains.firm_front)
