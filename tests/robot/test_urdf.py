"""The URDF of the legs, read by MuJoCo, which takes no link without mass."""

from importlib import resources

import mujoco
import numpy as np
import pytest

from gaitchain.balance.leg_kinematics import legs_of, posture
from gaitchain.gait.library_file import load_library
from gaitchain.robot.urdf import last_links, link_names, urdf_of


def test_another_reader_has_the_same_legs():
    path = resources.files("gaitchain") / "data" / "res.gait"
    robot = load_library(path).robot
    keep = '<mujoco><compiler fusestatic="false"/></mujoco></robot>'
    text = urdf_of(robot).replace("</robot>", keep)
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    joints = np.asarray(robot.legs.stand) + 0.1
    for name, angle in zip(robot.legs.joint_names, joints, strict=True):
        data.joint(name).qpos[0] = angle
        assert model.joint(name).range[0] == pytest.approx(
            robot.legs.lower[robot.legs.joint_names.index(name)]
        )
    mujoco.mj_kinematics(model, data)
    found = posture(legs_of(robot), joints)
    for name, centre in zip(
        link_names(robot), found.centres.reshape(-1, 3), strict=True
    ):
        np.testing.assert_allclose(data.body(name).xpos, centre, atol=1e-6)
    for leg, (sole, last) in enumerate(
        zip(("l_sole", "r_sole"), last_links(robot), strict=True)
    ):
        below = found.ankles[leg] - robot.reduced.ankle_height * found.feet[leg, :, 2]
        np.testing.assert_allclose(data.body(sole).xpos, below, atol=1e-6)
        turn = data.body(sole).xmat.reshape(3, 3)
        np.testing.assert_allclose(turn, found.feet[leg], atol=1e-6)
        mass = robot.legs.link_mass[leg, -1]
        assert model.body(last).mass[0] == pytest.approx(mass, abs=1e-8)
