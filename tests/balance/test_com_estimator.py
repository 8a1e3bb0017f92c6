"""A standing robot weighed by its servos, against where the simulator has its CoM."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from other_robots import resized, with_legs, without_joint

from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.balance.com_estimator import weigh_offset
from gaitchain.balance.leg_kinematics import com_from_pelvis, legs_of, posture
from gaitchain.balance.rotations import rotation
from gaitchain.build import stride_rollout
from gaitchain.build.stride_rollout import walk_strides
from gaitchain.gait.stride.draw import draw_strides
from gaitchain.gait.stride.shape import BOX_SHAPE, StrideShape
from gaitchain.gait.stride.strides import StridePoses
from gaitchain.robot.box_robot import box_legs, load_box_robot
from gaitchain.sim.world import World
from gaitchain.walker.stride_setup import make_walk

RES = load_box_robot("res")
BIPED = RES.reduced
SECOND = 100
NEAR = 3e-3  # m: links off by 10 % hide their own weight
ERROR = 0.08  # of each link
AT_REST_S = 5.0  # until it no longer sways: what is weighed is where the ground presses
MIRROR = np.array([1.0, -1.0, 1.0])


def odd_robot(seed):
    """Joints apart from each other, links that weigh anywhere, both legs alike."""
    rng = np.random.default_rng(seed)
    full = box_legs(BIPED)
    apart = rng.uniform(-0.03, 0.03, (6, 3))
    apart[0] = 0.0
    apart[4, :2] *= 0.3
    com = rng.uniform(-0.02, 0.02, (6, 3))
    inertia = np.where(
        full.link_mass[..., None, None] > 0.0, full.inertia, 2e-3 * np.eye(3)
    )
    legs = replace(
        full,
        at=full.at + np.stack([apart, apart * MIRROR]),
        com=full.com + np.stack([com, com * MIRROR]),
        link_mass=full.link_mass + rng.uniform(0.1, 1.0, 6),
        inertia=inertia,
        armature=rng.uniform(0.01, 0.08, 12),
    )
    return with_legs(RES, legs)


def walk_of(robot, balance=None, feedback=True):
    poses = draw_strides(robot, "brisk", 3)
    poses = replace(poses, balance=balance or {})
    return make_walk(poses, StrideShape().timing(robot), feedback=feedback)


class Stand:
    """A robot that stands in physics; the plan knows only its file."""

    def __init__(self, robot, world=None, true=None, **kwargs):
        self.legs, self.walk = legs_of(robot), walk_of(robot, **kwargs)
        self.backend = MujocoBackend(true or robot, world)
        self.backend.connect(self.walk.stand)
        self.targets = self.walk.stand

    def balance(self, seconds):
        """Stand as a walk does."""
        for _ in range(round(seconds * SECOND)):
            sensors = self.backend.read()
            self.walk.sense(sensors)
            self.targets = self.walk.advance(sensors)
            self.backend.write(self.targets)
        assert not self.backend.fallen
        assert self.walk.standing
        return self

    def hold(self, seconds):
        """Stand on servos alone, which give way a little."""
        for _ in range(round(seconds * SECOND)):
            self.backend.write(self.targets)
        return self

    @property
    def level(self):
        turn = self.backend.data.body("trunk").xmat.reshape(3, 3)
        heading = np.arctan2(turn[1, 0], turn[0, 0])
        return rotation(-heading, 0.0, 0.0) @ turn

    def weighed(self):
        sensors = self.backend.read()
        position, velocity = sensors.joint_position, sensors.joint_velocity
        return weigh_offset(self.legs, position, velocity, self.targets, self.level)

    @property
    def truth(self):
        """The simulator's CoM from the trunk, minus the one of the robot's file."""
        data, trunk = self.backend.data, self.backend.data.body("trunk")
        turn = trunk.xmat.reshape(3, 3)
        seen = (data.subtree_com[1] - trunk.xpos) @ turn
        model = com_from_pelvis(self.legs, posture(self.legs, data.qpos[7:].copy()))
        return (self.level @ (seen - model))[:2]

    @property
    def learned(self):
        return np.array(self.walk.snapshot().numbers[0].com_offset.item())

    @property
    def com_from_middle(self):
        """The true CoM from the middle between the ankles, ahead and left."""
        data, heading = self.backend.data, self.backend.foot_yaws().mean()
        way = data.subtree_com[1] - self.backend.foot_positions().mean(axis=0)
        return (rotation(-heading, 0.0, 0.0) @ way)[:2]


ROBOTS = {"res": RES, "odd 1": odd_robot(1), "odd 2": odd_robot(2)}


@pytest.mark.parametrize("seed", [3, 5])
@pytest.mark.parametrize("name", ROBOTS)
def test_the_offset_is_the_simulators(name, seed):
    stand = Stand(ROBOTS[name], World(model_error=ERROR, seed=seed)).balance(AT_REST_S)
    assert np.abs(stand.truth).max() > 1e-3, "something to weigh"
    np.testing.assert_allclose(stand.weighed(), stand.truth, atol=NEAR)


@pytest.mark.parametrize("gain", [0.8, 1.2])
def test_aside_the_servos_gain_is_no_matter(gain):
    world = World(model_error=ERROR, seed=3, servo_gain=gain)
    stand = Stand(RES, world).balance(AT_REST_S)
    assert stand.weighed()[1] == pytest.approx(stand.truth[1], abs=NEAR)


@pytest.mark.parametrize("gain", [0.8, 1.2])
@pytest.mark.parametrize("name", ROBOTS)
def test_ahead_the_servos_gain_is_no_matter(name, gain):
    world = World(model_error=0.05, seed=3, servo_gain=gain)
    stand = Stand(ROBOTS[name], world).balance(AT_REST_S)
    np.testing.assert_allclose(stand.weighed(), stand.truth, atol=NEAR)


@pytest.mark.parametrize("name", ROBOTS)
def test_a_robot_as_its_file_says_is_off_by_nothing(name):
    """Also where servos give way, and the trunk leans with them."""
    stand = Stand(ROBOTS[name]).hold(5.0)
    assert np.abs(stand.truth).max() < 1e-5
    np.testing.assert_allclose(stand.weighed(), 0.0, atol=2e-4)


def test_noise_averages_out():
    stand = Stand(RES, World(model_error=ERROR, seed=3, noise=1.0)).balance(1.0)
    seen = []
    for _ in range(4 * SECOND):
        stand.balance(0.01)
        seen.append(stand.weighed())
    assert np.std(seen, axis=0).max() > 1e-3, "single ones are noisy"
    np.testing.assert_allclose(np.mean(seen, axis=0), stand.truth, atol=NEAR)


def test_a_hanging_robot_is_not_weighed():
    stand = Stand(RES)
    data, model = stand.backend.data, stand.backend.model
    data.qpos[2] += 0.3
    held = data.qpos[:7].copy()
    for _ in range(SECOND):
        mujoco.mj_step(model, data)
        data.qpos[:7], data.qvel[:6] = held, 0.0
    assert stand.weighed() is None


def test_a_robot_without_load_is_not_weighed():
    legs = legs_of(RES)
    joints = np.array(legs.start)
    limp = weigh_offset(legs, joints, np.zeros(12), joints, np.eye(3))
    assert limp is None


@pytest.mark.parametrize("joint", [0, 5], ids=["no hip yaw", "no ankle roll"])
def test_five_joints_say_as_much(joint):
    stand = Stand(without_joint(RES, joint), World(model_error=ERROR, seed=3)).balance(
        AT_REST_S
    )
    assert np.isfinite(stand.weighed()).all()
    np.testing.assert_allclose(stand.weighed(), stand.truth, atol=NEAR)


@pytest.mark.parametrize("seed", [3, 5])
@pytest.mark.parametrize("name", ROBOTS)
def test_who_stands_learns_it_and_moves_the_pelvis(name, seed):
    stand = Stand(ROBOTS[name], World(model_error=ERROR, seed=seed)).balance(6.0)
    np.testing.assert_allclose(stand.learned, stand.truth, atol=NEAR)
    middle = [stand.walk.gains.foot_zmp.x, 0.0]
    # The servos, told the weights of the file, leave a rest.
    np.testing.assert_allclose(stand.com_from_middle, middle, atol=5e-3)


@pytest.mark.parametrize("seed", [3, 5])
@pytest.mark.parametrize("name", ROBOTS)
def test_who_learns_stands_still(name, seed):
    """Without learning the CoM does not move by 0.1 mm."""
    stand = Stand(ROBOTS[name], World(model_error=ERROR, seed=seed)).balance(1.0)
    path = [stand.balance(0.01).com_from_middle for _ in range(2 * SECOND)]
    assert np.ptp(path, axis=0).max() < NEAR


def test_a_second_is_enough_for_most_of_it():
    for ahead, left in ((0.02, 0.0), (-0.02, 0.0), (0.0, 0.03), (0.0, -0.03)):
        stand = Stand(RES, true=lopsided(RES, ahead, left)).balance(1.0)
        assert np.linalg.norm(stand.truth) > 0.01
        left_over = np.linalg.norm(stand.learned - stand.truth)
        assert left_over < 0.4 * np.linalg.norm(stand.truth)


def test_the_pelvis_goes_the_other_way():
    """A robot heavier on its left stands further right; hips that sag leave a rest."""
    ways = {}
    for on in (1.0, 0.0):
        stand = Stand(RES, true=lopsided(RES, 0.0, 0.02), balance={"offset_reach": on})
        ways[on] = stand.balance(6.0).com_from_middle[1]
    assert ways[0.0] == pytest.approx(0.02 * BIPED.trunk_mass / BIPED.mass, abs=NEAR)
    assert abs(ways[1.0]) < 0.5 * ways[0.0]


def test_open_loop_learns_nothing():
    stand = Stand(RES, true=lopsided(RES, 0.01, 0.02), feedback=False).balance(2.0)
    np.testing.assert_array_equal(stand.learned, 0.0)


def test_nothing_is_learned_beyond_reach():
    balance = {"offset_reach": 0.1}
    stand = Stand(RES, true=lopsided(RES, 0.0, 0.03), balance=balance).balance(4.0)
    most = stand.walk.gains.offset_reach
    assert stand.truth[1] > 3.0 * most
    assert 0.8 * most < stand.learned[1] <= most


def lopsided(robot, ahead, left):
    """The robot, its trunk's CoM elsewhere than its file says."""
    full = box_legs(robot.reduced)
    com = full.trunk_com + np.array([ahead, left, 0.0])
    return with_legs(robot, replace(full, trunk_com=com))


@pytest.mark.parametrize("left", [0.048, -0.048])
def test_a_lopsided_robot_on_narrow_soles_walks_by_what_it_learned(left, monkeypatch):
    """Its trunk's CoM is further aside than its soles are wide to either side."""
    narrow = resized(RES, sole_width=0.03)
    true, shape = lopsided(narrow, 0.0, left), BOX_SHAPE

    def real(robot, world):
        assert robot == narrow
        return MujocoBackend(true, world)

    monkeypatch.setattr(stride_rollout, "MujocoBackend", real)
    monkeypatch.setattr(stride_rollout, "_BEFORE_S", 1.0)
    strides = np.zeros((3, 3))
    strides[1:, 0] = 0.11, 0.22
    layers = strides, np.array([[0.5, 1.4, 0.04]]), np.array([[0.08, 0.1]]), strides
    gaits = np.array([[0, 0, 0, 1], [1, 0, 0, 2], *[[2, 0, 0, 2]] * 25, [2, 0, 0, 0]])
    fell = {}
    for on in (1.0, 0.0):
        height = shape.hip_height * narrow.reduced.leg_length
        poses = StridePoses(
            narrow, height, layers, {**shape.balance, "offset_reach": on}
        )
        timing = shape.timing(narrow)
        fell[on] = walk_strides(poses, timing, gaits, World()).fell_in
    assert fell[1.0] is None
    assert fell[0.0] is not None
