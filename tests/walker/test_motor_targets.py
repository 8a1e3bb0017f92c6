"""Targets for motor drivers: the same walk, by torques and gains instead of angles."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.balance.feedforward import Effort
from gaitchain.messages import (
    CONTROL_PERIOD_S,
    Command,
    MeasuredJoints,
    MotorGains,
    MotorTargets,
    Sensors,
)
from gaitchain.robot.box_robot import load_box_robot
from gaitchain.sim.world import DISTURBANCES
from gaitchain.walker.motor_targets import MotorForm
from gaitchain.walker.walker import Walker

TICKS = 600
RES = load_box_robot("res")


def walked(library, write, ticks=TICKS):
    """Walk ahead; `write` sends the targets. Return the backend at the end."""
    walker = Walker(library, require_qualified=False)
    backend = MujocoBackend(library.robot)
    backend.connect(walker.stand)
    walker.command(Command(0.2))
    for _ in range(ticks):
        sensors = backend.read()
        write(backend, walker.step(sensors), sensors)
        assert not backend.fallen
    return backend


def make_motors(model):
    """Make motors of the servos, unless they are."""
    if model.actuator_dyntype[0]:  # still servos
        model.actuator_dyntype[:] = model.actuator_biastype[:] = 0
        model.actuator_gaintype[:] = 0
        model.actuator_actadr[:], model.actuator_actnum[:] = -1, 0
        model.actuator_gainprm[:] = model.actuator_biasprm[:] = 0.0
        model.actuator_gainprm[:, 0] = 1.0
        model.actuator_ctrllimited[:] = False
        model.opt.timestep /= 8.0  # a driver's rate; its damping is explicit here


def drive(backend, targets, _):
    """Send torques to motors, as a driver makes them in each step of physics."""
    model, data, motors = backend.model, backend.data, targets.motors
    make_motors(model)
    for _ in range(round(CONTROL_PERIOD_S / model.opt.timestep)):
        off, rate = motors.position - data.qpos[7:], motors.velocity - data.qvel[6:]
        data.ctrl[:] = motors.torque + motors.stiffness * off + motors.damping * rate
        mujoco.mj_step(model, data)


def test_a_motor_driver_walks_as_servos_do(brisk):
    by_servos = walked(
        brisk, lambda backend, targets, _: backend.write(targets.position)
    )
    by_torques = walked(brisk, drive)
    went = by_torques.data.qpos[:2] - by_servos.data.qpos[:2]
    assert by_servos.data.qpos[0] > 0.6
    assert np.abs(went).max() < 0.05


def test_the_driver_pushes_as_the_servo_would(brisk):
    """Whatever the joints do, up to the torque limit."""
    legs = brisk.robot.legs
    rng = np.random.default_rng(3)
    limited = 0

    def write(backend, targets, sensors):
        nonlocal limited
        motors = targets.motors
        servo = legs.damping - legs.joint_damping
        q, rate = rng.normal(size=(2, len(legs.joint_names)))
        by_servo = legs.stiffness * (targets.position - q) - servo * rate
        driver = motors.torque + motors.stiffness * (motors.position - q)
        driver += motors.damping * (motors.velocity - rate)
        free = np.abs(motors.torque) < legs.torque_limit
        limited += int((~free).sum())
        np.testing.assert_allclose(driver[free], by_servo[free], atol=1e-8)
        backend.write(targets.position)

    walked(brisk, write, 300)
    assert limited < 30


def test_what_is_fed_forward_is_most_of_what_the_motors_do(brisk):
    """Of a walk in physics, in which nothing else moves the robot."""
    asked, done = [], []

    def write(backend, targets, _):
        backend.write(targets.position)
        asked.append(targets.motors.torque)
        done.append(backend.data.actuator_force.copy())

    walked(brisk, write)
    asked, done = np.array(asked[200:]), np.array(done[200:])
    left = np.abs(done - asked).mean() / np.abs(done).mean()
    assert left < 0.6
    knees = [3, 9]
    assert np.corrcoef(asked[:, knees].ravel(), done[:, knees].ravel())[0, 1] > 0.9


def drive_softly(backend, targets, _):
    """Send a quarter of the gains to the motors, and the rest as torque every 2 ms."""
    model, data, motors = backend.model, backend.data, targets.motors
    make_motors(model)
    rotors = np.full(len(motors.position), 0.1)
    gains = MotorGains(0.25 * motors.stiffness, 0.25 * motors.damping, rotors, 2e-3)
    soft, steps = motors, round(CONTROL_PERIOD_S / model.opt.timestep)
    for step in range(steps):
        if step % (steps // 5) == 0:
            age_s = step * model.opt.timestep
            measured = MeasuredJoints(data.qpos[7:].copy(), data.qvel[6:].copy(), age_s)
            soft = motors.with_gains(gains, measured)
        off, rate = soft.position - data.qpos[7:], soft.velocity - data.qvel[6:]
        data.ctrl[:] = soft.torque + soft.stiffness * off + soft.damping * rate
        mujoco.mj_step(model, data)


def test_a_driver_keeps_its_gains_if_it_gets_the_rest_as_torque(brisk):
    """Four times as soft it walks as well; without that torque it falls."""
    by_torques = walked(brisk, drive)
    softly = walked(brisk, drive_softly)
    went = softly.data.qpos[:2] - by_torques.data.qpos[:2]
    assert by_torques.data.qpos[0] > 0.6
    assert np.abs(went).max() < 0.05


@given(
    numbers=arrays(float, (9, 3), elements=st.floats(-50.0, 50.0)),
    age_s=st.floats(0.0, 0.01),
    period_s=st.sampled_from([1e-3, 0.01, 0.1]),
)
def test_with_other_gains_a_driver_pushes_the_same_where_it_was_measured(
    numbers, age_s, period_s
):
    """But for damping beyond what a held torque gives stably."""
    position, velocity, torque, kp, kd, new_kp, new_kd, q, rate = numbers
    motors = MotorTargets(position, velocity, torque, kp, kd)
    gains = MotorGains(new_kp, new_kd, np.full(3, 0.5), period_s)
    soft = motors.with_gains(gains, MeasuredJoints(q, rate, age_s))
    on_time = position + age_s * velocity
    kd = np.minimum(kd, new_kd + 1.0 / period_s)
    pushed = torque + kp * (on_time - q) + kd * (velocity - rate)
    push = soft.torque + new_kp * (soft.position - q) + new_kd * (soft.velocity - rate)
    np.testing.assert_allclose(push, pushed, atol=1e-8)
    np.testing.assert_array_equal(soft.stiffness, new_kp)
    np.testing.assert_array_equal(soft.damping, new_kd)


def test_order_and_signs_are_the_robots(brisk):
    legs = brisk.robot.legs
    names, signs = legs.joint_names[::-1], {legs.joint_names[3]: -1}
    ours = Walker(brisk, require_qualified=False)
    theirs = Walker(brisk, require_qualified=False, joint_names=names, signs=signs)
    sign = np.array([signs.get(name, 1) for name in names])
    for walker in (ours, theirs):
        walker.command(Command(0.2))
    for tick in range(150):
        still = sensors_of(ours.stand, tick)
        one = ours.step(still).motors
        moved = replace(still, joint_position=sign * still.joint_position[::-1])
        other = theirs.step(moved).motors
    for name in ("position", "velocity", "torque"):
        np.testing.assert_allclose(
            getattr(other, name), sign * getattr(one, name)[::-1], err_msg=name
        )
    np.testing.assert_array_equal(other.stiffness, one.stiffness[::-1])
    assert np.abs(one.torque).max() > 1.0


def test_joints_outside_the_legs_keep_their_own_gains(toy_library):
    held = tuple(toy_library.robot.legs.held)
    names = (*held, *toy_library.robot.legs.joint_names)
    walker = Walker(toy_library, require_qualified=False, joint_names=names)
    motors = walker.standing_targets.motors
    own = slice(0, len(held))
    assert np.isnan(motors.stiffness[own]).all()
    assert np.isnan(motors.damping[own]).all()
    np.testing.assert_array_equal(motors.velocity, 0.0)
    np.testing.assert_array_equal(motors.torque[own], 0.0)
    np.testing.assert_allclose(motors.stiffness[len(held) :], 300.0)


@pytest.mark.parametrize("bad", [np.nan, 50.0])
def test_targets_that_are_held_push_nothing_forward(brisk, bad, monkeypatch):
    walker = Walker(brisk, require_qualified=False)
    walker.command(Command(0.2))
    step = walker.gait.step

    def spoilt(sensors):
        targets = step(sensors)
        position = targets.position.copy()
        position[4] = bad
        return replace(targets, position=position)

    monkeypatch.setattr(walker.gait, "step", spoilt)
    targets = walker.step(sensors_of(walker.stand, 0))
    assert targets.status
    np.testing.assert_array_equal(targets.motors.position, targets.position)
    np.testing.assert_array_equal(targets.motors.torque, 0.0)


effort_rows = arrays(float, 12, elements=st.floats(-300.0, 300.0))
speed_rows = arrays(float, 12, elements=st.floats(-6.0, 6.0))


@given(effort_rows, speed_rows)
def test_what_is_fed_forward_is_what_motors_have_at_their_speed(torque, velocity):
    """By the torque-speed line of the simulator's servos, and never of other sign."""
    legs = RES.legs
    given_torque = torque - legs.joint_damping * velocity
    made = MotorForm(legs).made(np.zeros(12), Effort(velocity, given_torque))
    slowest = DISTURBANCES["no_load"].strides.trained[0]
    left = 1.0 - velocity * np.sign(torque) / (slowest * legs.speed_limit)
    most = legs.torque_limit * left.clip(0.0, 1.0)
    np.testing.assert_allclose(made.torque, torque.clip(-most, most), atol=1e-9)


def test_key_poses_are_angles_alone(library):
    walker = Walker(library, require_qualified=False)
    targets = walker.step(sensors_of(walker.stand, 0))
    np.testing.assert_array_equal(targets.motors.position, targets.position)
    np.testing.assert_array_equal(targets.motors.velocity, 0.0)
    np.testing.assert_array_equal(
        targets.motors.stiffness, library.robot.legs.stiffness
    )


def sensors_of(stand, tick):
    """What a robot measures that stands still."""
    still = np.zeros(3)
    up = np.array([0.0, 0.0, 9.81])
    return Sensors(tick * CONTROL_PERIOD_S, stand, np.zeros(len(stand)), still, up)
