"""The robot in its own model under a live loop, against the skeleton's own backend."""

import copy
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gaitchain.backends.base import SimulatedTruth, WholeBodied
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.backends.whole_body import WholeBodyBackend
from gaitchain.cli.libraries import shipped_library
from gaitchain.errors import CommandError
from gaitchain.gait.library_file import load_library
from gaitchain.messages import Command
from gaitchain.sim.model import build_model
from gaitchain.walker.walker import Walker

# The skeleton's poses of links are those before the last time step.
_LAG = 2e-3


@pytest.fixture(scope="module")
def res_library():
    return load_library(shipped_library())


@pytest.fixture
def toy_body(toy_library, toy_path):
    from gaitchain.build.own_model import own_model
    from gaitchain.sim.world import World

    model = own_model(toy_path, toy_library.robot, World())
    return WholeBodyBackend(model, toy_library)


def test_its_truth_is_that_of_the_skeleton_where_that_is_its_model(res_library):
    walker = Walker(res_library)
    skeleton = MujocoBackend(res_library.robot)
    whole = WholeBodyBackend(build_model(res_library.robot), res_library)
    assert isinstance(whole, SimulatedTruth)
    for robot in (skeleton, whole):
        robot.connect(walker.stand)
    walker.command(Command(vx=0.3))
    for tick in range(230):
        target = walker.step(skeleton.read()).position
        if tick == 200:
            for robot in (skeleton, whole):
                robot.push(2.0, 60.0, 20.0)
        for robot in (skeleton, whole):
            robot.write(target)
    known, found = skeleton.truth(), whole.truth()
    for name in ("qpos", "qvel", "com", "tilt", "place", "turn", "foot_height"):
        expected = getattr(known, name)
        np.testing.assert_allclose(
            getattr(found, name), expected, atol=_LAG, err_msg=name
        )
    np.testing.assert_allclose(found.twist, known.twist, atol=5 * _LAG)
    weight = 9.81 * res_library.robot.legs.mass
    np.testing.assert_allclose(found.wrench, known.wrench, atol=0.02 * weight)
    assert found.self_contact == known.self_contact
    np.testing.assert_array_equal(found.whole, whole.data.qpos)
    np.testing.assert_allclose(whole.loads(), skeleton.loads(), atol=2.0)


@pytest.mark.parametrize("roll", [-0.2, 0.0, 0.2])
def test_soles_that_taper_are_measured_at_their_corners(toy_library, toy_body, roll):
    robot = toy_library.robot
    half, (rear, toe) = 0.5 * robot.reduced.sole_width, robot.reduced.sole_x
    soles = (
        ((rear, 0.0), (toe, -half), (toe, half)),
        ((rear, -half), (toe, -half), (toe, half), (rear, half)),
    )
    tapers = replace(robot, legs=replace(robot.legs, soles=soles))
    poses = replace(toy_library.poses, robot=tapers)
    body = WholeBodyBackend(toy_body.model, replace(toy_library, poses=poses))
    body.connect(np.array(robot.legs.stand))
    at = body.model.jnt_qposadr[body.free_joint]
    tilted = Rotation.from_euler("x", roll) * Rotation.from_quat(
        body.data.qpos[at + 3 : at + 7], scalar_first=True
    )
    body.data.qpos[at + 3 : at + 7] = tilted.as_quat(scalar_first=True)
    mujoco.mj_forward(body.model, body.data)
    truth = body.truth()
    feet = zip(
        soles,
        np.reshape(truth.place, (2, 3)),
        np.reshape(truth.turn, (2, 3, 3)),
        strict=True,
    )
    below = -robot.reduced.ankle_height
    heights = [
        min((ankle + turn @ (x, y, below))[2] for x, y in sole)
        for sole, ankle, turn in feet
    ]
    np.testing.assert_allclose(truth.foot_height, heights, atol=1e-9)
    assert roll == 0.0 or abs(heights[0] - heights[1]) > 0.005


def test_the_walker_has_the_legs_and_the_others_are_held(toy_body, toy_library):
    legs = toy_library.robot.legs.joint_names
    assert isinstance(toy_body, WholeBodied)
    arms = [n for n in toy_body.whole_joint_names if n not in legs]
    assert sorted(arms) == ["left_shoulder", "right_shoulder"]
    stand = np.array(toy_library.robot.legs.stand)
    toy_body.connect(stand)
    target = stand + 0.05
    for _ in range(100):
        toy_body.write(target)
    np.testing.assert_allclose(toy_body.read().joint_position, target, atol=0.1)
    whole = toy_body.read_whole()
    for name, angle in zip(
        toy_body.whole_joint_names, whole.joint_position, strict=True
    ):
        at = toy_body.data.joint(name).qpos[0]
        assert angle == pytest.approx(at)
    shoulders = [toy_body.data.joint(name).qpos[0] for name in arms]
    np.testing.assert_allclose(shoulders, 0.0, atol=0.1)


def test_all_joints_move_at_need(toy_body, toy_library):
    toy_body.connect(np.array(toy_library.robot.legs.stand))
    names = toy_body.whole_joint_names
    target = toy_body.read_whole().joint_position.copy()
    target[names.index("left_shoulder")] += 0.4
    for _ in range(100):
        toy_body.write_whole(target)
    moved = toy_body.data.joint("left_shoulder").qpos[0]
    assert moved == pytest.approx(0.4, abs=0.05)


def test_limp_it_falls_and_connected_it_stands_again(toy_body, toy_library):
    stand = np.array(toy_library.robot.legs.stand)
    toy_body.connect(stand)
    height = toy_body.truth().qpos[2]
    toy_body.release()
    for _ in range(200):
        toy_body.write(stand)
    assert toy_body.truth().qpos[2] < 0.6 * height
    toy_body.connect(stand)
    assert toy_body.truth().qpos[2] == pytest.approx(height)


@pytest.mark.parametrize("period_s", [0.008, 0.01, 0.02, 0.034])
def test_a_push_gives_its_impulse_whatever_the_period(res_library, period_s):
    """Its 0.1 s are no whole number of most periods, nor exact on the clock."""
    model = build_model(res_library.robot)
    robot = WholeBodyBackend(model, res_library, period_s)
    stand = Walker(res_library).stand
    robot.connect(stand)
    given = np.zeros(3)
    for _ in range(3):
        robot.push(1.0, 0.0)
        for _ in range(round(0.2 / period_s) + 1):
            robot.write(stand)
            given += period_s * robot.data.xfrc_applied[:, :3].sum(axis=0)
    assert np.linalg.norm(given) == pytest.approx(3.0, rel=0.01)


def test_a_push_is_on_the_trunks_com_and_not_on_its_lowest_link(toy_body, toy_library):
    """As in the skeleton, whose trunk is all but the legs: here its arms, too."""
    model = copy.copy(toy_body.model)
    legs = {body for side in toy_body._sides for body in side}
    trunk = [b for b in range(1, model.nbody) if b not in legs]
    arms = [b for b in trunk if 0.0 < model.body_mass[b] < 1.0]
    model.body_ipos[arms, 2] += 0.5  # raised
    robot = WholeBodyBackend(model, toy_library)
    robot.connect(np.array(toy_library.robot.legs.stand))
    robot.push(3.0, 0.0)
    robot.write(np.array(toy_library.robot.legs.stand))
    data, mass = robot.data, model.body_mass[trunk]
    com = mass @ data.xipos[trunk] / mass.sum()
    base = robot._body.in_model.base
    assert com[2] - data.xipos[base, 2] > 0.05, "else nothing is shown"
    forces = data.xfrc_applied[:, :3]
    moment = np.cross(data.xipos, forces).sum(axis=0)
    total = forces.sum(axis=0)
    assert total[0] == pytest.approx(30.0, rel=0.01)
    np.testing.assert_allclose(moment, np.cross(com, total), atol=1e-9)


def test_what_its_model_has_not_is_refused(toy_body):
    with pytest.raises(CommandError, match="left_foot"):
        toy_body.push(1.0, 0.0, body="left_foot")
    calm = toy_body.disturbances
    toy_body.disturb(calm)
    wanted = type(calm)(calm.punches, calm.arms, 0.1)
    with pytest.raises(CommandError, match="leave out --own-model"):
        toy_body.disturb(wanted)
    assert toy_body.take_punches() == []
