"""What a field of `World` that disturbs a walk declares: names, limits and levels.

Imports nothing heavy, so that `--help` is fast.
"""

from dataclasses import dataclass
from typing import NamedTuple

from gaitchain.gait.limits import Limits

Span = tuple[float, float]
"""Lower and upper bound."""


class Exposure(NamedTuple):
    """Levels of a disturbance for one kind of walk, in the field's own unit."""

    trained: Span | float | None = None
    """Level in training: a span to draw from uniformly, or a value; None: nominal."""
    required: tuple[float, ...] = ()
    """Mild levels of the grid, at which a library must not fall to pass."""
    beyond: tuple[float, ...] = ()
    """Harder levels of the grid, walked to find the limits."""


_NONE = Exposure()


@dataclass(frozen=True, kw_only=True)
class Disturbance:
    """Properties of one field of `World` that disturbs a walk."""

    help: str
    """One sentence, shown by `--help`."""
    label: str
    """Name in tables and plots."""
    option: str
    """Name on the command line, without dashes."""
    limits: Limits | None = None
    """None if the field is not a number."""
    choices: tuple[str, ...] = ()
    """What it may be, if it is a word."""
    scale: float = 1.0
    """Factor from the field's unit to the one shown."""
    unit: str = ""
    """Unit shown after a level."""
    fault: bool = False
    """Whether it is one of servos or sensors."""
    needs: str = ""
    """Another disturbance without which this one does nothing."""
    key_poses: Exposure = _NONE
    """Levels for the paper's walks, trained open loop; see `exposure` for faults."""
    strides: Exposure = _NONE
    """Levels for walks of strides, with feedback."""

    def exposure(self, balanced: bool) -> Exposure:
        """Return the levels for walks with balance feedback, or without.

        The paper's walks are trained as the paper does. What the mild faults of servos
        and sensors do to them is measured in the grid, and required of nothing.
        """
        if balanced:
            return self.strides
        if self.fault and self.key_poses is _NONE:
            return Exposure(beyond=self.strides.required)
        return self.key_poses

    def show(self, level: float) -> str:
        """Return the name of a level, such as "slope +1 deg"."""
        signed = self.limits is not None and self.limits.low < 0.0 < level
        return f"{self.label} {'+' * signed}{self.scale * level:g}{self.unit}"

    def tell(self, value: object) -> str:
        """Return what a field is now, such as "payload 20 %" or "no punches"."""
        if isinstance(value, float):
            return self.show(value)
        return f"no {self.option}" if value is None else f"{self.option} {value}"
