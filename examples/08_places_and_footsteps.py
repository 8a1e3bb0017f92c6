# /// script
# requires-python = ">=3.11"
# dependencies = ["gaitchain[sim]"]
# ///
"""Go to a place, then make given footsteps there, with the library that ships.

Shown: `Walker.go_to`, `Walker.follow_steps`, and what a step that cannot be made says.
"""

import math
from pathlib import Path

import gaitchain
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.errors import CommandError
from gaitchain.gait.library_file import load_library
from gaitchain.walker.footsteps import Footstep
from gaitchain.walker.place import Place
from gaitchain.walker.walker import Walker

library = load_library(Path(gaitchain.__file__).parent / "data" / "res.gait")
walker, robot = Walker(library), MujocoBackend(library.robot)
robot.connect(walker.stand)


def walk(seconds: float) -> None:
    for _ in range(round(seconds / walker.period_s)):
        robot.write(walker.step(robot.read()).position)


walk(1.5)  # the vertical and the gyro's bias are learned while it stands
walker.go_to(Place(x=0.4, y=0.2, yaw=math.radians(45.0)))  # [m, m, rad]
while not walker.arrived:
    walk(0.1)
here = walker.place
print(f"at {here.x:.2f}, {here.y:.2f} m, {math.degrees(here.yaw):.0f} deg by its steps")

half = 0.5 * library.poses.stance  # [m] from the middle to each ankle


def foot(left: bool, ahead: float) -> Footstep:
    """Return a landing so far ahead of where the robot stands [m]."""
    place = here.moved(ahead, half if left else -half)
    return Footstep(left, *place)


try:
    walker.follow_steps([foot(True, 0.9)])
except CommandError as error:
    print(f"refused: {error}")
walker.follow_steps([foot(True, 0.1), foot(False, 0.2), foot(True, 0.2)])
walk(5.0)
gone = walker.place.seen_from(here)
print(f"three footsteps: {gone.x:.2f} m ahead, {gone.y:.2f} m aside")
