"""Ends of intervals as texts that say no more than what is sure. Ours."""

from decimal import ROUND_CEILING, ROUND_FLOOR, Decimal

_DIGITS = 2


def interval_text(low: float, high: float) -> str:
    """Return "LOW to HIGH" with two digits, rounded outward.

    Args:
        low: lower end, 0 or more.
        high: upper end.
    """
    return f"{_rounded(low, ROUND_FLOOR)} to {upper_text(high)}"


def upper_text(high: float) -> str:
    """Return an upper end with two digits, rounded up.

    Args:
        high: the end, 0 or more.
    """
    return _rounded(high, ROUND_CEILING)


def _rounded(value: float, way: str) -> str:
    exact = Decimal(repr(float(value)))  # as it is written: 0.01 is no more than that
    digit = Decimal(1).scaleb(exact.adjusted() - _DIGITS + 1)
    return f"{float(exact.quantize(digit, way)):.{_DIGITS}g}"
