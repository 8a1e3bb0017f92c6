"""Set-up of the walk controller for a robot's strides: legs, gains and step times."""

import numpy as np

from gaitchain.balance.gains import derive_gains
from gaitchain.balance.leg_ik import leg_joints
from gaitchain.balance.leg_kinematics import (
    Legs,
    Posture,
    com_from_pelvis,
    legs_of,
    posture,
)
from gaitchain.balance.state import step_times
from gaitchain.balance.walk_controller import WalkController
from gaitchain.gait.motion import Timing
from gaitchain.gait.stride.strides import StridePoses
from gaitchain.messages import CONTROL_PERIOD_S

_ROUNDS = 16  # iterations; each reduces the error of the CoM about fourfold


def make_walk(
    poses: StridePoses,
    timing: Timing,
    period_s: float = CONTROL_PERIOD_S,
    *,
    feedback: bool = True,
) -> WalkController:
    """Create the walk controller of a standing robot, gains derived from the robot.

    Args:
        poses: the candidates.
        timing: the step's times.
        period_s: control period [s].
        feedback: whether to balance; otherwise the plan runs in open loop.
    """
    legs = legs_of(poses.robot)._replace(hip_width=poses.stance)
    gains = derive_gains(legs, poses.balance)
    legs, com_height = centred(legs, poses.hip_height, gains.foot_zmp.x)
    times = step_times(timing, poses.hip_height, com_height, period_s)
    return WalkController(legs, gains, times, feedback=feedback)


def centred(legs: Legs, hip_height: float, ahead: float) -> tuple[Legs, float]:
    """Move the pelvis frame's origin to below the CoM of the standing robot.

    The pendulum model moves that point, so that its ZMP is the robot's.

    Args:
        legs: the robot.
        hip_height: hips above the ankles in the standing pose [m].
        ahead: CoM ahead of the ankles in the standing pose [m].

    Returns:
        The robot, and the height of its CoM above the ground [m].
    """
    com = np.zeros(3)
    for _ in range(_ROUNDS):
        com = com_from_pelvis(legs, _standing(legs, hip_height, com[0] - ahead))
    lead = np.array([com[0], 0.0, 0.0])
    at = np.array(legs.at)
    at[:, 0] -= lead
    moved = at, legs.trunk_com - lead
    for array in moved:
        array.setflags(write=False)
    height = hip_height + legs.ankle_height + float(com[2])
    return legs._replace(at=moved[0], trunk_com=moved[1]), height


def _standing(legs: Legs, hip_height: float, ankle_x: float) -> Posture:
    """Return the posture on level soles with both ankles at x = `ankle_x` [m]."""
    start = np.array(legs.start)  # a copy that may be written to, as all others are
    joints, count = start.copy(), len(start) // 2
    for leg in range(2):
        ankle = np.array([ankle_x, (0.5 - leg) * legs.hip_width, -hip_height])
        own = slice(leg * count, (leg + 1) * count)
        joints[own] = leg_joints(legs, leg, ankle, np.eye(3), start[own])
    return posture(legs, joints)
