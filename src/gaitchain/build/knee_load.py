"""What a knee holds while its leg bears the robot: from geometry, before any physics.

For most of a step one leg bears the weight m g, whatever the walk, and its knee is the
distance x ahead of the vertical through the ankle; so on average its servo holds

    tau = m g x,                                                                (1)

less the weight of what is below it. The hips above the ankle hold next to nothing, and
what holds the trunk upright depends on the walk. Ours.
"""

import numpy as np

from gaitchain.balance.feedforward import LegLoad, holding_torques
from gaitchain.balance.leg_kinematics import posture
from gaitchain.gait.motion import Timing
from gaitchain.gait.stride.strides import StridePoses
from gaitchain.messages import GRAVITY
from gaitchain.walker.stride_setup import make_walk


def overload(poses: StridePoses, timing: Timing) -> str:
    """Return which knee cannot bear the robot as it stands, and by how much.

    Args:
        poses: the candidates, with the height of the hips.
        timing: the step's times.

    Returns:
        A phrase; empty if both knees can.
    """
    walk, robot = make_walk(poses, timing), poses.robot.legs
    legs, count = walk.legs, len(robot.joint_names) // 2
    found = posture(legs, walk.stand)
    weight = GRAVITY * float(legs.trunk_mass + legs.link_mass.sum())
    load = LegLoad(np.array([0.0, 0.0, weight]), 0.0, 0.0, 0.0)
    for leg in range(2):
        joint = leg * count + legs.knee
        torques = holding_torques(legs, found, leg, load, np.zeros((count, 3)))
        needed, limit = abs(torques[legs.knee]), robot.torque_limit[joint]
        if needed > limit:
            return (
                f"{robot.joint_names[joint]} would have to hold {needed:.3g} N m while "
                f"its leg bears the robot, its limit is {limit:.3g}"
            )
    return ""
