"""Heel-off: a foot behind the robot pitches about its toes where its leg ends.

With flat feet the stretched hind leg ends the stride. Compiled, ours.
"""

import math

import numpy as np

from gaitchain.balance.compiled import compiled
from gaitchain.balance.curves import clip
from gaitchain.balance.leg_kinematics import Legs, place_leg, unplaced
from gaitchain.balance.rotations import product, rotation, turned, turned_back
from gaitchain.messages import Array

_MOST = 0.7  # rad


@compiled
def heel_lift(
    legs: Legs, leg: int, ankle: Array, foot: Array, start: Array, stretched: float
) -> float:
    """Return how far a hind foot pitches about its toes, so that its leg reaches [rad].

    With v from the hip to the toes and r from the toes to the ankle joint, both in the
    level foot's axes, |v + R_y(pitch) r| is to be the length of the leg.

    Args:
        legs: the robot.
        leg: 0 left, 1 right.
        ankle: (3,) ankle point of the level foot, pelvis frame [m].
        foot: (3, 3) its rotation.
        start: (n,) joint angles of a moment ago [rad].
        stretched: part of the leg's reach that it may be long.

    Returns:
        0 where the leg reaches the level foot, and for one ahead of the hip.
    """
    way, arm = _leg_line(legs, leg, ankle, foot, start)
    most, line = stretched * legs.reach, way + arm
    if line[0] >= 0.0 or line[0] ** 2 + line[1] ** 2 + line[2] ** 2 <= most**2:
        return 0.0
    x, z = arm[0] - legs.sole_front, arm[2] + legs.ankle_height
    toe_x, toe_z = way[0] + legs.sole_front, way[2] - legs.ankle_height
    level, lifted = toe_x * x + toe_z * z, toe_x * z - toe_z * x
    rest = most**2 - toe_x**2 - toe_z**2 - line[1] ** 2 - x**2 - z**2
    part = clip(0.5 * rest / math.hypot(level, lifted), -1.0, 1.0)
    return clip(math.atan2(lifted, level) + math.acos(part), 0.0, _MOST)


@compiled
def _leg_line(
    legs: Legs, leg: int, ankle: Array, foot: Array, start: Array
) -> tuple[Array, Array]:
    """Return the way from hip to ankle point, and from there to the ankle joint.

    Arguments are the first ones of `heel_lift`.

    Returns:
        Both (3,), in the axes of the level foot [m].
    """
    found = unplaced(start.shape[0])
    place_leg(legs, leg, start, found)
    hip, end = found.centres[leg, legs.knee - 1], found.centres[leg, legs.knee + 1]
    way = turned_back(foot, ankle - hip)
    arm = turned_back(found.feet[leg], end - found.ankles[leg])
    return way, arm


@compiled
def pitched(legs: Legs, ankle: Array, foot: Array, pitch: float) -> tuple[Array, Array]:
    """Return a foot's ankle point and rotation once it is pitched about its toes.

    Args:
        legs: the robot.
        ankle: (3,) ankle point of the level foot [m].
        foot: (3, 3) its rotation.
        pitch: heel up [rad].
    """
    at = ankle + turned(foot, toe_roll(legs, pitch))
    return at, product(foot, rotation(0.0, pitch, 0.0))


@compiled
def toe_roll(legs: Legs, pitch: float) -> Array:
    """Return how far the ankle point moves as a foot pitches about its toes, (3,) [m].

    Args:
        legs: the robot.
        pitch: heel up [rad].

    Returns:
        In the axes of the level foot.
    """
    cos, sin = math.cos(pitch), math.sin(pitch)
    front, height = legs.sole_front, legs.ankle_height
    moved = np.zeros(3)
    moved[0] = front * (1.0 - cos) + height * sin
    moved[2] = front * sin - height * (1.0 - cos)
    return moved
