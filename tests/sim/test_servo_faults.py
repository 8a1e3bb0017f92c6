"""Each fault of servos and sensors against its closed form, or MuJoCo's own."""

import math
import re
from pathlib import Path
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
from joint_waves import BENT, WAVES, path_of
from scipy.spatial.transform import Rotation

from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.cli.world_options import world_numbers
from gaitchain.robot.box_robot import load_box_robot
from gaitchain.sim.known_servos import KNOWN_SERVOS
from gaitchain.sim.servo_faults import ServoFaults, slot_of
from gaitchain.sim.world import World
from gaitchain.sim.world_draws import (
    draw_com_shift,
    draw_encoder_offsets,
    draw_imu_biases,
    draw_imu_place,
    draw_imu_scales,
    draw_imu_tilt,
)

RES = load_box_robot("res")
KNEE = 3
STRAIGHT = np.zeros(12)
TORQUE = 120.0  # N m, limit of each joint


def floating(world):
    """RES without weight and without ground."""
    backend = MujocoBackend(RES, world)
    backend.model.opt.gravity[:] = 0.0
    backend.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    return backend


def drive(backend, joint, target, periods=300):
    """Turn one joint; return its angles and speeds."""
    wanted = STRAIGHT.copy()
    wanted[joint] = target
    backend.connect(STRAIGHT)
    rows = []
    for _ in range(periods):
        backend.write(wanted)
        rows.append((backend.joints[joint], backend.data.qvel[6 + joint]))
    return np.array(rows).T


# --- what has no effect


@pytest.mark.parametrize("delay_s", [0.0, 0.014])
def test_servos_with_a_fault_of_nothing_are_mujocos(delay_s):
    """The corrected torque is the same, and the bus delays as MuJoCo does."""
    plain = path_of(MujocoBackend(RES, World(delay_s=delay_s)))
    tiny = World(delay_s=delay_s, backlash_deg=1e-9)
    np.testing.assert_allclose(path_of(MujocoBackend(RES, tiny)), plain, atol=1e-6)


def test_the_ideal_torque_is_what_mujoco_pushes_with():
    backend = MujocoBackend(RES, World())
    backend.connect(BENT)
    faults = ServoFaults(backend.model, backend.data, World(), RES)
    for target in WAVES:
        backend.data.ctrl[:] = target
        faults.correct()
        np.testing.assert_allclose(backend.data.qfrc_applied, 0.0, atol=1e-9)
        mujoco.mj_step(backend.model, backend.data)


# --- gears


@pytest.mark.parametrize("width_deg", [0.5, 2.0])
def test_within_the_play_nothing_moves_and_nothing_ends_beyond_it(width_deg):
    play = 0.5 * math.radians(width_deg)
    world = World(backlash_deg=width_deg)
    still, _ = drive(floating(world), KNEE, 0.9 * play)
    assert np.abs(still).max() < 1e-9
    moved, _ = drive(floating(world), KNEE, 0.3)
    assert abs(moved[-1] - 0.3) < 1.001 * play
    pulled = floating(world)
    pulled.connect(STRAIGHT)
    for body, torque in (("left_crus", 12.0), ("left_femur", -12.0)):
        pulled.data.xfrc_applied[pulled.model.body(body).id, 4] = torque
    for _ in range(300):
        pulled.write(STRAIGHT)
    held = abs(pulled.joints[KNEE])
    assert held == pytest.approx(play + 12.0 / RES.legs.stiffness[KNEE], rel=0.02)


@pytest.mark.parametrize("timestep", [0.002, 0.0002])
def test_within_the_play_damping_stays_as_numerical_inertia(timestep):
    """A known limit: (M + h kv) dv = h f in a time step h, where M dv = h f is true."""
    backend = floating(World(backlash_deg=10.0, timestep=timestep))
    backend.connect(STRAIGHT)
    model, data = backend.model, backend.data
    data.xfrc_applied[model.body("left_crus").id, 4] = 5.0
    mass = np.empty((model.nv, model.nv))
    for _ in range(3):
        before = data.qvel.copy()
        backend._servos.act()
        mujoco.mj_step(model, data)
        mujoco.mj_fullM(model, data, mass)
        more = np.diag([0.0] * 6 + list(RES.legs.damping))
        force = timestep * mass @ data.qacc
        np.testing.assert_allclose(
            data.qvel - before,
            np.linalg.solve(mass + timestep * more, force),
            atol=1e-9,
        )
    assert data.qvel[6 + KNEE] > 1e-3


def test_a_robot_without_torque_is_not_driven_by_its_play():
    backend = MujocoBackend(RES, World(backlash_deg=2.0))
    path_of(backend, [BENT + 0.5] * 4)
    assert np.abs(backend.data.qfrc_applied[6:]).max() > 1.0
    backend.release()
    backend.write(BENT + 0.5)
    assert not backend.data.qfrc_applied.any()
    assert not backend.data.actuator_force.any()
    backend.engage()
    for _ in range(4):
        backend.write(BENT - 0.5)
    assert np.abs(backend.data.qfrc_applied[6:]).max() > 1.0


def test_a_servo_within_its_play_gives_no_torque():
    backend = floating(World(backlash_deg=5.0))
    backend.connect(STRAIGHT)
    backend.write(np.full(12, math.radians(2.0)))
    assert np.abs(backend.data.actuator_force).min() > 1.0, "what MuJoCo's would give"
    np.testing.assert_allclose(backend.loads(), 0.0, atol=1e-9)
    backend.write(np.full(12, math.radians(30.0)))
    assert np.abs(backend.loads()).min() > 1.0
    backend.release()
    assert not backend.loads().any()


def test_dry_friction_is_more_at_rest():
    world = World(dry_friction=0.05, stiction=0.6)
    backend = floating(world)
    backend.connect(STRAIGHT)
    for speed, more in ((0.0, 0.6), (0.3, 0.6 / math.e), (3.0, 0.0)):
        backend.data.qvel[6 + KNEE] = speed
        backend._servos.act()
        found = backend.model.dof_frictionloss[6 + KNEE]
        assert found == pytest.approx(0.05 * TORQUE * (1.0 + more), rel=1e-3)


def test_viscous_friction_takes_its_part_at_the_speed_limit():
    part, speed = 0.2, RES.legs.speed_limit[KNEE]
    model = MujocoBackend(RES, World(viscous_friction=part)).model
    plain = MujocoBackend(RES, World()).model
    more = model.dof_damping[6 + KNEE] - plain.dof_damping[6 + KNEE]
    assert more * speed == pytest.approx(part * TORQUE)


@pytest.mark.parametrize(
    ("limit", "times"), [(75.0, 1.0), (300.0, 2.0), (math.inf, math.inf)]
)
def test_slower_set_points_leave_motors_as_they_are_and_faster_ones_do_not(
    limit, times
):
    assert math.degrees(RES.legs.speed_limit[KNEE]) == pytest.approx(150.0)
    plain = MujocoBackend(RES).model.dof_damping[6 + KNEE]
    damping, no_load = [], []
    for speed in (None, limit):
        world = World(speed_limit_deg_s=speed, viscous_friction=0.2, no_load=1.5)
        backend = MujocoBackend(RES, world)
        damping.append(backend.model.dof_damping[6 + KNEE] - plain)
        no_load.append(ServoFaults(backend.model, backend.data, world, RES)._servos[4])
    assert damping[1] == pytest.approx(damping[0] / times)
    np.testing.assert_allclose(no_load[1], times * no_load[0])


# --- motor


def test_no_joint_is_driven_beyond_its_no_load_speed():
    limit = math.degrees(RES.legs.speed_limit[KNEE])
    free = World(speed_limit_deg_s=math.inf)
    assert drive(floating(free), KNEE, 1.3)[1].max() > math.radians(400.0)
    for ratio in (1.0, 1.5):
        world = World(no_load=ratio)
        speed = drive(floating(world), KNEE, 1.3)[1].max()
        assert speed < 1.02 * ratio * math.radians(limit)


def test_no_servo_gives_more_than_its_line_of_torque_and_speed():
    """Each torque is between the ends of the line at the speed before its time step."""
    backend = MujocoBackend(RES, World(no_load=1.0), period_s=World.timestep)
    backend.connect(BENT)
    most = RES.legs.speed_limit
    ideal = given = 0.0
    for target in np.repeat(WAVES, 5, axis=0):
        part = backend.data.qvel[6:] / most
        backend.write(BENT + 4.0 * (target - BENT))
        low, high = (
            TORQUE * np.clip(1.0 + part, 0, 1),
            TORQUE * np.clip(1.0 - part, 0, 1),
        )
        torque = backend.loads()
        given = max(given, float(np.maximum(torque - high, -low - torque).max()))
        raw = backend.data.actuator_force
        ideal = max(ideal, float(np.maximum(raw - high, -low - raw).max()))
    assert ideal > 1.0, "MuJoCo's servo is beyond the line"
    assert given < 1e-9


@pytest.mark.parametrize("sag", [0.2, 0.5])
def test_voltage_sags_to_its_fixed_point(sag):
    """All servos pull with all they have left, b = 1 - sag b: b = 1 / (1 + sag)."""
    backend = floating(World(sag=sag, speed_limit_deg_s=math.inf))
    backend.connect(STRAIGHT)
    faults, data = backend._servos, backend.data
    data.ctrl[:], data.act[:] = 1.0, 1.0
    for _ in range(60):
        faults.correct()
    np.testing.assert_allclose(
        TORQUE + data.qfrc_applied[6:], TORQUE / (1.0 + sag), rtol=1e-6
    )


# --- bus


def test_targets_are_taken_in_steps():
    backend = floating(World(target_step_deg=0.5))
    path_of(backend)
    steps = np.degrees(backend.data.ctrl) / 0.5
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)


def test_jitter_is_between_nothing_and_its_most_and_keeps_the_order():
    backend = floating(World(jitter_s=0.03, delay_s=0.01))
    backend.connect(STRAIGHT)
    seen = []
    for tick in range(300):
        backend.write(np.full(12, 1e-3 * tick))
        seen.append(round(float(backend.data.ctrl[0]) * 1e3))
    late = np.arange(300)[20:] - np.array(seen)[20:]
    assert np.all(np.diff(seen) >= 0)
    assert late.min() >= 0
    assert late.max() <= 4, "periods of 10 ms"
    assert len(set(late.tolist())) > 2


def test_a_slow_bus_holds_targets_and_readings():
    backend = floating(World(bus_hz=25.0))
    backend.connect(BENT)
    shown, sent = [], []
    for target in WAVES:
        shown.append(backend.read().joint_position[KNEE])
        backend.write(target)
        sent.append(backend.data.ctrl[KNEE])
    for values in (shown, sent):
        rows = np.array(values)[:56].reshape(-1, 4)
        assert np.all(rows == rows[:, :1]), "one for four control periods"
        assert len(set(rows[:, 0].tolist())) == len(rows)
    assert slot_of(0.3, 10.0) == 3


# --- encoders and IMU


def test_joints_are_off_by_the_offsets_of_their_encoders():
    world = World(encoder_offset_deg=2.0, seed=5)
    offsets = draw_encoder_offsets(world, 12)
    assert np.abs(offsets).max() <= math.radians(2.0)
    assert offsets.std() > 0.01
    backend = floating(world)
    backend.connect(BENT)
    np.testing.assert_allclose(backend.joints, BENT - offsets)
    for _ in range(100):
        backend.write(BENT)
    np.testing.assert_allclose(backend.joints, BENT - offsets, atol=1e-9)
    np.testing.assert_allclose(backend.read().joint_position, BENT, atol=1e-9)


def test_held_targets_are_not_sent_again():
    """Offsets would be taken from them once more in each period."""
    backend = floating(World(encoder_offset_deg=2.0, seed=5))
    backend.connect(BENT)
    backend.write(BENT)
    sent = backend.data.ctrl.copy()
    for _ in range(20):
        backend.hold()
    np.testing.assert_array_equal(backend.data.ctrl, sent)
    backend.write(sent)
    assert (backend.data.ctrl != sent).any()


@pytest.mark.parametrize("faults", [{}, {"backlash_deg": 0.01}])
def test_a_servo_that_is_turned_on_holds_whatever_was_on_its_way(faults):
    backend = floating(World(delay_s=0.03, **faults))
    backend.connect(BENT)
    for target in (BENT, BENT + 0.5):
        backend.write(target)
    backend.release()
    backend.engage()
    here = backend.joints.copy()
    for _ in range(20):
        backend.hold()
        np.testing.assert_allclose(backend.joints, here, atol=1e-3)
    for _ in range(40):
        backend.write(BENT + 0.1)
    np.testing.assert_allclose(backend.joints, BENT + 0.1, atol=1e-3)


def test_encoders_show_steps():
    backend = floating(World(encoder_step_deg=0.3))
    path_of(backend)
    steps = np.degrees(backend.read().joint_position) / 0.3
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)


def test_a_turned_imu_shows_a_turned_vector():
    world = World(imu_tilt_deg=5.0, seed=2)
    true, turned = (MujocoBackend(RES, w) for w in (World(), world))
    for backend in (true, turned):
        backend.connect(BENT)
        backend.write(BENT)
    roll, pitch, yaw = draw_imu_tilt(world)
    mount = Rotation.from_euler("ZYX", [yaw, pitch, roll])
    for name in ("acceleration", "angular_velocity"):
        seen = mount.inv().apply(getattr(true.read(), name))
        np.testing.assert_allclose(getattr(turned.read(), name), seen, atol=1e-9)


def test_an_imu_out_of_place_feels_the_turning():
    world = World(imu_offset_m=0.1, seed=3)
    place = draw_imu_place(world)
    felt = []
    for w in (World(), world):
        backend = floating(w)
        backend.connect(STRAIGHT)
        backend.data.qvel[3:6] = [0.0, 0.0, 4.0]
        mujoco.mj_forward(backend.model, backend.data)
        spin = backend.data.qacc[3:6].copy()
        felt.append(backend.read())
    outward = np.cross([0, 0, 4.0], np.cross([0, 0, 4.0], place))
    expected = outward + np.cross(spin, place)
    more = felt[1].acceleration - felt[0].acceleration
    np.testing.assert_allclose(more, expected, atol=1e-6)
    np.testing.assert_allclose(felt[1].angular_velocity, felt[0].angular_velocity)


def test_biases_are_added_to_each_axis_and_stay():
    world = World(gyro_bias_deg_s=2.0, accelerometer_bias=0.3, seed=4)
    gyro, accelerometer = draw_imu_biases(world)
    assert 0.0 < np.abs(gyro).max() <= math.radians(2.0)
    assert 0.0 < np.abs(accelerometer).max() <= 0.3
    true, off = (MujocoBackend(RES, w) for w in (World(), world))
    for backend in (true, off):
        backend.connect(BENT)
    for _ in range(3):
        seen, shown = true.read(), off.read()
        more = shown.angular_velocity - seen.angular_velocity
        np.testing.assert_allclose(more, gyro, atol=1e-12)
        more = shown.acceleration - seen.acceleration
        np.testing.assert_allclose(more, accelerometer, atol=1e-12)
        for backend in (true, off):
            backend.write(BENT)


def test_scales_multiply_each_axis():
    world = World(imu_scale=0.1, seed=4)
    gyro, accelerometer = draw_imu_scales(world)
    true, off = (MujocoBackend(RES, w) for w in (World(), world))
    path_of(true), path_of(off)
    seen, shown = true.read(), off.read()
    np.testing.assert_allclose(shown.angular_velocity, gyro * seen.angular_velocity)
    np.testing.assert_allclose(shown.acceleration, accelerometer * seen.acceleration)


@pytest.mark.parametrize("delay_s", [0.01, 0.03])
def test_a_late_imu_shows_what_it_felt_then(delay_s):
    true, late = (MujocoBackend(RES, w) for w in (World(), World(imu_delay_s=delay_s)))
    felt, shown = [], []
    for backend, rows in ((true, felt), (late, shown)):
        backend.connect(BENT)
        for target in WAVES:
            rows.append(backend.read().angular_velocity)
            assert np.array_equal(rows[-1], backend.read().angular_velocity)
            backend.write(target)
    lag = round(delay_s / 0.01)
    np.testing.assert_array_equal(shown[lag:], felt[:-lag])


def test_the_trunks_com_is_shifted_and_nothing_else():
    world = World(com_m=0.02, seed=6)
    plain, shifted = (MujocoBackend(RES, w).model for w in (World(), world))
    moved = shifted.body_ipos - plain.body_ipos
    trunk = plain.body("trunk").id
    np.testing.assert_allclose(moved[trunk], draw_com_shift(world))
    assert np.abs(np.delete(moved, trunk, axis=0)).max() == 0.0
    np.testing.assert_array_equal(shifted.body_mass, plain.body_mass)


# --- together


def test_the_same_seed_gives_the_same_walk_again():
    world = World(
        backlash_deg=0.5, dry_friction=0.02, stiction=0.5, no_load=1.5, sag=0.1,
        jitter_s=0.01, encoder_offset_deg=1.0, encoder_step_deg=0.09, imu_delay_s=0.01,
        imu_tilt_deg=1.0, imu_scale=0.02, noise=1.0, com_m=0.01, seed=9,
    )  # fmt: skip
    backend = MujocoBackend(RES, world)
    first, again = path_of(backend), path_of(backend)
    np.testing.assert_array_equal(first, again)
    assert not backend.fallen


# --- servos by name


@pytest.mark.parametrize("name", KNOWN_SERVOS)
def test_a_known_servos_numbers_are_those_of_a_world(name):
    servo = KNOWN_SERVOS[name]
    world = World(**servo.numbers)
    assert world.dry_friction * servo.stall_n_m == pytest.approx(servo.dry_n_m)
    assert world.viscous_friction < 0.25, "it would hardly turn"
    assert world.encoder_step_deg == pytest.approx(0.088, abs=1e-3)
    backend = MujocoBackend(RES, world)
    path_of(backend)
    assert not backend.fallen


def test_the_servo_of_the_calibrations_example_is_known_as_far_as_published():
    """By ROBOTIS' e-manual, 12 V; of its friction nothing was published."""
    page = Path("docs/connect_servos.md").read_text("utf-8")
    (model,) = set(re.findall(r'^model = "(.*?)"', page, re.MULTILINE))
    servo = KNOWN_SERVOS[model]
    assert servo.stall_n_m == 4.1
    assert servo.no_load_rad_s == pytest.approx(46.0 / 60.0 * 2.0 * np.pi)
    world = World(**servo.numbers)
    assert world.backlash_deg == pytest.approx(15.0 / 60.0)
    assert world.target_step_deg == pytest.approx(360.0 / 4096.0)
    ideal = World()
    for name in ("dry_friction", "stiction", "viscous_friction"):
        assert getattr(world, name) == getattr(ideal, name) == 0.0


def test_options_beside_a_servo_count_more():
    numbers = world_numbers(SimpleNamespace(servo="sts3215", backlash=0.2))
    known = KNOWN_SERVOS["sts3215"].numbers
    assert numbers == known | {"backlash_deg": 0.2}
    assert world_numbers(SimpleNamespace(servo=None)) == {}


@pytest.mark.parametrize("seed", range(3))
def test_a_robot_with_bad_encoders_is_put_on_its_lower_sole(seed):
    """Its legs are not equally long; a sole in the floor would throw it up."""
    world = World(encoder_offset_deg=2.0, seed=seed)
    backend = MujocoBackend(RES, world)
    backend.connect(np.array(RES.legs.stand))
    heights = backend._corners()[..., 2]
    assert heights.min() == pytest.approx(0.0, abs=1e-12)
    assert heights.max() > 1e-3
