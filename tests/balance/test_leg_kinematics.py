"""The legs online, against MuJoCo: kinematics, CoM, and the torques that hold them."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from other_robots import with_legs
from walk_record import walk_record

from gaitchain.balance.feedforward import (
    LegLoad,
    carry,
    holding_torques,
    lead,
    multi_link_zmp,
    rates_of,
    track_links,
)
from gaitchain.balance.gains import derive_gains, open_loop
from gaitchain.balance.leg_ik import leg_joints
from gaitchain.balance.leg_kinematics import com_from_pelvis, legs_of, posture
from gaitchain.balance.rotations import about, product, rotation
from gaitchain.balance.state import (
    DOUBLE,
    SETTLE,
    SINGLE,
    STAND,
    Foot,
    GaitState,
    Pelvis,
    Planar,
    StepTimes,
)
from gaitchain.messages import GRAVITY
from gaitchain.robot.box_robot import JOINT_NAMES, box_legs, load_box_robot
from gaitchain.sim.model import build_model

RES = load_box_robot("res")
LEGS = legs_of(RES)
GAINS = derive_gains(LEGS)
TIMES = StepTimes(
    step=0.46, single=0.4, rise=0.2, shift=1.0, hip_height=0.5, omega=4.0, period=0.01
)
SIDES = {"left": 1.0, "right": -1.0}
LINKS = {"femur": 2, "crus": 3, "foot": 5}
"""Joint that moves each link of the boxes; the others move nothing of their own."""
ANGLES = st.lists(st.floats(-1.2, 1.2), min_size=12, max_size=12).map(np.array)
TURNS = st.floats(-0.6, 0.6)


@pytest.fixture(scope="module")
def model():
    return build_model(RES)


def posed(model, joints, base=(0.0, 0.0, 0.0)):
    """The simulator with joints (12,) and the trunk turned by yaw, pitch, roll."""
    data = mujoco.MjData(model)
    data.qpos[:3] = 0.3, -0.2, 2.0  # off the floor
    mujoco.mju_mat2Quat(data.qpos[3:7], rotation(*base).ravel())
    data.qpos[7:] = joints
    mujoco.mj_forward(model, data)
    return data


def legs():
    for leg, (name, side) in enumerate(SIDES.items()):
        yield leg, name, side, slice(6 + 6 * leg, 12 + 6 * leg)


def simulated(axis, angle):
    result, quaternion = np.empty(9), np.empty(4)
    mujoco.mju_axisAngle2Quat(quaternion, axis, angle)
    mujoco.mju_quat2Mat(result, quaternion)
    return result.reshape(3, 3)


@settings(max_examples=40)
@given(TURNS, TURNS, TURNS)
def test_rotations_are_those_about_the_axes(yaw, pitch, roll):
    x, y, z = np.eye(3)
    expected = simulated(z, yaw) @ simulated(y, pitch) @ simulated(x, roll)
    np.testing.assert_allclose(rotation(yaw, pitch, roll), expected, atol=1e-12)
    hip = simulated(z, yaw) @ simulated(x, roll) @ simulated(y, pitch)
    np.testing.assert_allclose(product(expected, hip), expected @ hip, atol=1e-12)


@settings(max_examples=100)
@given(st.integers(0, 2**32 - 1), st.floats(-7.0, 7.0))
def test_a_rotation_about_any_axis_is_the_simulators(seed, angle):
    axis = np.random.default_rng(seed).normal(size=3)
    axis /= np.linalg.norm(axis)
    np.testing.assert_allclose(about(axis, angle), simulated(axis, angle), atol=1e-12)
    np.testing.assert_allclose(about(axis, angle) @ axis, axis, atol=1e-12)


@settings(max_examples=40)
@given(ANGLES, TURNS, TURNS, TURNS)
def test_links_are_where_the_simulator_has_them(joints, yaw, pitch, roll):
    model = build_model(RES)
    data = posed(model, joints, (yaw, pitch, roll))
    trunk, found = data.body("trunk"), posture(LEGS, joints)
    turn = trunk.xmat.reshape(3, 3)
    own = [model.joint(name).id for name in JOINT_NAMES]
    for seen, mine in (
        ((data.xanchor[own] - trunk.xpos) @ turn, found.centres),
        (data.xaxis[own] @ turn, found.axes),
    ):
        np.testing.assert_allclose(mine.reshape(12, 3), seen, atol=1e-12)
    for leg, name, _, _ in legs():
        for link, joint in LINKS.items():
            com = (data.body(f"{name}_{link}").xipos - trunk.xpos) @ turn
            np.testing.assert_allclose(found.coms[leg, joint], com, atol=1e-12)
        foot = data.body(f"{name}_foot")
        ankle = (foot.xpos - trunk.xpos) @ turn
        np.testing.assert_allclose(found.ankles[leg], ankle, atol=1e-12)
        np.testing.assert_allclose(
            found.feet[leg], turn.T @ foot.xmat.reshape(3, 3), atol=1e-12
        )


@settings(max_examples=40)
@given(ANGLES, TURNS, TURNS)
def test_the_com_is_the_simulators(joints, pitch, roll):
    data = posed(build_model(RES), joints, (0.0, pitch, roll))
    expected = data.subtree_com[1] - data.body("trunk").xpos
    com = com_from_pelvis(LEGS, posture(LEGS, joints))
    np.testing.assert_allclose(rotation(0.0, pitch, roll) @ com, expected, atol=1e-12)


def start_of(leg):
    return LEGS.start[6 * leg : 6 * leg + 6]


def placed(leg, own):
    """Where one leg's joints put its ankle and its foot."""
    joints = np.zeros(12)
    joints[6 * leg : 6 * leg + 6] = own
    found = posture(LEGS, joints)
    return found.ankles[leg], found.feet[leg], found.centres[leg, 0]


@settings(max_examples=200)
@given(
    st.sampled_from([0, 1]),
    st.tuples(
        st.floats(-0.8, 0.8),  # yaw
        st.floats(-0.6, 0.6),  # roll
        st.floats(-1.3, 0.8),  # pitch
        st.floats(0.1, 1.39),  # knee: not straight, where the way back is steep
        st.floats(-0.8, 0.6),  # ankle pitch
        st.floats(-0.6, 0.6),  # ankle roll
    ).map(np.array),
)
def test_inverse_kinematics_finds_the_joints_again(leg, joints):
    """From the standing pose, however far. It stops within 1e-8 of the target."""
    ankle, foot, _ = placed(leg, joints)
    found = leg_joints(LEGS, leg, ankle, foot, start_of(leg))
    np.testing.assert_allclose(found, joints, atol=2e-6)  # a straight knee is steep
    for mine, wanted in zip(placed(leg, found), (ankle, foot), strict=False):
        np.testing.assert_allclose(mine, wanted, atol=2e-8)
    again = leg_joints(LEGS, leg, ankle, foot, joints)
    np.testing.assert_allclose(again, joints, atol=1e-12)


@settings(max_examples=60)
@given(
    st.sampled_from([0, 1]),
    st.floats(0.65, 3.0),
    st.floats(-0.5, 0.5),
    st.floats(-0.5, 0.5),
)
def test_a_foot_out_of_reach_is_met_in_direction(leg, distance, ahead, aside):
    """The leg points at it, all but straight, and the sole lies as it should."""
    _, _, hip = placed(leg, np.zeros(6))
    way = np.array([ahead, aside, -1.0]) / np.linalg.norm([ahead, aside, 1.0])
    joints = leg_joints(LEGS, leg, hip + distance * way, np.eye(3), start_of(leg))
    ankle, foot, _ = placed(leg, joints)
    reached = ankle - hip
    assert 0.99 * LEGS.leg < np.linalg.norm(reached) < LEGS.leg
    np.testing.assert_allclose(reached / np.linalg.norm(reached), way, atol=1e-7)
    np.testing.assert_allclose(foot, np.eye(3), atol=1e-7)


def test_a_leg_drawn_in_too_far_gives_numbers():
    """Nearer than the folded leg: femur and crus differ in length."""
    ankle = np.array([0.0, 0.5 * LEGS.hip_width, -0.01])
    assert np.isfinite(leg_joints(LEGS, 0, ankle, np.eye(3), start_of(0))).all()


@settings(max_examples=30)
@given(ANGLES)
def test_a_hanging_leg_needs_what_gravity_takes(joints):
    """Nothing moves: the simulator's bias force is gravity alone."""
    data = posed(build_model(RES), joints)
    none, still, found = np.zeros(3), np.zeros((6, 3)), posture(LEGS, joints)
    for leg, _, _, dofs in legs():
        load = LegLoad(none, 0.0, 0.0, 0.0)
        torques = holding_torques(LEGS, found, leg, load, still)
        np.testing.assert_allclose(torques, data.qfrc_bias[dofs], atol=1e-9)


@settings(max_examples=30)
@given(
    ANGLES,
    st.tuples(st.floats(-90, 90), st.floats(-90, 90), st.floats(0, 400)).map(np.array),
    st.floats(-0.09, 0.13),
    st.floats(-0.06, 0.06),
    st.lists(st.floats(-20, 20), min_size=9, max_size=9).map(
        lambda a: np.array(a).reshape(3, 3)
    ),
    st.floats(0.0, 1.0),
)
def test_torques_carry_ground_force_weight_and_inertia(
    joints, force, zmp_x, zmp_y, acceleration, part
):
    """tau = gravity + sum J_i^T m_i a_i - J_zmp^T F, with the simulator's Jacobians."""
    model = build_model(RES)
    data, found = posed(model, joints), posture(LEGS, joints)
    of_links = np.zeros((6, 3))
    of_links[list(LINKS.values())] = acceleration
    for leg, name, _, dofs in legs():
        expected = np.array(data.qfrc_bias[dofs])
        foot = data.body(f"{name}_foot")
        lever = np.array([zmp_x, zmp_y, -LEGS.ankle_height])
        acts = foot.xpos + foot.xmat.reshape(3, 3) @ lever
        jacobian = np.zeros((3, model.nv))
        mujoco.mj_jac(model, data, jacobian, None, acts, foot.id)
        expected -= jacobian[:, dofs].T @ force
        for link, a in zip(LINKS, part * acceleration, strict=True):
            body = data.body(f"{name}_{link}")
            mujoco.mj_jac(model, data, jacobian, None, body.xipos, body.id)
            expected += jacobian[:, dofs].T @ a * model.body(body.id).mass[0]
        load = LegLoad(force, zmp_x, zmp_y, part)
        torques = holding_torques(LEGS, found, leg, load, of_links)
        np.testing.assert_allclose(torques, expected, atol=1e-8)


def on_one_leg(side):
    """Joints with the support sole level under the CoM and the other foot lifted."""
    joints = np.zeros(12)
    place = 0.5 * side * LEGS.hip_width
    feet = {
        side: np.array([0.03, 0.4 * place, -0.52]),
        -side: np.array([0.05, -place, -0.4]),
    }
    for leg, _, which, _ in legs():
        joints[6 * leg : 6 * leg + 6] = leg_joints(
            LEGS, leg, feet[which], np.eye(3), start_of(leg)
        )
    return joints, feet[side]


def com_of(joints):
    return com_from_pelvis(LEGS, posture(LEGS, joints))


def at_rest(joints):
    """(2, 3, n, 3) links that do not move."""
    links = np.zeros((2, 3, 6, 3))
    links[:, 0] = posture(LEGS, joints).coms
    return links


def in_double_support(share, side, force, foot_zmp):
    """Record of a walk whose support foot bears a share, the ground pushing so [N]."""
    time_s = TIMES.step - share * (TIMES.step - TIMES.single)
    away = force[:2] / (LEGS.mass * TIMES.omega**2)  # pelvis from ZMP
    pelvis = Pelvis(away[0], side * away[1])
    state = GaitState(DOUBLE, side, time_s, pelvis)
    gains = open_loop(GAINS)._replace(foot_zmp=foot_zmp)
    return walk_record(gains, TIMES, state=state)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_standing_on_one_leg_is_in_static_equilibrium(model, side):
    """Under the CoM, weight and torques leave nothing over on any of 18 coordinates."""
    joints, ankle = on_one_leg(side)
    data = posed(model, joints)
    com = com_of(joints) - ankle
    weight = np.array([0.0, 0.0, LEGS.mass * GRAVITY])
    zmp = Planar(com[0], side * com[1])  # the step frame is mirrored
    state = GaitState(SINGLE, side, pelvis=Pelvis(*zmp), zmp=zmp)
    walk = walk_record(open_loop(GAINS), TIMES, state=state)
    torques = carry(LEGS, walk, posture(LEGS, joints), at_rest(joints))
    np.testing.assert_allclose(walk.sole_zmp.item(), zmp)
    foot = model.body("left_foot" if side > 0 else "right_foot").id
    below = data.body(foot).xpos + np.array([com[0], com[1], -LEGS.ankle_height])
    jacobian = np.zeros((3, model.nv))
    mujoco.mj_jac(model, data, jacobian, None, below, foot)
    left_over = data.qfrc_bias - jacobian.T @ weight
    left_over[6:] -= torques
    np.testing.assert_allclose(left_over, 0.0, atol=1e-8)


@pytest.mark.parametrize("ahead", [0.12, 0.0, -0.08])
@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("phase", [SETTLE, STAND])
def test_standing_on_both_legs_is_in_static_equilibrium(model, phase, side, ahead):
    """One foot may be ahead: some forces on the soles balance weight and torques."""
    place = 0.5 * side * LEGS.hip_width
    feet = {side: np.array([-0.03, place, -0.5])}
    feet[-side] = feet[side] + [ahead, -2.0 * place, 0.0]
    joints = np.zeros(12)
    for leg, _, which, _ in legs():
        joints[6 * leg : 6 * leg + 6] = leg_joints(
            LEGS, leg, feet[which], np.eye(3), start_of(leg)
        )
    com = com_of(joints) - feet[side]
    zmp = Planar(com[0], side * com[1])
    other = Foot(ahead, -LEGS.hip_width)
    state = GaitState(phase, side, pelvis=Pelvis(*zmp), zmp=zmp, lift_off=other)
    walk = walk_record(open_loop(GAINS), TIMES, state=state)
    torques = carry(LEGS, walk, posture(LEGS, joints), at_rest(joints))
    data, soles = posed(model, joints), []
    for name in ("left_foot", "right_foot"):
        force, turn = np.zeros((2, 3, model.nv))
        foot = model.body(name).id
        mujoco.mj_jac(model, data, force, turn, data.body(foot).xpos, foot)
        soles += [force, turn]
    left_over = data.qfrc_bias.copy()
    left_over[6:] -= torques
    jacobian = np.vstack(soles)
    forces = np.linalg.lstsq(jacobian.T, left_over, rcond=None)[0]
    np.testing.assert_allclose(jacobian.T @ forces, left_over, atol=1e-6)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_other_foot_carries_what_it_has_to(model, side):
    """Its torques, by the simulator's Jacobian of that point of the sole."""
    joints, _ = on_one_leg(side)
    data = posed(model, joints)
    force = np.array([20.0, -10.0, LEGS.mass * GRAVITY])
    walk = in_double_support(0.0, side, force, Planar(0.03, -0.02))
    torques = carry(LEGS, walk, posture(LEGS, joints), at_rest(joints))
    foot = model.body("right_foot" if side > 0 else "left_foot").id
    own = slice(6, 12) if side > 0 else slice(0, 6)
    acts = data.body(foot).xpos + np.array([0.03, side * 0.02, -LEGS.ankle_height])
    jacobian = np.zeros((3, model.nv))
    mujoco.mj_jac(model, data, jacobian, None, acts, foot)
    expected = (data.qfrc_bias - jacobian.T @ force)[6:]
    np.testing.assert_allclose(torques[own], expected[own], atol=1e-8)


def test_the_weight_is_shared_between_the_feet():
    joints, _ = on_one_leg(1.0)
    weight = np.array([0.0, 0.0, LEGS.mass * GRAVITY])
    found, links = posture(LEGS, joints), at_rest(joints)

    def torques(share):
        walk = in_double_support(share, 1.0, weight, Planar(0.02, 0.01))
        return carry(LEGS, walk, found, links)

    none, half, whole = map(torques, (0.0, 0.5, 1.0))
    np.testing.assert_allclose(half, 0.5 * (none + whole), atol=1e-9)
    load, still = LegLoad(np.zeros(3), 0.0, 0.0, 0.0), np.zeros((6, 3))
    hanging = holding_torques(LEGS, found, 1, load, still)
    np.testing.assert_allclose(whole[6:], hanging, atol=1e-12)


def test_a_robot_at_rest_has_its_zmp_under_its_com():
    joints, ankle = on_one_leg(1.0)
    links = at_rest(joints)
    pelvis = np.array([-ankle[0], -ankle[1], LEGS.ankle_height - ankle[2]])
    zmp = multi_link_zmp(LEGS, links, pelvis, 0.0, 0.0)
    com = pelvis + com_of(joints)
    np.testing.assert_allclose(zmp, com[:2], atol=1e-12)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_steadily_pulled_robot_has_its_zmp_behind(side):
    """All links accelerate alike: p = c - z c'' / g, as for a pendulum."""
    joints, ankle = on_one_leg(side)
    links = at_rest(joints)
    pelvis = np.array([-ankle[0], -ankle[1], LEGS.ankle_height - ankle[2]])
    com = pelvis + com_of(joints)
    zmp = multi_link_zmp(LEGS, links, pelvis, 1.3, -0.7)
    expected = com[:2] - com[2] / GRAVITY * np.array([1.3, -0.7])
    np.testing.assert_allclose(zmp, expected, atol=1e-12)


def test_the_lead_makes_servos_hold_the_reference(model):
    """At the reference, the simulator's servos push as hard as the pose needs."""
    rng = np.random.default_rng(3)
    before = rng.normal(0.0, 0.3, 12)
    now = before + 0.01 * rng.normal(0.0, 0.3, 12)
    torques = rng.uniform(-80.0, 80.0, 12)
    data = mujoco.MjData(model)
    data.qpos[7:], data.qvel[6:] = now, (now - before) / 0.01
    rates = rates_of(now, before, 0.01)
    data.ctrl[:] = data.act[:] = lead(LEGS, now, rates, torques)
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(data.actuator_force, torques, atol=1e-9)


def test_links_are_tracked_to_their_speed_and_acceleration():
    """Along parabolas: speed is that of half a period ago; a jump is held back."""
    period, joints = 0.01, np.random.default_rng(1).normal(0.0, 0.3, 12)
    found, links = posture(LEGS, joints), at_rest(joints)
    start, pull = found.coms.copy(), np.random.default_rng(2).normal(size=(2, 6, 3))
    for tick in range(1, 41):
        time = tick * period
        found.coms[:] = start + 0.5 * pull * time**2
        track_links(found, links, period)
    np.testing.assert_array_equal(links[:, 0], found.coms)
    np.testing.assert_allclose(links[:, 1], pull * (time - 0.5 * period), atol=1e-9)
    np.testing.assert_allclose(links[:, 2], pull, atol=1e-7)
    found.coms[:] += 10.0
    track_links(found, links, period)
    assert links[:, 2].max() < 40.0


def test_a_sole_that_tapers_bears_where_it_is_wide():
    """A triangle from a heel to a toe edge of 60 mm, 175 mm ahead."""
    sole = ((0.14, 0.03), (-0.035, 0.0), (0.14, -0.03))
    boxes = box_legs(RES.reduced)
    tapers = replace(boxes, soles=(sole, sole), torque_limit=np.full(12, 1e3))
    size = {"sole_width": 0.03, "sole_length": 0.175, "sole_offset": 0.0525}
    legs = legs_of(with_legs(RES, tapers, **size))
    assert legs.sole_taper == pytest.approx(0.03 / 0.175)
    assert legs.firm_rear == pytest.approx(-0.035 + 0.375 * 0.175, abs=1e-3)  # 22.5 mm
    assert legs.firm_front == pytest.approx(0.14)
    even = legs_of(with_legs(RES, replace(tapers, soles=()), **size))
    assert even.sole_taper == 0.0
    assert (even.firm_rear, even.firm_front) == pytest.approx((-0.035, 0.14))


def test_only_feedback_keeps_the_zmp_where_a_sole_is_wide():
    gains = derive_gains(LEGS._replace(firm_rear=0.01, firm_front=0.05))
    assert (gains.firm_rear, gains.firm_front) == (0.01, 0.05)
    plan = open_loop(gains)
    assert (plan.firm_rear, plan.firm_front) == (-np.inf, np.inf)
