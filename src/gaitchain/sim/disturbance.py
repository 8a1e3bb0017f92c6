"""How a disturbance is declared: once, and all that needs it reads it there.

A field of `World` carries a `Disturbance` in its annotation. From it come the limits
and their error messages, the options of the command line with their help
(`cli.options`), the names and units in tables and plots, the levels of the grid
(`build.grid`), and the range that random worlds are drawn from (`world_range`). This
module and `world` load nothing heavy, so that `--help` answers at once.
"""

from dataclasses import dataclass
from typing import NamedTuple

from gaitchain.gait.limits import Limits

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

    def exposure(self, balanced: bool) -> Exposure:
        """Return what walks of one kind meet."""
        return self.strides if balanced else self.key_poses

    def show(self, level: float) -> str:
        """Name a level, such as "slope +1 deg"."""
        signed = self.limits is not None and self.limits.low < 0.0 < level
        return f"{self.label} {'+' * signed}{self.scale * level:g}{self.unit}"
