"""How far feet usually slide over the floor, which legs and gyro cannot measure. Ours.

A foot that lands late, or while the servos still catch up with its targets, slides. In
physics it is much the same in each step of a robot, and beside that in proportion to
the way, so N steps of which the legs measure the way (x, y) go

    x + c N + s_x x ahead,  y + s_y y to the left.
"""

from typing import NamedTuple


class Slide(NamedTuple):
    """What is to be added to a measured way."""

    each: float = 0.0
    """c: ahead, of each step [m]."""
    ahead: float = 0.0
    """s_x: ahead, as a part of the way ahead."""
    left: float = 0.0
    """s_y: to the left, as a part of the way to the left."""

    def of_step(self, ahead: float, left: float) -> tuple[float, float]:
        """Return the usual slide of a step, by what is measured of it [m]."""
        return self.each + self.ahead * ahead, self.left * left


class Slides(NamedTuple):
    """The usual slides of one library."""

    steps: Slide = Slide()
    """Of a place that adds up steps, each as it was measured when it ended."""
    trunk: Slide = Slide()
    """Of one that follows the trunk over the foot that stands."""
