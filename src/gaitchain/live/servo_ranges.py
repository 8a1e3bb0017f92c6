"""The ranges of a robot's joints as its servos have them."""

import numpy as np

from gaitchain.backends.base import Backend, Bounded
from gaitchain.errors import BackendError
from gaitchain.robot.robot import Robot
from gaitchain.walker.mounting import Mounting


def within_servos(
    robot: Robot, backend: Backend, mounting: Mounting | None = None
) -> Robot:
    """Return a robot whose joints turn no further than its servos do.

    Args:
        robot: as in its file.
        backend: its servos, connected.
        mounting: how their encoders are mounted, if not as in the file.

    Raises:
        BackendError: a servo turns where its joint never is.
    """
    if not isinstance(backend, Bounded):
        return robot
    legs, (lower, upper) = robot.legs, backend.limits
    if mounting is not None:
        lower, upper = mounting.angles(lower), mounting.angles(upper)
    apart = np.minimum(upper, legs.upper) <= np.maximum(lower, legs.lower)
    if apart.any():
        at = int(np.argmax(apart))
        low, high, least, most = np.degrees(
            [lower[at], upper[at], legs.lower[at], legs.upper[at]]
        )
        raise BackendError(
            f"{legs.joint_names[at]}: its servo may turn from {low:.0f} to {high:.0f} "
            f"deg, the robot's joint from {least:.0f} to {most:.0f}; calibrate it again"
        )
    return robot.with_ranges(lower, upper)
