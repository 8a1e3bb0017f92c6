"""The landing impact, with MuJoCo's mass matrix and Jacobian as the oracle."""

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from reduced_model import mujoco_qpos

from gaitchain.gait.keypose.impact import velocity_jump
from gaitchain.gait.motion import State
from gaitchain.robot.box_robot import load_box_robot
from gaitchain.robot.kinematics import points
from gaitchain.sim.model import build_model

RES = load_box_robot("res")
SEEDS = st.integers(0, 2**32 - 1)
STEP = 1e-5


@pytest.fixture(scope="module")
def rotorless_model():
    model = build_model(RES)
    model.dof_armature[:] = 0.0
    return model


def random_contact(seed):
    rng = np.random.default_rng(seed)
    return rng.uniform(-0.6, 0.6, 7), rng.uniform(-2.0, 2.0, 7)


def reduced_dynamics(model, q, left_support=True):
    """Mass matrix (10, 10) and swing foot Jacobian (3, 10) from MuJoCo.

    The reduced velocity is the support foot's, then dq; `spread` carries it to the
    velocity of MuJoCo's 18 degrees of freedom.
    """
    data = mujoco.MjData(model)
    data.qpos[:] = mujoco_qpos(q, left_support)
    mujoco.mj_forward(model, data)
    spread = np.zeros((model.nv, 10))
    spread[:3, :3] = np.eye(3)
    for joint in range(7):
        shift = STEP * np.eye(7)[joint]
        behind, ahead = (mujoco_qpos(q + s * shift, left_support) for s in (-1, 1))
        column = np.zeros(model.nv)
        mujoco.mj_differentiatePos(model, column, 2.0 * STEP, behind, ahead)
        spread[:, 3 + joint] = column
    full = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, full)
    foot = np.zeros((3, model.nv))
    swing = model.body("right_foot" if left_support else "left_foot").id
    mujoco.mj_jacBody(model, data, foot, None, swing)
    return spread.T @ full @ spread, foot @ spread


def after_impact(mass, foot, dq):
    """Solve the inelastic impact as one saddle-point system."""
    before = np.concatenate([np.zeros(3), dq])
    system = np.block([[mass, foot.T], [foot, np.zeros((3, 3))]])
    right = np.concatenate([mass @ before, np.zeros(3)])
    return before, np.linalg.solve(system, right)[:10]


@pytest.mark.parametrize("left_support", [True, False])
@settings(max_examples=15)
@given(SEEDS)
def test_jump_matches_mujocos_mass_matrix(rotorless_model, left_support, seed):
    q, dq = random_contact(seed)
    mass, foot = reduced_dynamics(rotorless_model, q, left_support)
    before, after = after_impact(mass, foot, dq)
    jump = velocity_jump(RES, State(q, dq, np.zeros(7)))
    np.testing.assert_allclose(jump, (after - before)[3:], atol=1e-6, rtol=1e-6)


def swing_foot_velocity(q, dq):
    """Velocity of the swing ankle relative to the support ankle."""
    ahead, behind = (points(RES.reduced, q + s * STEP * dq)[6] for s in (1.0, -1.0))
    return (ahead - behind) / (2.0 * STEP)


@settings(max_examples=25)
@given(SEEDS)
def test_swing_foot_rests_and_energy_never_grows(rotorless_model, seed):
    q, dq = random_contact(seed)
    mass, foot = reduced_dynamics(rotorless_model, q)
    after = dq + velocity_jump(RES, State(q, dq, np.zeros(7)))
    # The swing foot rests, so the support foot leaves at what the joints give.
    lift_off = -swing_foot_velocity(q, after)
    before, landed = np.append(np.zeros(3), dq), np.append(lift_off, after)
    np.testing.assert_allclose(foot @ landed, 0.0, atol=1e-7)
    # Only an impulse at that foot may change the momentum: M du = J^T impulse.
    momentum = mass @ (landed - before)
    impulse = momentum[:3]  # the first three columns of J are the identity
    np.testing.assert_allclose(momentum, foot.T @ impulse, atol=1e-5)
    energy, left = before @ mass @ before, landed @ mass @ landed
    assert left <= energy * (1.0 + 1e-9)
    lost = swing_foot_velocity(q, dq) @ -impulse
    assert energy - left == pytest.approx(lost, rel=1e-5, abs=1e-8)


@settings(max_examples=25)
@given(SEEDS)
def test_a_foot_that_rests_lands_without_a_jump(seed):
    q, dq = random_contact(seed)
    columns = [swing_foot_velocity(q, unit) for unit in np.eye(7)]
    jacobian = np.stack(columns, axis=1)
    resting = dq - np.linalg.pinv(jacobian) @ jacobian @ dq
    assert np.abs(resting).max() > 1e-3
    jump = velocity_jump(RES, State(q, resting, np.zeros(7)))
    np.testing.assert_allclose(jump, 0.0, atol=1e-7)
    still = velocity_jump(RES, State(q, np.zeros(7), np.zeros(7)))
    np.testing.assert_array_equal(still, np.zeros(7))


def test_jump_is_linear_in_the_velocity_and_batches():
    rng = np.random.default_rng(4)
    q, dq = rng.uniform(-0.5, 0.5, (2, 3, 7)), rng.uniform(-1, 1, (2, 3, 7))
    jump = velocity_jump(RES, State(q, dq, dq))
    assert jump.shape == (2, 3, 7)
    doubled = velocity_jump(RES, State(q, 2.0 * dq, dq))
    np.testing.assert_allclose(doubled, 2.0 * jump, rtol=1e-9)
    for i in np.ndindex(2, 3):
        one = velocity_jump(RES, State(q[i], dq[i], dq[i]))
        np.testing.assert_allclose(jump[i], one, atol=1e-10)
