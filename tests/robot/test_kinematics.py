"""Forward kinematics against MuJoCo's on random poses, and the exchange of roles."""

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from reduced_model import MIRROR, RES, mujoco_qpos

from gaitchain.robot.joint_angles import joint_angles
from gaitchain.robot.kinematics import (
    JOINTS,
    LINKS,
    POINTS,
    com,
    exchange_roles,
    lean_accelerations,
    lean_vectors,
    link_boxes,
    link_com_accelerations,
    link_coms,
    link_inertias,
    link_masses,
    points,
)
from gaitchain.sim.model import build_model

MODEL = build_model(RES)
POSES = st.integers(0, 2**32 - 1).map(
    lambda seed: np.random.default_rng(seed).uniform(-0.7, 0.7, 7)
)
SUPPORTS = pytest.mark.parametrize("left_support", [True, False])


def mujoco_pose(q, left_support):
    data = mujoco.MjData(MODEL)
    data.qpos[:] = mujoco_qpos(q, left_support)
    mujoco.mj_kinematics(MODEL, data)
    mujoco.mj_comPos(MODEL, data)
    return data


def body_names(left_support):
    support, swing = ("left", "right") if left_support else ("right", "left")
    ours = (link.replace("support", support).replace("swing", swing) for link in LINKS)
    return list(ours)


def test_joint_order_is_the_papers():
    assert len(JOINTS) == 7
    assert [JOINTS.index(j) for j in ("support_crus", "trunk", "swing_sway")] == [
        0,
        2,
        6,
    ]


@SUPPORTS
@settings(max_examples=30)
@given(POSES)
def test_points_and_coms_match_mujoco(left_support, q):
    data = mujoco_pose(q, left_support)
    side = np.ones(3) if left_support else MIRROR
    bodies = [data.body(name) for name in body_names(left_support)]
    foot, crus, femur, trunk, swing_femur, swing_crus, swing_foot = bodies
    top = trunk.xpos + RES.reduced.trunk_length * trunk.xmat.reshape(3, 3)[:, 2]
    joints = [foot.xpos, crus.xpos, femur.xpos, top]
    joints += [swing_femur.xpos, swing_crus.xpos, swing_foot.xpos]
    np.testing.assert_allclose(points(RES.reduced, q) * side, joints, atol=1e-10)
    centres = [body.xipos for body in bodies]
    np.testing.assert_allclose(link_coms(RES.reduced, q) * side, centres, atol=1e-10)
    np.testing.assert_allclose(
        com(RES.reduced, q) * side, data.subtree_com[1], atol=1e-10
    )


@SUPPORTS
@settings(max_examples=30)
@given(POSES)
def test_soles_stay_level_with_any_lean_and_sway(left_support, q):
    data = mujoco_pose(q, left_support)
    for name in ("left_foot", "right_foot"):
        turned = data.body(name).xmat.reshape(3, 3)
        np.testing.assert_allclose(turned, np.eye(3), atol=1e-10)
    support = data.body("left_foot" if left_support else "right_foot")
    np.testing.assert_allclose(
        support.xpos, [0, 0, RES.reduced.ankle_height], atol=1e-10
    )


@SUPPORTS
def test_links_turn_as_in_mujoco(left_support):
    q = np.random.default_rng(5).uniform(-0.7, 0.7, 7)
    data = mujoco_pose(q, left_support)
    side = np.ones(3) if left_support else MIRROR
    axes = [data.body(n).xmat.reshape(3, 3)[:, 2] for n in body_names(left_support)]
    np.testing.assert_allclose(lean_vectors(q) * side, axes[1:6], atol=1e-10)


def test_masses_inertias_and_boxes_match_mujoco():
    bodies = [MODEL.body(name) for name in body_names(left_support=True)]
    masses = [body.mass[0] for body in bodies]
    np.testing.assert_allclose(link_masses(RES.reduced), masses, rtol=1e-14)
    assert (
        link_masses(RES.reduced).sum()
        == pytest.approx(RES.reduced.mass)
        == pytest.approx(31.0)
    )
    inertias = [body.inertia for body in bodies]
    np.testing.assert_allclose(link_inertias(RES.reduced), inertias, rtol=1e-14)
    sides = [2 * MODEL.geom(f"{body.name}_box").size for body in bodies]
    np.testing.assert_allclose(link_boxes(RES.reduced), sides, rtol=1e-14)
    rod = 16.0 / 12.0 * (0.3**2 + 0.5**2)
    assert link_inertias(RES.reduced)[3, 0] == pytest.approx(rod)


def test_upright_pose_by_hand():
    expected = np.array(
        [
            [0.0, 0.0, 0.07],
            [0.0, 0.0, 0.316],
            [0.0, 0.0, 0.662],
            [0.0, -0.1, 1.162],
            [0.0, -0.2, 0.662],
            [0.0, -0.2, 0.316],
            [0.0, -0.2, 0.07],
        ]
    )
    assert len(POINTS) == len(LINKS) == 7
    np.testing.assert_allclose(points(RES.reduced, np.zeros(7)), expected, atol=1e-15)


def motion(rng):
    """A pose that moves along random sines, with exact derivatives."""
    amplitude, pace = rng.uniform(0.2, 0.8, 7), rng.uniform(1.0, 3.0, 7)
    phase = rng.random(7)

    def at(time):
        angle = pace * time + phase
        return amplitude * np.sin(angle)

    angle = pace * 0.3 + phase
    velocity = amplitude * pace * np.cos(angle)
    return at, velocity, -(pace**2) * at(0.3)


def second_difference(function, time, h=1e-3):
    """Fourth-order central difference."""
    weights = np.array([-1.0, 16.0, -30.0, 16.0, -1.0]) / (12.0 * h**2)
    values = [function(time + k * h) for k in range(-2, 3)]
    return np.tensordot(weights, values, axes=1)


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1))
def test_accelerations_match_finite_differences(seed):
    at, dq, ddq = motion(np.random.default_rng(seed))
    state = at(0.3), dq, ddq
    found = second_difference(lambda t: lean_vectors(at(t)), 0.3)
    np.testing.assert_allclose(lean_accelerations(*state), found, atol=1e-7)
    found = second_difference(lambda t: link_coms(RES.reduced, at(t)), 0.3)
    np.testing.assert_allclose(
        link_com_accelerations(RES.reduced, *state), found, atol=1e-7
    )


@given(POSES)
def test_exchange_of_roles_keeps_the_body_where_it_is(q):
    exchanged = exchange_roles(q)
    np.testing.assert_array_equal(exchange_roles(exchanged), q)
    ankle = points(RES.reduced, q)[6] - [0.0, 0.0, RES.reduced.ankle_height]
    moved = (points(RES.reduced, q) - ankle) * MIRROR
    np.testing.assert_allclose(
        points(RES.reduced, exchanged), moved[[6, 5, 4, 3, 2, 1, 0]]
    )
    expected = (com(RES.reduced, q) - ankle) * MIRROR
    np.testing.assert_allclose(com(RES.reduced, exchanged), expected, atol=1e-14)
    centres = (link_coms(RES.reduced, q) - ankle) * MIRROR
    np.testing.assert_allclose(
        link_coms(RES.reduced, exchanged), centres[::-1], atol=1e-14
    )


@settings(max_examples=10)
@given(POSES)
def test_exchange_of_roles_keeps_the_servo_angles(q):
    same = joint_angles(exchange_roles(q), left_support=False)
    np.testing.assert_allclose(same, joint_angles(q, left_support=True), atol=1e-14)


@pytest.mark.parametrize("batch", [(), (3,), (2, 3), (0,)])
def test_batches(batch):
    rng = np.random.default_rng(1)
    q, dq, ddq = rng.uniform(-0.5, 0.5, (3, *batch, 7))
    for function in (points, link_coms, com):
        result = function(RES.reduced, q)
        assert result.shape[: len(batch)] == batch
        for index in np.ndindex(batch):
            one = function(RES.reduced, q[index])
            np.testing.assert_allclose(result[index], one, atol=1e-14)
    assert link_com_accelerations(RES.reduced, q, dq, ddq).shape == (*batch, 7, 3)
    assert joint_angles(q, left_support=True).shape == (*batch, 12)
