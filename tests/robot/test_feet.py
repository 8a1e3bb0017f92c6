"""The feet as NumPy finds them, against MuJoCo and the machine code."""

import mujoco
import numpy as np
from any_leg import any_legs, simulator
from hypothesis import given, settings
from hypothesis import strategies as st

from gaitchain.balance.leg_kinematics import legs_of, posture
from gaitchain.robot.box_robot import load_box_robot
from gaitchain.robot.feet import FootFinder


@settings(max_examples=40)
@given(st.integers(0, 10_000), st.integers(4, 8))
def test_any_foot_is_where_the_simulator_has_it(seed, count):
    rng = np.random.default_rng(seed)
    legs, joints = any_legs(rng, count), rng.uniform(-3.0, 3.0, 2 * count)
    model = simulator(legs)
    data = mujoco.MjData(model)
    data.qpos[7:] = joints
    mujoco.mj_forward(model, data)
    trunk, found = data.body("trunk"), FootFinder(legs).find(joints)
    turn = trunk.xmat.reshape(3, 3)
    for leg in range(2):
        site = data.site(f"ankle_{leg}")
        at = turn.T @ (site.xpos - trunk.xpos)
        np.testing.assert_allclose(found.ankles[leg], at, atol=1e-12)
        sole = turn.T @ site.xmat.reshape(3, 3)
        np.testing.assert_allclose(found.turns[leg], sole, atol=1e-12)


def test_who_watches_sees_the_feet_where_the_walker_has_them():
    robot = load_box_robot("res")
    joints = robot.legs.stand + np.linspace(-0.3, 0.3, len(robot.legs.stand))
    found, walked = FootFinder(robot.legs).find(joints), posture(legs_of(robot), joints)
    np.testing.assert_allclose(found.ankles, walked.ankles, atol=1e-14)
    np.testing.assert_allclose(found.turns, walked.feet, atol=1e-14)
