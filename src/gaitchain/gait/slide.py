"""How far feet usually slide over the floor, which legs and gyro cannot measure. Ours.

A foot that lands late, or while the servos still catch up with its targets, slides. In
physics it is much the same in each step of a robot, and beside that grows with the
square of the way, so a step of which the legs measure the way (x, y) goes

    x + c + k x^2 ahead,  y + k_y y |y| to the left,

k one number ahead and another back.
"""

from typing import NamedTuple


class Slide(NamedTuple):
    """What is to be added to a measured step."""

    each: float = 0.0
    """c: ahead, of each step [m]."""
    ahead: float = 0.0
    """k of a step ahead [1/m]."""
    back: float = 0.0
    """k of a step back [1/m]; ahead, too, where it is positive."""
    left: float = 0.0
    """k_y: to the side to which the step goes [1/m]."""

    def of_step(self, ahead: float, left: float) -> tuple[float, float]:
        """Return the usual slide of a step, by what is measured of it [m]."""
        bend = self.ahead if ahead > 0.0 else self.back
        return self.each + bend * ahead**2, self.left * left * abs(left)


class Slides(NamedTuple):
    """The usual slides of one library."""

    steps: Slide = Slide()
    """Of a place that adds up steps, each as it was measured when it ended."""
    trunk: Slide = Slide()
    """Of one that follows the trunk over the foot that stands."""
