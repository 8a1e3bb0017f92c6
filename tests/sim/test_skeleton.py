"""The skeleton in MuJoCo: the robot that its anatomy says, and the boxes' equal."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from any_leg import any_legs, simulator
from hypothesis import given, settings
from hypothesis import strategies as st
from other_robots import with_legs

from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.robot.box_robot import JOINT_NAMES, box_legs, load_box_robot
from gaitchain.sim.model import build_model
from gaitchain.sim.scene import half_sides
from gaitchain.sim.world import World
from gaitchain.sim.world_draws import draw_link_errors

RES = load_box_robot("res")
BIPED = RES.reduced
SAME = with_legs(RES, box_legs(BIPED))
SEEDS = st.integers(0, 2**32 - 1)
SIDES = ("left", "right")
LINKS = ("trunk", *(f"{s}_{part}" for s in SIDES for part in ("femur", "crus", "foot")))
"""Bodies of the box robot that weigh something."""
BONES = ("trunk", *(f"{s}_link_{j}" for s in SIDES for j in (1, 4, 5)))
"""The same of its skeleton."""


def posed(model, seed, moves=True):
    """A robot anywhere, in any pose."""
    rng, data = np.random.default_rng(seed), mujoco.MjData(model)
    data.qpos[:3] = rng.uniform(0.0, 1.0, 3) + 2.0
    data.qpos[3:7] = rng.normal(size=4)
    mujoco.mju_normalize4(data.qpos[3:7])
    data.qpos[7:] = rng.uniform(-1.3, 1.3, model.nu)
    data.qvel[:] = moves * rng.uniform(-3.0, 3.0, model.nv)
    mujoco.mj_forward(model, data)
    mujoco.mj_subtreeVel(model, data)
    return data


def full_mass(model, data):
    matrix = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, matrix)
    return matrix


@pytest.fixture(scope="module")
def pair():
    return build_model(RES), build_model(SAME)


@settings(max_examples=30)
@given(seed=SEEDS)
def test_boxes_and_skeleton_move_alike(pair, seed):
    boxes, bones = (posed(model, seed) for model in pair)
    np.testing.assert_allclose(bones.qfrc_bias, boxes.qfrc_bias, atol=1e-9)
    masses = [
        full_mass(model, data) for model, data in zip(pair, (boxes, bones), strict=True)
    ]
    np.testing.assert_allclose(masses[1], masses[0], atol=1e-10)
    np.testing.assert_allclose(bones.subtree_com[1], boxes.subtree_com[1], atol=1e-12)
    momentum = [data.subtree_angmom[1] for data in (boxes, bones)]
    np.testing.assert_allclose(momentum[1], momentum[0], atol=1e-10)
    for name in ("gyro", "accelerometer"):
        seen = [data.sensor(name).data for data in (boxes, bones)]
        np.testing.assert_allclose(seen[1], seen[0], atol=1e-8)


@settings(max_examples=20)
@given(seed=SEEDS)
def test_feet_and_soles_are_in_one_place(pair, seed):
    boxes, bones = (posed(model, seed) for model in pair)
    for side in SIDES:
        feet = [data.body(f"{side}_foot") for data in (boxes, bones)]
        np.testing.assert_allclose(feet[1].xpos, feet[0].xpos, atol=1e-12)
        np.testing.assert_allclose(feet[1].xmat, feet[0].xmat, atol=1e-12)
        bottoms = []
        for model, data in zip(pair, (boxes, bones), strict=True):
            box, size = data.geom(f"{side}_foot_box"), model.geom(f"{side}_foot_box")
            down = box.xmat.reshape(3, 3) @ [0.0, 0.0, -size.size[2]]
            bottoms.append(box.xpos + down)
            np.testing.assert_allclose(size.size[:2], [0.11, 0.065])
        np.testing.assert_allclose(bottoms[1], bottoms[0], atol=1e-12)


def test_both_stand_alike():
    """On the floor, by what the backend reads: loads, sensors, heights."""
    stand = np.tile([0.0, 0.0, -0.45, 0.9, -0.45, 0.0], 2)
    loads, sensors = [], []
    for robot in (RES, SAME):
        backend = MujocoBackend(robot)
        backend.connect(stand)
        for _ in range(50):
            backend.write(stand)
        loads.append(backend.foot_loads())
        sensors.append(backend.read())
    np.testing.assert_allclose(loads[1], loads[0], rtol=1e-3)
    first, second = (sensor.joint_position for sensor in sensors)
    np.testing.assert_allclose(second, first, atol=1e-4)


@settings(max_examples=20)
@given(seed=SEEDS, count=st.sampled_from([5, 6, 7]))
def test_any_anatomy_is_built_as_it_says(seed, count):
    """Against a model of the same numbers that was written for another test."""
    full = any_legs(np.random.default_rng(seed), count)
    model, plain = build_model(with_legs(RES, full)), simulator(full)
    model.dof_armature[:] = 0.0
    here, there = posed(model, seed), mujoco.MjData(plain)
    there.qpos[:], there.qvel[:] = here.qpos, here.qvel
    mujoco.mj_forward(plain, there)
    scale = np.abs(there.qfrc_bias).max()
    np.testing.assert_allclose(here.qfrc_bias, there.qfrc_bias, atol=1e-9 * scale)
    expected = full_mass(plain, there)
    np.testing.assert_allclose(full_mass(model, here), expected, atol=1e-9)
    for leg, side in enumerate(SIDES):
        site, foot = there.site(f"ankle_{leg}"), here.body(f"{side}_foot")
        np.testing.assert_allclose(foot.xpos, site.xpos, atol=1e-12)
        np.testing.assert_allclose(foot.xmat, site.xmat, atol=1e-12)


def test_names_are_those_that_the_backend_asks_for():
    model = build_model(SAME)
    assert model.body(1).name == "trunk"
    assert [model.joint(1 + j).name for j in range(model.nu)] == list(JOINT_NAMES)
    assert [model.actuator(i).name for i in range(model.nu)] == list(JOINT_NAMES)
    for side in SIDES:
        body = model.body(f"{side}_foot").id
        assert model.geom(f"{side}_foot_box").bodyid[0] == body
    weights = [model.body(name).mass[0] for name in BONES]
    boxes = build_model(RES)
    np.testing.assert_allclose(weights, [boxes.body(name).mass[0] for name in LINKS])


@settings(max_examples=20)
@given(seed=SEEDS)
def test_only_soles_and_trunk_touch_only_the_floor(pair, seed):
    model = pair[1]
    data = posed(model, seed)
    data.qpos[2] = 0.0
    mujoco.mj_forward(model, data)
    floor = model.geom("floor").id
    names = set()
    for pair_of in data.contact.geom[: data.ncon]:
        assert floor in pair_of
        names |= {model.geom(g).name for g in pair_of if g != floor}
    assert names <= {"trunk_geom", "left_foot_box", "right_foot_box"}
    capsules = [
        g
        for g in range(model.ngeom)
        if model.geom_type[g] == mujoco.mjtGeom.mjGEOM_CAPSULE
    ]
    assert len(capsules) == 4
    below = [mujoco.mj_geomDistance(model, data, g, floor, 1.0, None) for g in capsules]
    assert names, "the robot lies half under the floor"
    assert min(below) < 0.0, "and so do its legs"


POINTED = ((-0.03, 0.0), (0.1, -0.03), (0.1, 0.03))
EVEN = ((-0.03, -0.03), (0.1, -0.03), (0.1, 0.03), (-0.03, 0.03))


@pytest.mark.parametrize(("ankle", "roll"), [(5, -0.2), (5, 0.2), (11, 0.2), (5, 0.0)])
def test_soles_that_taper_are_measured_to_the_balls_that_they_stand_on(ankle, roll):
    robot = with_legs(SAME, replace(SAME.legs, soles=(POINTED, EVEN)))
    backend = MujocoBackend(robot)
    position = np.zeros(12)
    position[ankle] = roll
    backend.connect(position)
    model, data = backend.model, backend.data
    floor = model.geom("floor").id

    def above(side, corners):
        balls = [model.geom(f"{side}_corner_{i + 1}").id for i in range(len(corners))]
        return min(
            mujoco.mj_geomDistance(model, data, ball, floor, 1.0, None)
            for ball in balls
        )

    gaps = [above("left", POINTED), above("right", EVEN)]
    np.testing.assert_allclose(backend.sole_heights(), gaps, atol=1e-9)
    assert min(gaps) == pytest.approx(0.0, abs=1e-9), "it is put on the lower one"
    assert (max(gaps) > 0.004) is bool(roll)


def uneven(seed=0):
    """RES with servos and ranges that are unlike at every joint."""
    rng = np.random.default_rng(seed)
    full = box_legs(BIPED)
    unlike = {
        name: getattr(full, name) * rng.uniform(0.5, 1.5, 12)
        for name in ("stiffness", "damping", "torque_limit", "speed_limit", "armature")
    }
    unlike |= {
        "lower": rng.uniform(-1.4, -0.9, 12),
        "upper": rng.uniform(1.2, 1.5, 12),
        "friction_loss": rng.uniform(0.1, 0.5, 12),
        "joint_damping": 0.5 * full.damping,
    }
    return replace(full, **unlike)


@pytest.mark.parametrize("world", [World(), World(servo_gain=0.8, torque_limit=0.5)])
def test_each_joint_has_its_own_limits_and_servo(world):
    full = uneven()
    model = build_model(with_legs(RES, full), world)
    ranges = np.column_stack([full.lower, full.upper])
    np.testing.assert_allclose(model.jnt_range[1:], ranges)
    np.testing.assert_allclose(model.actuator_ctrlrange, ranges)
    most = world.torque_limit * full.torque_limit
    np.testing.assert_allclose(model.actuator_forcerange, np.stack([-most, most]).T)
    np.testing.assert_allclose(model.dof_armature[6:], full.armature)
    np.testing.assert_allclose(model.dof_frictionloss[6:], full.friction_loss)
    data = mujoco.MjData(model)
    data.qpos[7:] = 0.01  # off their set-points, as they move
    data.qvel[6:] = 0.05
    mujoco.mj_forward(model, data)
    servo = full.damping - full.joint_damping
    force = -world.servo_gain * (0.01 * full.stiffness + 0.05 * servo)
    np.testing.assert_allclose(data.actuator_force, force)
    np.testing.assert_allclose(data.qfrc_passive[6:], -0.05 * full.joint_damping)


def test_a_joints_own_damping_is_not_bounded_by_the_servos_torque():
    """So a motor at its limit has the less left, the faster its joint turns."""
    full = uneven()
    model = build_model(with_legs(RES, full))
    data = mujoco.MjData(model)
    data.ctrl[:], data.qpos[7:] = full.upper, full.lower
    data.act[:] = full.upper
    data.qvel[6:] = rate = 3.0
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(data.actuator_force, full.torque_limit)
    left = full.torque_limit - rate * full.joint_damping
    found = data.qfrc_actuator[6:] + data.qfrc_passive[6:]
    np.testing.assert_allclose(found, left)


@pytest.mark.parametrize("joint", [2, 3, 10])
def test_each_joint_slews_at_its_own_speed(joint):
    full = uneven(1)
    model = build_model(with_legs(RES, full))
    model.opt.gravity[:] = 0.0
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    data = mujoco.MjData(model)
    data.ctrl[joint] = 5.0  # beyond its range
    seconds = 0.2
    mujoco.mj_step(model, data, nstep=round(seconds / model.opt.timestep))
    assert data.act[joint] == pytest.approx(full.speed_limit[joint] * seconds, rel=0.02)
    mujoco.mj_step(model, data, nstep=round(2.0 / model.opt.timestep))
    assert data.act[joint] == pytest.approx(full.upper[joint])


@pytest.mark.parametrize("seed", range(3))
def test_boxes_and_skeleton_are_misbuilt_alike(seed):
    """The same errors link by link; of the CoM along each link's principal axes."""
    world = World(model_error=0.1, seed=seed)
    errors = draw_link_errors(world, len(LINKS))
    for robot, names in ((RES, LINKS), (SAME, BONES)):
        wrong, right = build_model(robot, world), build_model(robot)
        for name, (mass, inertia, *shift) in zip(names, errors, strict=True):
            built, meant = wrong.body(name), right.body(name)
            assert built.mass[0] == pytest.approx((1.0 + mass) * meant.mass[0])
            np.testing.assert_allclose(built.inertia, (1.0 + inertia) * meant.inertia)
            moved = np.zeros(3)
            back = meant.iquat * [1.0, -1.0, -1.0, -1.0]
            mujoco.mju_rotVecQuat(moved, built.ipos - meant.ipos, back)
            half = half_sides(meant.mass[0], meant.inertia)
            np.testing.assert_allclose(np.abs(moved), np.abs(shift) * half, atol=1e-9)


def test_boxes_and_skeleton_have_their_coms_in_one_place():
    world = World(model_error=0.1, seed=1)
    boxes, bones = (build_model(robot, world) for robot in (RES, SAME))
    for link, bone in zip(LINKS, BONES, strict=True):
        there, here = (
            model.body(name).ipos for model, name in ((boxes, link), (bones, bone))
        )
        np.testing.assert_allclose(here, there, atol=1e-9)


@pytest.mark.parametrize("mass", [0.5, 1.01, 3.0])
def test_a_heavier_world_has_the_same_errors(mass):
    """Also where a link has no mass, and is given the least."""
    weighs = np.array(SAME.legs.link_mass)
    weighs[:, 3] = 0.0
    robot = with_legs(RES, replace(SAME.legs, link_mass=weighs))
    nominal, heavy = (
        build_model(robot, World(mass=m, seed=3, model_error=0.1)).body_mass
        for m in (1.0, mass)
    )
    assert (nominal == 1e-3).sum() == 2
    np.testing.assert_allclose(heavy, mass * nominal)


def test_a_heavier_world_weighs_more():
    nominal, heavy = build_model(SAME), build_model(SAME, World(mass=1.2))
    np.testing.assert_allclose(heavy.body_mass, 1.2 * nominal.body_mass)
    np.testing.assert_allclose(heavy.body_inertia, 1.2 * nominal.body_inertia)
    assert nominal.body_mass.sum() == pytest.approx(BIPED.mass)
