"""Functions of one number: saturation, dead zone, cubic. Compiled."""

from gaitchain.balance.compiled import compiled


@compiled
def clip(value: float, low: float, high: float) -> float:
    """Return the value, held between its bounds."""
    return min(max(value, low), high)


@compiled
def beyond(error: float, zone: float) -> float:
    """Return the part of an error that lies outside a dead zone around 0."""
    if error > zone:
        return error - zone
    if error < -zone:
        return error + zone
    return 0.0


@compiled
def hermite(
    start: float, rate: float, end: float, end_rate: float, span: float, time: float
) -> tuple[float, float, float]:
    """Evaluate the cubic with given values and rates at both ends.

    Args:
        start: value at the beginning.
        rate: its rate there [1/s].
        end: value at the end.
        end_rate: its rate there [1/s].
        span: time from beginning to end, above 0 [s].
        time: since the beginning [s].

    Returns:
        Value, rate [1/s] and acceleration [1/s^2].
    """
    slope = (end - start) / span
    a = (rate + end_rate - 2.0 * slope) / span**2
    b = (3.0 * slope - 2.0 * rate - end_rate) / span
    value = ((a * time + b) * time + rate) * time + start
    return value, (3.0 * a * time + 2.0 * b) * time + rate, 6.0 * a * time + 2.0 * b
