"""How a disturbance is declared: once, and all that needs it reads it there.

A field of `World` carries a `Disturbance` in its annotation. From it come the limits
and their error messages, the options of the command line with their help
(`cli.options`), the names and units in tables and plots, the levels of the grid
(`build.grid`), and the range that random worlds are drawn from (`world_range`). This
module and `world` load nothing heavy, so that `--help` answers at once.
"""

import math
from dataclasses import dataclass
from numbers import Integral, Real
from typing import Any, NamedTuple, cast, get_type_hints

from gaitchain.errors import CommandError

Span = tuple[float, float]
"""Least and most."""


class Exposure(NamedTuple):
    """What one kind of walk meets of a disturbance; levels in the field's own unit."""

    trained: Span | float | None = None
    """In training: drawn uniformly from a span, or one value; None is nominal."""
    required: tuple[float, ...] = ()
    """Mild levels of the grid: a library that falls here does not pass."""
    beyond: tuple[float, ...] = ()
    """Harder levels, walked to know where the limits are."""


_NONE = Exposure()


@dataclass(frozen=True)
class Limits:
    """Allowed values of a number, both ends included."""

    low: float
    high: float
    whole: bool = False

    def __str__(self) -> str:
        whole = "a whole number, " if self.whole else ""
        if self.high == math.inf:
            return f"{whole}at least {self.low:.9g}, inf for no limit"
        return f"{whole}{self.low:.9g} to {self.high:.9g}"

    def hold(self, value: object) -> bool:
        """Whether something is a number within the limits."""
        kind = Integral if self.whole else Real
        number = isinstance(value, kind) and not isinstance(value, bool)
        return number and self.low <= float(cast(Real, value)) <= self.high


@dataclass(frozen=True, kw_only=True)
class Disturbance:
    """All that is to be known of one field of `World` that disturbs a walk."""

    help: str
    """A sentence, for `--help` too."""
    label: str
    """Name in tables and plots."""
    option: str
    """Name on the command line, without dashes."""
    limits: Limits | None = None
    """None for what is no number."""
    scale: float = 1.0
    """From the field's unit to the one that is shown."""
    unit: str = ""
    """Shown after a level."""
    key_poses: Exposure = _NONE
    """For the paper's walks, trained open loop."""
    strides: Exposure = _NONE
    """For walks that balance."""

    def exposure(self, dynamic: bool) -> Exposure:
        """Return what walks of one kind meet."""
        return self.strides if dynamic else self.key_poses

    def show(self, level: float) -> str:
        """Name a level, such as "slope +1 deg"."""
        signed = self.limits is not None and self.limits.low < 0.0 < level
        return f"{self.label} {'+' * signed}{self.scale * level:g}{self.unit}"


def declared(kind: type[Any], what: type[Any]) -> dict[str, Any]:
    """Return the declarations of a class's fields, by name, in order.

    Args:
        kind: the class, such as `World`.
        what: `Disturbance` or `Limits`.
    """
    hints = get_type_hints(kind, include_extras=True)
    found = ((n, m) for n, h in hints.items() for m in getattr(h, "__metadata__", ()))
    return {name: mark for name, mark in found if isinstance(mark, what)}


def check_numbers(numbers: object) -> None:
    """Refuse a field outside its declared limits; one that may be None may stay so.

    Raises:
        CommandError: names the first such field.
    """
    kind: type[Any] = type(numbers)
    limits = declared(kind, Limits) | {
        name: disturbance.limits
        for name, disturbance in declared(kind, Disturbance).items()
        if disturbance.limits is not None
    }
    for name, allowed in limits.items():
        value = getattr(numbers, name)
        optional = getattr(kind, name, 0.0) is None
        if not (value is None and optional) and not allowed.hold(value):
            raise CommandError(f"{name} is {value!r}, must be {allowed}")
