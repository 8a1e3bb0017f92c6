"""Limits of numbers, declared in the annotation of the number's field."""

import math
from dataclasses import dataclass
from numbers import Integral, Real
from typing import Any, TypeGuard, cast, get_type_hints

from gaitchain.errors import CommandError


@dataclass(frozen=True)
class Limits:
    """Allowed values of a number, both ends included."""

    low: float
    high: float
    whole: bool = False
    """Whether it must be an integer."""
    unit: str = ""
    """In which the value is given, if it has one."""

    def __str__(self) -> str:
        whole = "a whole number, " if self.whole else ""
        unit = f" {self.unit}" if self.unit else ""
        if self.high == math.inf:
            return f"{whole}at least {exact(self.low)}{unit}, inf for no limit"
        return f"{whole}{exact(self.low)} to {exact(self.high)}{unit}"

    def hold(self, value: object) -> bool:
        """Whether a value is a number within the limits."""
        kind = Integral if self.whole else Real
        if not isinstance(value, kind) or isinstance(value, bool):
            return False
        # Itself, because as a double it may be rounded past an end, or be too large.
        number = cast(Any, value)
        return bool(self.low <= number <= self.high) and (self.whole or is_real(number))

    def plain(self, number: Any) -> int | float:
        """Return a number within the limits as Python's own, which JSON takes."""
        return int(number) if self.whole else float(number)


def is_real(value: object) -> TypeGuard[float]:
    """Return whether a value is a number, NaN too, and not too large for a double."""
    if not isinstance(value, Real):
        return False
    try:
        float(value)
    except OverflowError:
        return False
    return True


def check_period(period_s: object) -> None:
    """Refuse a control period that is none.

    Raises:
        CommandError: it is no finite number above 0.
    """
    if not is_real(period_s) or not 0.0 < period_s < math.inf:
        raise CommandError(
            f"control period {period_s!r:.80}: need seconds above 0, as 0.01"
        )


def exact(number: float) -> str:
    """Write a number with all its digits: a value beyond a limit reads unlike it."""
    return str(number).removesuffix(".0")


def declared(kind: type[Any], what: type[Any]) -> dict[str, Any]:
    """Return the annotations of a class's fields by field name, in order.

    Args:
        kind: the class, such as `World`.
        what: class of the annotations, such as `Limits`.
    """
    hints = get_type_hints(kind, include_extras=True)
    found = ((n, m) for n, h in hints.items() for m in getattr(h, "__metadata__", ()))
    return {name: mark for name, mark in found if isinstance(mark, what)}


def check_numbers(numbers: object) -> None:
    """Refuse an object that has a field outside its declared limits.

    A field declares `Limits`, or an annotation that has them as `limits`. None is
    allowed where it is the default.

    Raises:
        CommandError: a field is outside its limits; the message names the first one.
    """
    kind: type[Any] = type(numbers)
    for name, mark in declared(kind, object).items():
        allowed = mark if isinstance(mark, Limits) else getattr(mark, "limits", None)
        value = getattr(numbers, name)
        optional = getattr(kind, name, 0.0) is None
        if allowed is None or (value is None and optional):
            continue
        if not allowed.hold(value):
            raise CommandError(f"{name} is {value!r}, must be {allowed}")
