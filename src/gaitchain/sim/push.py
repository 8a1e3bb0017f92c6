"""Pushes and punches of a world as numbers; `push_force` makes forces of them.

Imports nothing heavy, so that `--help` is fast.
"""

import math
from dataclasses import dataclass
from typing import Annotated

from gaitchain.errors import CommandError
from gaitchain.gait.limits import Limits, check_numbers


@dataclass(frozen=True)
class Push:
    """A constant force on a body's CoM for some time."""

    impulse_ns: Annotated[float, Limits(0.0, 1e4)]
    """Force times duration [N s]."""
    direction_deg: Annotated[float, Limits(-360.0, 360.0)]
    """Relative to the trunk's heading: 0 pushes forward, +90 to the left [deg]."""
    at_s: Annotated[float, Limits(0.0, math.inf)]
    """Start of the push after the start of the walk (`start_clock`) [s]; a simulation
    that is pushed may have run for any time, a `World` plans for 1e6 s at most."""
    duration_s: Annotated[float, Limits(1e-3, 60.0)] = 0.1
    """Length of the push [s]."""
    elevation_deg: Annotated[float, Limits(-90.0, 90.0)] = 0.0
    """Of the force above the floor's plane [deg]."""
    body: str = "trunk"
    """Name of the body."""

    def __post_init__(self) -> None:
        """Refuse what cannot be.

        Raises:
            CommandError: a number is outside its limits.
        """
        check_numbers(self)

    def __str__(self) -> str:
        up = f", {self.elevation_deg:.0f} deg up" if self.elevation_deg else ""
        body = f" on {self.body}" if self.body != Push.body else ""
        to = f"{self.direction_deg:.4g} deg{up}{body}"
        return f"a push of {self.impulse_ns:.3g} N s to {to}"

    @property
    def ends_s(self) -> float:
        """End of the push after the start of the walk [s]."""
        return self.at_s + self.duration_s

    def axis(self, heading: float) -> tuple[float, float, float]:
        """Return the direction of the force, a unit vector.

        Args:
            heading: the trunk's [rad].
        """
        yaw = heading + math.radians(self.direction_deg)
        elevation = math.radians(self.elevation_deg)
        level = math.cos(elevation)
        return level * math.cos(yaw), level * math.sin(yaw), math.sin(elevation)

    def impulse_within(self, start_s: float, end_s: float) -> float:
        """Return the part of the impulse within an interval [N s]."""
        end = min(end_s, self.ends_s)
        overlap = max(0.0, end - max(start_s, self.at_s))
        return self.impulse_ns * overlap / self.duration_s


@dataclass(frozen=True)
class Punches:
    """Pushes of random strength and direction in space on random bodies.

    `push_force.draw_punches` draws them from the world's seed.
    """

    most_ns: Annotated[float, Limits(0.0, 1e4)]
    """Largest impulse [N s]."""
    every_s: Annotated[float, Limits(0.1, 1e6)] = 5.0
    """From one to the next, the first one so long after the start of the walk [s]."""
    duration_s: Annotated[float, Limits(1e-3, 60.0)] = 0.08
    """Length of each [s]."""

    def __post_init__(self) -> None:
        """Refuse what cannot be.

        Raises:
            CommandError: a number is outside its limits, or they last longer than from
                one to the next.
        """
        check_numbers(self)
        if self.duration_s > self.every_s:
            raise CommandError(
                f"duration_s is {self.duration_s:g}, must be at most every_s, "
                f"{self.every_s:g}"
            )

    def __str__(self) -> str:
        return f"of up to {self.most_ns:.3g} N s every {self.every_s:g} s"
