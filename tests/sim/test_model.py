"""RES in MuJoCo: servos as specified, standing still, and worlds that differ."""

import mujoco
import numpy as np
import pytest
from other_robots import resized

from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.gait.family import STAND
from gaitchain.gait.keypose.presets import draw_candidates
from gaitchain.robot.box_robot import JOINT_NAMES, load_box_robot
from gaitchain.robot.joint_angles import joint_angles
from gaitchain.sim.model import World, build_model, standing_height

RES = load_box_robot("res")
BIPED = RES.reduced
LIMIT = np.radians(80.0)
SPEED = np.radians(150.0)


@pytest.fixture(scope="module")
def model():
    return build_model(RES)


def floating(world=None, robot=RES):
    """The robot without weight or floor, all joints at zero."""
    model = build_model(robot, world)
    model.opt.gravity[:] = 0.0
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    return model, mujoco.MjData(model)


def test_twelve_servos_within_80_degrees(model):
    names = [model.actuator(i).name for i in range(model.nu)]
    joints = [model.joint(1 + i).name for i in range(12)]
    assert names == joints == list(JOINT_NAMES)
    assert model.njnt == 13
    assert model.jnt_type[0] == mujoco.mjtJoint.mjJNT_FREE
    np.testing.assert_allclose(model.jnt_range[1:], [[-LIMIT, LIMIT]] * 12)
    np.testing.assert_allclose(model.actuator_ctrlrange, [[-LIMIT, LIMIT]] * 12)
    np.testing.assert_allclose(model.actuator_forcerange, [[-120.0, 120.0]] * 12)
    assert np.all(model.jnt_limited[1:] == 1)


def test_total_mass(model):
    assert model.body_mass.sum() == pytest.approx(31.0) == pytest.approx(BIPED.mass)


@pytest.mark.parametrize("joint", ["left_knee", "right_hip_roll", "left_ankle_pitch"])
@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_a_step_command_slews_at_150_degrees_per_second(joint, direction):
    model, data = floating()
    data.actuator(joint).ctrl[0] = direction * 1.2
    times, angles, torques = [], [], []
    for _ in range(round(0.4 / model.opt.timestep)):
        mujoco.mj_step(model, data)
        times.append(data.time)
        angles.append(direction * data.joint(joint).qpos[0])
        torques.append(data.actuator(joint).force[0])
    times, angles = np.array(times), np.array(angles)
    assert np.all(angles <= SPEED * times + 1e-3), "never ahead of the set-point"
    settled = times > 0.2
    speed = np.polyfit(times[settled], angles[settled], 1)[0]
    assert speed == pytest.approx(SPEED, rel=0.02)
    assert np.abs(torques).max() <= 120.0


def test_a_step_command_arrives():
    model, data = floating()
    data.actuator("left_knee").ctrl[0] = 1.2
    for _ in range(round(1.0 / model.opt.timestep)):
        mujoco.mj_step(model, data)
    assert data.joint("left_knee").qpos[0] == pytest.approx(1.2, abs=1e-3)


def test_torque_is_clipped():
    weak = resized(RES, joint_torque_limit=2.0)
    model, data = floating(robot=weak)
    data.actuator("left_knee").ctrl[0] = 1.2
    torques = []
    for _ in range(200):
        mujoco.mj_step(model, data)
        torques.append(data.actuator("left_knee").force[0])
    assert np.max(np.abs(torques)) == pytest.approx(2.0)


def test_a_command_beyond_the_range_stops_at_the_range():
    model, data = floating()
    data.actuator("left_knee").ctrl[0] = 3.0
    for _ in range(600):
        mujoco.mj_step(model, data)
    assert data.joint("left_knee").qpos[0] == pytest.approx(LIMIT, abs=0.02)


def stand(model, seconds):
    """Set the robot on the default standing pose and hold it; base path (N, 3)."""
    poses = draw_candidates(RES, "default", np.random.default_rng(0))
    q = poses.q[0][STAND]
    angles = joint_angles(q, left_support=True)
    height = BIPED.crus_length * np.cos(q[0]) + BIPED.femur_length * np.cos(q[1])
    data = mujoco.MjData(model)
    data.qpos[2] = BIPED.ankle_height + height
    data.qpos[7:] = angles
    data.act[:] = angles  # the servos' set-points
    data.ctrl[:] = angles
    path = [data.qpos[:3].copy()]
    for _ in range(round(seconds / model.opt.timestep)):
        mujoco.mj_step(model, data)
        path.append(data.qpos[:3].copy())
    return np.array(path), data


def carried(model, data):
    """Sum of the normal forces of all contacts with the floor [N]."""
    wrench, total = np.zeros(6), 0.0
    for contact in range(data.ncon):
        mujoco.mj_contactForce(model, data, contact, wrench)
        total += wrench[0]
    return total


def test_stands_still_for_two_seconds(model):
    path, data = stand(model, 2.0)
    drift = np.abs(path - path[0])
    assert drift[:, 2].max() < 0.01 * path[0, 2]
    assert drift[:, :2].max() < 0.005
    assert data.body("trunk").xmat[8] > np.cos(np.radians(1.0))
    assert np.abs(data.qvel).max() < 0.01
    assert carried(model, data) == pytest.approx(31.0 * 9.81, rel=0.01)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_falls_when_it_should(model, side):
    """The standing test can fail: a robot leaning off its soles does not stand."""
    path, _ = stand_leaning(model, 0.35 * side)
    assert path[-1, 2] < 0.8 * path[0, 2]


def stand_leaning(model, pitch):
    data = mujoco.MjData(model)
    data.qpos[2] = standing_height(RES) * np.cos(pitch) + 0.05
    data.qpos[3:7] = [np.cos(0.5 * pitch), 0.0, np.sin(0.5 * pitch), 0.0]
    path = [data.qpos[:3].copy()]
    for _ in range(round(2.0 / model.opt.timestep)):
        mujoco.mj_step(model, data)
        path.append(data.qpos[:3].copy())
    return np.array(path), data


def test_world_changes_friction_servos_mass_and_step(model):
    world = World(friction=0.3, servo_gain=1.5, mass=1.1, timestep=0.001)
    other = build_model(RES, world)
    assert other.geom("floor").friction[0] == pytest.approx(0.3)
    assert model.geom("floor").friction[0] == pytest.approx(0.8)
    np.testing.assert_allclose(other.body_mass, 1.1 * model.body_mass)
    np.testing.assert_allclose(other.body_inertia, 1.1 * model.body_inertia)
    assert other.opt.timestep == 0.001
    np.testing.assert_allclose(other.jnt_range, model.jnt_range)
    assert other.body_mass.sum() == pytest.approx(34.1)


def test_servo_gain_stiffens_the_joint():
    """Off its set-point, the servo pushes by its stiffness."""
    for gain, expected in ((1.0, 1200.0), (0.5, 600.0)):
        model, data = floating(World(servo_gain=gain))
        data.joint("left_knee").qpos[0] = 0.01
        mujoco.mj_forward(model, data)
        assert data.actuator("left_knee").force[0] == pytest.approx(-0.01 * expected)


@pytest.mark.parametrize(("friction", "slides"), [(0.8, False), (0.05, True)])
def test_friction_is_the_floors(friction, slides):
    """On a floor tilted by 5 degrees the straight robot keeps its feet, or not."""
    model = build_model(RES, World(friction=friction))
    tilt = np.radians(5.0)
    model.opt.gravity[:] = 9.81 * np.array([np.sin(tilt), 0.0, -np.cos(tilt)])
    data = mujoco.MjData(model)
    for _ in range(round(0.3 / model.opt.timestep)):
        mujoco.mj_step(model, data)
    moved = data.body("left_foot").xpos[0]
    expected = 0.5 * 9.81 * (np.sin(tilt) - friction * np.cos(tilt)) * 0.3**2
    assert moved == pytest.approx(expected if slides else 0.0, abs=0.004)


def test_standing_height_is_the_straight_leg(model):
    assert standing_height(RES) == pytest.approx(0.07 + 0.246 + 0.346)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    soles = [
        data.geom(f"{side}_foot_box").xpos[2] - model.geom(f"{side}_foot_box").size[2]
        for side in ("left", "right")
    ]
    np.testing.assert_allclose(soles, 0.0, atol=1e-12)


def test_a_trunk_that_is_held_stays_while_the_legs_swing():
    """They move as those of a trunk so heavy that nothing moves it."""
    stand, rows = np.array(RES.legs.stand), []
    for held in (True, False):
        backend = MujocoBackend(RES, World(held=held))
        if not held:
            backend.model.dof_armature[:6] = 1e9
            backend.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
        backend.connect(stand)
        before = backend.truth()
        for tick in range(80):
            backend.write(stand + 0.2 * np.sin(0.1 * tick))
        rows.append(backend.joints.copy())
        moved = np.subtract(backend.truth().qpos[:7], before.qpos[:7])
        assert np.abs(moved).max() <= (0.0 if held else 1e-6)
        assert not backend.fallen
    np.testing.assert_allclose(*rows, atol=1e-6)
    assert np.abs(rows[0] - stand).max() > 0.1
    assert len(before.qpos) == len(before.qvel) + 1 == 19
