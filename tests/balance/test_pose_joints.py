"""Reduced poses on any legs: MuJoCo's forward kinematics, and the closed form."""

import dataclasses

import mujoco
import numpy as np
import pytest
from leg_makes import MAKES, NO_ANKLE_ROLL, SEVEN, make_robot
from other_robots import with_legs

from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.balance.keypose_lead import KeyposeLead
from gaitchain.balance.pose_joints import PoseJoints
from gaitchain.gait.keypose.presets import CROUCH, draw_candidates
from gaitchain.gait.keypose.primitives import compose
from gaitchain.messages import CONTROL_PERIOD_S
from gaitchain.robot.box_robot import load_box_robot
from gaitchain.robot.joint_angles import joint_angles
from gaitchain.robot.kinematics import points
from gaitchain.sim.model import build_model

RES = load_box_robot("res")
READ = with_legs(RES, RES.legs)  # RES as if a file had described it
ANKLES = [0, 6]  # support and swing, in kinematics.POINTS


def poses_of(robot, seed=0):
    drawn = draw_candidates(robot, "default", np.random.default_rng(seed))
    return np.concatenate(drawn.q)


def feet_in_simulator(robot, angles):
    """Places of both ankles from the pelvis, and the turns of both soles."""
    model = build_model(robot)
    data = mujoco.MjData(model)
    data.qpos[7:] = angles
    mujoco.mj_kinematics(model, data)
    feet = [data.body(f"{side}_foot") for side in ("left", "right")]
    pelvis = data.body("trunk").xpos
    places = np.array([foot.xpos - pelvis for foot in feet])
    return places, np.array([foot.xmat.reshape(3, 3) for foot in feet])


@pytest.mark.parametrize("left", [True, False])
@pytest.mark.parametrize("make", [*MAKES, SEVEN])
def test_feet_are_level_and_as_far_apart_as_planned(make, left):
    robot = make_robot(make, np.random.default_rng(len(make)))
    joints, q = PoseJoints(robot), poses_of(robot)
    angles = joints.reached(q, left)
    held = np.flatnonzero(np.isfinite(angles).all(axis=-1))
    assert held.size > 0.7 * len(q)
    ankles = points(robot.reduced, q)[:, ANKLES]
    for i in held[::7]:
        places, turns = feet_in_simulator(robot, angles[i])
        support, swing = places if left else places[::-1]
        planned = (ankles[i, 1] - ankles[i, 0]) * [1.0, 1.0 if left else -1.0, 1.0]
        off = 0.01 * robot.reduced.leg_length  # of a leg that is hardly out of reach
        np.testing.assert_allclose(swing - support, planned, atol=2.0 * off)
        np.testing.assert_allclose(turns, np.stack([np.eye(3)] * 2), atol=0.06)


@pytest.mark.parametrize("left", [True, False])
def test_inverse_kinematics_gives_the_closed_form(left):
    """Both solve the same legs, with the trunk over the hips."""
    joints, q = PoseJoints(READ), poses_of(READ)
    joints.ahead = 0.0
    np.testing.assert_allclose(joints.angles(q, left), joint_angles(q, left), atol=1e-6)


def test_boxes_keep_the_closed_form_to_the_bit():
    q = poses_of(RES)
    joints = PoseJoints(RES)
    np.testing.assert_array_equal(joints.angles(q, False), joint_angles(q, False))
    np.testing.assert_array_equal(joints.reached(q, True), joint_angles(q, True))


@pytest.mark.parametrize("make", MAKES)
def test_the_standing_robot_is_balanced(make):
    """MuJoCo's CoM is over the middle of the soles."""
    robot = make_robot(make, np.random.default_rng(3))
    upright = compose(
        robot, np.array([0.0, CROUCH * robot.reduced.leg_length, 0.0, 0.0, 0.0])
    )
    angles = PoseJoints(robot).angles(upright, True)
    model = build_model(robot)
    data = mujoco.MjData(model)
    data.qpos[7:] = angles
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    ahead = data.subtree_com[1][0] - data.body("left_foot").xpos[0]
    assert ahead == pytest.approx(robot.reduced.sole_offset, abs=0.01)


def test_a_leg_without_ankle_roll_cannot_sway_on_level_soles():
    robot = make_robot(NO_ANKLE_ROLL, np.random.default_rng(4))
    height = CROUCH * robot.reduced.leg_length
    swayed = compose(robot, np.array([0.0, height, 0.0, 0.0, 0.2]))
    joints = PoseJoints(robot)
    assert joints.place(swayed, True).off_rad > 0.05
    assert np.isnan(joints.reached(swayed, True)).all()


@pytest.mark.parametrize("softness", [1.0, 0.4])
def test_servos_that_lead_hold_the_pose_in_physics(softness):
    """A soft robot stands where it was planned; without the lead it sags."""
    legs = dataclasses.replace(READ.legs, stiffness=softness * READ.legs.stiffness)
    robot = with_legs(READ, legs)
    height = CROUCH * robot.reduced.leg_length
    stand = compose(robot, np.array([0.0, height, 0.0, 0.0, 0.1]))
    planned = PoseJoints(robot).angles(stand, True)
    lead = KeyposeLead(robot, planned, CONTROL_PERIOD_S)
    off = {}
    for name in ("led", "plain"):
        backend = MujocoBackend(robot)
        backend.connect(planned)
        for _ in range(200):
            led = lead.targets(planned, left=True)
            backend.write(led if name == "led" else planned)
        assert not backend.fallen
        off[name] = np.degrees(np.abs(backend.data.qpos[7:] - planned).max())
    assert off["led"] < 0.2
    assert off["plain"] > 2.0 * off["led"]
