"""Ranges of worlds to draw from, so that the physics varies from walk to walk."""

import math
from typing import Any

import numpy as np

from gaitchain.errors import CommandError
from gaitchain.sim.disturbance import Span
from gaitchain.sim.push import Push
from gaitchain.sim.world import DISTURBANCES, World

_PUSHED = 0.5  # probability that a walk is pushed


def trained(*, balanced: bool) -> dict[str, Span | float]:
    """Return the training levels for one kind of walk, without pushes."""
    found = {n: d.exposure(balanced).trained for n, d in DISTURBANCES.items()}
    return {n: v for n, v in found.items() if v is not None and n != "push"}


_KEY_POSES = trained(balanced=False)
_ALWAYS = tuple(
    name for name, v in _KEY_POSES.items() if isinstance(v, tuple) and v[0] < v[1]
)
"""Fields drawn for every walk: friction, servo gain and mass."""
_FAULTS = {n: v for n, v in trained(balanced=True).items() if DISTURBANCES[n].fault}
"""Faults of servos and sensors, and their levels in the training of strides."""


class WorldRange:
    """A range of worlds: each number is drawn uniformly from a span, or fixed.

    By default the training worlds of the paper's walks, without pushes.
    """

    def __init__(
        self,
        push_ns: float = 0.0,
        speed_limit_deg_s: float | None = None,
        **numbers: Span | float,
    ) -> None:
        """Set spans and values in place of the defaults.

        Args:
            push_ns: largest impulse of the push, which half of the walks get between
                0.5 and 4 s [N s].
            speed_limit_deg_s: speed limit of the servos [deg/s]; None is the robot's.
            numbers: other fields of `World`: (lower, upper) bound, or one value.

        Raises:
            CommandError: `World` has no such field, or cannot draw it from such a span.
        """
        unknown = [n for n in numbers if n not in DISTURBANCES or n == "push"]
        if unknown:
            known = ", ".join(n for n in DISTURBANCES if n != "push")
            raise CommandError(f"{unknown[0]}: no number of a world; known: {known}")
        for name, value in numbers.items():
            if isinstance(value, tuple):
                _check_span(name, value)
        self.push_ns, self.speed_limit_deg_s = push_ns, speed_limit_deg_s
        given = _KEY_POSES | numbers
        self.numbers = {n: given[n] for n in DISTURBANCES if n in given}

    def facts(self) -> dict[str, Any]:
        """Return the constructor arguments: `WorldRange(**facts)` is the same range."""
        own = {"push_ns": self.push_ns, "speed_limit_deg_s": self.speed_limit_deg_s}
        return {**self.numbers, **own}

    def but(self, **changes: Any) -> "WorldRange":
        """Return a copy of the range with some arguments changed."""
        return WorldRange(**{**self.facts(), **changes})

    def sound(self) -> "WorldRange":
        """Return the range without the faults of training.

        What a fault costs a robot that has it is not to be taken from all others, so
        speeds are judged in these worlds. What is unsure of an identified robot stays.
        """
        own = self.numbers
        wanted = {
            n: getattr(World, n) for n, level in _FAULTS.items() if own.get(n) == level
        }
        return self.but(**wanted)

    def harder(self) -> "WorldRange":
        """Return the sound range with twice the model error."""
        error = self.numbers["model_error"]
        twice = (2 * error[0], 2 * error[1]) if isinstance(error, tuple) else 2 * error
        return self.sound().but(model_error=twice)

    def draw(self, rng: np.random.Generator) -> World:
        """Draw one world."""
        drawn = {name: self._draw(name, rng) for name in _ALWAYS}
        limit = self.speed_limit_deg_s
        if not (self.push_ns or any(map(self._varies, self.numbers))):
            return World(**drawn, speed_limit_deg_s=limit)
        # Drawn also without pushes, so that the other numbers do not change.
        impulse_ns = float(rng.uniform(0.0, self.push_ns))
        direction_deg = float(rng.uniform(-180.0, 180.0))
        push = Push(impulse_ns, direction_deg, at_s=float(rng.uniform(0.5, 4.0)))
        drawn |= {n: self._draw(n, rng) for n in self.numbers if n not in _ALWAYS}
        seed = int(rng.integers(2**31))
        pushed = bool(rng.random() < _PUSHED) and self.push_ns > 0.0
        return World(**drawn, seed=seed, push=(push,) * pushed, speed_limit_deg_s=limit)

    def _draw(self, name: str, rng: np.random.Generator) -> Any:
        value = self.numbers[name]
        return float(rng.uniform(*value)) if isinstance(value, tuple) else value

    def _varies(self, name: str) -> bool:
        """Return whether a field outside `_ALWAYS` is not at its nominal value."""
        value, nominal = self.numbers[name], getattr(World, name)
        return name not in _ALWAYS and value not in (nominal, (nominal, nominal))


def _check_span(name: str, span: tuple[Any, ...]) -> None:
    limits = DISTURBANCES[name].limits
    if limits is None:
        raise CommandError(f"{name} is {span!r}, must be one value: it is no number")
    held = len(span) == 2 and all(map(limits.hold, span))
    if not (held and span[0] <= span[1] < math.inf):
        raise CommandError(
            f"{name} is {span!r}, must be two finite numbers, the lower one first, "
            f"each {limits}, or one value"
        )
