"""The reduced biped as MuJoCo sees it."""

import numpy as np

from gaitchain.robot.box_robot import load_box_robot
from gaitchain.robot.joint_angles import joint_angles
from gaitchain.robot.kinematics import (
    points,
)

RES = load_box_robot("res")


MIRROR = np.array([1.0, -1.0, 1.0])


def mujoco_qpos(q, left_support):
    """Place MuJoCo's robot so that its support ankle is where the frame has it."""
    side = MIRROR if not left_support else np.ones(3)
    half_hips = np.array([0.0, -0.5 * RES.reduced.hip_width, 0.0])
    base = (points(RES.reduced, q)[2] + half_hips) * side
    trunk = [np.cos(0.5 * q[2]), 0.0, np.sin(0.5 * q[2]), 0.0]
    return np.concatenate([base, trunk, joint_angles(q, left_support)])
