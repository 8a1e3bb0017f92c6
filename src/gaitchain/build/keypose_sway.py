"""The largest sway that a robot's joints allow, by its own inverse kinematics."""

import numpy as np

from gaitchain.balance.pose_joints import PoseJoints
from gaitchain.gait.keypose.feasibility import headroom
from gaitchain.gait.keypose.presets import CROUCH
from gaitchain.gait.keypose.primitives import compose

_STEPS = 200
_FURTHEST = 0.6  # rad


def most_sway(joints: PoseJoints) -> float:
    """Return the largest sway within reach and headroom of all joints [rad].

    The robot stands with its feet side by side, in the crouch of the preset.

    Args:
        joints: of the robot.
    """
    robot = joints.robot
    lower, upper = headroom(robot)
    sways = np.linspace(0.0, _FURTHEST, _STEPS)
    poses = np.zeros((_STEPS, 5))
    poses[:, 1], poses[:, 4] = CROUCH * robot.reduced.leg_length, sways
    angles = joints.reached(compose(robot, poses), True)
    inside = (angles >= lower) & (angles <= upper)  # false for NaN
    beyond = np.flatnonzero(~np.all(inside, axis=-1))
    return float(sways[max(beyond[0] - 1, 0)] if beyond.size else sways[-1])
