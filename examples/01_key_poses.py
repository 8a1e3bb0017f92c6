# /// script
# dependencies = ["gaitchain"]
# ///
"""Make a pose of primitives, take it apart again, and see where it puts the ZMP.

1. Move, Lift and Swing compose a pose of the reduced biped.
2. Factorising it gives the parameters back, and what primitives do not explain.
3. At rest the ZMP is the CoM's projection.
"""

import numpy as np

from gaitchain.gait.keypose.primitives import PARAMETERS, compose, factorise
from gaitchain.gait.motion import State
from gaitchain.gait.zmp import zmp
from gaitchain.robot.box_robot import load_box_robot
from gaitchain.robot.kinematics import com

robot = load_box_robot("res")
# hip_x [m], hip_height [m], foot_x [m], foot_z [m], sway [rad]
wanted = np.array([0.02, 0.52, 0.10, 0.04, np.radians(12.0)])
pose = compose(robot, wanted)
factors = factorise(robot, pose)

print("joint angles [deg]:", np.degrees(pose).round(1))
for name, value in zip(PARAMETERS, factors.parameters, strict=True):
    print(f"{name:>10}: {value:.3f}")
print("unexplained [rad]:", np.abs(factors.residual).max().round(12))

still = np.zeros_like(pose)
print("ZMP at rest [m]:", zmp(robot, State(pose, still, still)).round(4))
print("CoM         [m]:", com(robot.reduced, pose)[:2].round(4))
