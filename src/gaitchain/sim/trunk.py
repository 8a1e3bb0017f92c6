"""The trunk among a simulated robot's coordinates: free, or held and without any."""

from typing import NamedTuple

import mujoco
import numpy as np

from gaitchain.messages import Array

_POSE, _TWIST = 7, 6  # positions and rates of a free joint


class Trunk(NamedTuple):
    """Where the trunk is; views, unless it is held."""

    pose: Array
    """(7,) position [m] and unit quaternion (w, x, y, z)."""
    twist: Array
    """(6,) linear and angular velocity of its free joint [m/s, rad/s]."""


def count_trunk(model: mujoco.MjModel) -> tuple[int, int]:
    """Return how many of a robot's first positions and rates are its trunk's."""
    free = model.body("trunk").dofnum[0] == _TWIST
    return (_POSE, _TWIST) if free else (0, 0)


def trunk_of(model: mujoco.MjModel, data: mujoco.MjData) -> Trunk:
    """Return the trunk of a simulated robot, whose memory must not be reallocated."""
    if any(count_trunk(model)):
        return Trunk(data.qpos[:_POSE], data.qvel[:_TWIST])
    body = model.body("trunk")
    return Trunk(np.concatenate([body.pos, body.quat]), np.zeros(_TWIST))
