"""The bodies of a simulated robot, by name and by number; without the simulator."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from gaitchain.errors import CommandError
from gaitchain.robot.leg_model import LegModel
from gaitchain.robot.robot import Robot
from gaitchain.sim.push import Push

SIDES = ("left", "right")
ANY_BODY = "any"
"""Instead of a body's name: one is drawn, each with its part of the robot's mass."""
FOOT = "foot"
BOXES = ("femur", "crus", FOOT)
"""Bodies of a leg of the box robot, from hip to ankle."""


def body_names(robot: Robot) -> tuple[str, ...]:
    """Return the bodies of a simulated robot, the trunk first, then the left leg's."""
    legs = enumerate(SIDES)
    return Push.body, *(f"{s}_{p}" for leg, s in legs for p in _leg_parts(robot, leg))


def _leg_parts(robot: Robot, leg: int) -> tuple[str, ...]:
    if robot.boxes:
        return BOXES
    full = robot.legs
    own = (j for j in range(full.leg_joints) if has_own_body(full, leg, j))
    return *map(link_part, own), FOOT


def link_part(joint: int) -> str:
    """Return the name of a full robot's link beyond a joint, without its side."""
    return f"link_{joint + 1}"


def has_own_body(full: LegModel, leg: int, joint: int) -> bool:
    """Return whether a joint needs its own body: it is not at the previous joint."""
    apart = bool(np.any(full.at[leg, joint] != 0.0))
    return joint == 0 or apart or bool(full.link_mass[leg, joint - 1] > 0.0)


def check_body(name: str, bodies: Iterable[str]) -> None:
    """Refuse the name of a body that a robot does not have.

    Raises:
        CommandError: it is none of the bodies.
    """
    if name not in bodies:
        raise CommandError(f"body {name!r}: the robot has {', '.join(bodies)}")


def subtree(model: Any, body: int) -> list[int]:
    """Return a body of a model and all that hang on it.

    Args:
        model: the compiled `mujoco.MjModel`.
        body: its number.

    Returns:
        Numbers of bodies in rising order.
    """
    found = [body]
    for other in range(body + 1, model.nbody):  # parents come first
        if model.body_parentid[other] in found:
            found.append(other)
    return found
