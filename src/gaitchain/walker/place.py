"""Places on the floor with a heading, in one another's frames."""

import math
from typing import NamedTuple

from gaitchain.errors import CommandError
from gaitchain.gait.limits import is_real


class Place(NamedTuple):
    """A place on the floor with a heading: x, y [m] and yaw [rad]."""

    x: float = 0.0
    """[m]"""
    y: float = 0.0
    """[m]"""
    yaw: float = 0.0
    """To the left [rad]."""

    def seen_from(self, other: "Place") -> "Place":
        """Return the place in the frame of another one, ahead and to the left."""
        dx, dy = self.x - other.x, self.y - other.y
        cos, sin = math.cos(other.yaw), math.sin(other.yaw)
        turn = math.remainder(self.yaw - other.yaw, math.tau)
        return Place(cos * dx + sin * dy, cos * dy - sin * dx, turn)

    def moved(self, ahead: float, left: float) -> "Place":
        """Return the place that is so far ahead and to the left, same heading [m]."""
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        return self._replace(
            x=self.x + cos * ahead - sin * left, y=self.y + sin * ahead + cos * left
        )


ORIGIN = Place()
"""Where a robot stands at its start."""
_FURTHEST_M = 1000.0


def check_place(place: Place, name: str = "goal") -> None:
    """Refuse a place to which no robot is sent.

    Args:
        place: the place.
        name: what it is, for the message.

    Raises:
        CommandError: it is none, not finite, or further than 1 km away.
    """
    if not isinstance(place, Place):
        raise CommandError(f"{name} {place!r}: give a Place, such as Place(1.0, 0.5)")
    if not all(is_real(n) and abs(n) <= _FURTHEST_M for n in place):
        raise CommandError(
            f"{name} {tuple(place)!r:.80}: x, y and yaw must be numbers within "
            f"+-{_FURTHEST_M:g} m and rad"
        )
