"""The ankles of the paper's walk: how far they push."""

import numpy as np
import pytest

from gaitchain.balance.gains import derive_gains
from gaitchain.balance.keypose_balance import JointMotion, Stance, correct_ankles
from gaitchain.balance.leg_kinematics import legs_of
from gaitchain.balance.state import Attitude
from gaitchain.messages import GRAVITY
from gaitchain.robot.box_robot import load_box_robot

LEGS = legs_of(load_box_robot("res"))
ANKLE = LEGS.knee + 1


@pytest.mark.parametrize(
    ("front", "rear", "pitch", "most"),
    [
        (0.05, -0.13, 0.5, 0.05),
        (0.05, -0.13, -0.5, 0.13),
        (0.13, -0.09, 0.5, 0.09),
        (0.13, -0.09, -0.5, 0.09),
    ],
)
def test_an_ankle_pushes_no_further_than_its_sole(front, rear, pitch, most):
    """Statics: at a ZMP of x ahead of the ankle that bears m g, it pushes m g x."""
    legs, joints = LEGS._replace(sole_front=front, sole_rear=rear), np.zeros(12)
    still = JointMotion(joints, np.zeros(12))
    stance = Stance(Attitude(0.0, pitch), 5.0, 1.0, True)
    found = correct_ankles(legs, derive_gains(legs), stance, still, still)
    pushed = abs(found.targets[ANKLE]) * legs.stiffness[ANKLE]
    assert pushed == pytest.approx(legs.mass * GRAVITY * most, rel=1e-6)
