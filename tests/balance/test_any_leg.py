"""Legs of any make, against MuJoCo models built from the same numbers."""

import mujoco
import numpy as np
from any_leg import any_legs, simulator
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from other_robots import with_legs

from gaitchain.balance.feedforward import LegLoad, holding_torques, load_torques
from gaitchain.balance.leg_kinematics import (
    angular_momentum,
    com_from_pelvis,
    com_velocity,
    legs_of,
    link_speeds,
    posture,
)
from gaitchain.balance.rotations import rotation
from gaitchain.balance.state import Attitude
from gaitchain.balance.support_foot import see_support
from gaitchain.robot.box_robot import load_box_robot

RES = load_box_robot("res")
SEEDS = st.integers(0, 2**32 - 1)
COUNTS = st.sampled_from([5, 6, 7])


class Case:
    """A random robot in a random pose, twice: the simulator's and ours."""

    def __init__(self, seed, count, base=(0.0, 0.0, 0.0), moves=False):
        self.rng = rng = np.random.default_rng(seed)
        self.count, self.model_legs = count, any_legs(rng, count)
        self.legs = legs_of(with_legs(RES, self.model_legs))
        self.model = simulator(self.model_legs)
        self.data = mujoco.MjData(self.model)
        self.joints = rng.uniform(-3.0, 3.0, 2 * count)
        self.rates = rng.uniform(-5.0, 5.0, 2 * count) * moves
        self.data.qpos[:3] = rng.uniform(-1.0, 1.0, 3)
        mujoco.mju_mat2Quat(self.data.qpos[3:7], rotation(*base).ravel())
        self.data.qpos[7:], self.data.qvel[6:] = self.joints, self.rates
        self.found = posture(self.legs, self.joints)
        self.forward()

    def forward(self):
        mujoco.mj_forward(self.model, self.data)
        mujoco.mj_subtreeVel(self.model, self.data)

    @property
    def turn(self):
        return self.data.body("trunk").xmat.reshape(3, 3)

    def seen(self, points):
        """Points of the world in the pelvis frame."""
        return (points - self.data.body("trunk").xpos) @ self.turn

    def ankle(self, leg):
        return self.data.site(f"ankle_{leg}")

    def dofs(self, leg):
        return slice(6 + self.count * leg, 6 + self.count * (leg + 1))

    def jacobian(self, at, leg, link):
        """Of a point of a leg's link, by that leg's joints."""
        result = np.zeros((3, self.model.nv))
        body = self.model.body(self.model_legs.joint_names[self.count * leg + link]).id
        mujoco.mj_jac(self.model, self.data, result, None, at, body)
        return result

    def velocity(self, site):
        """World velocity of a site."""
        result = np.zeros((3, self.model.nv))
        mujoco.mj_jacSite(self.model, self.data, result, None, site.id)
        return result @ self.data.qvel

    def points_momentum(self):
        """Angular momentum of all bodies as points, about the CoM and over the mass."""
        data, total, moves = self.data, np.zeros(3), np.zeros((3, self.model.nv))
        com, speed = data.subtree_com[1], data.subtree_linvel[1]
        for body in range(1, self.model.nbody):
            mujoco.mj_jacBodyCom(self.model, data, moves, None, body)
            relative = moves @ data.qvel - speed
            mass = self.model.body_mass[body]
            total += mass * np.cross(data.xipos[body] - com, relative)
        return total @ self.turn / self.model.body_mass[1:].sum()


BASES = st.tuples(*[st.floats(-1.3, 1.3)] * 3)


@settings(max_examples=60)
@given(SEEDS, COUNTS, BASES)
def test_any_leg_is_where_the_simulator_has_it(seed, count, base):
    case = Case(seed, count, base)
    data, found = case.data, case.found
    shape = (2, count, 3)
    for seen, mine in (
        (case.seen(data.xanchor[1:]), found.centres),
        (data.xaxis[1:] @ case.turn, found.axes),
        (case.seen(data.xipos[2:]), found.coms),
    ):
        np.testing.assert_allclose(mine, seen.reshape(shape), atol=1e-12)
    for leg in range(2):
        site = case.ankle(leg)
        np.testing.assert_allclose(found.ankles[leg], case.seen(site.xpos), atol=1e-12)
        foot = case.turn.T @ site.xmat.reshape(3, 3)
        np.testing.assert_allclose(found.feet[leg], foot, atol=1e-12)
    com = case.seen(data.subtree_com[1])
    np.testing.assert_allclose(com_from_pelvis(case.legs, found), com, atol=1e-12)


@settings(max_examples=60)
@given(SEEDS, COUNTS, BASES)
def test_com_and_ankles_move_as_in_the_simulator(seed, count, base):
    """About a pelvis that turns, but stays where it is."""
    case = Case(seed, count, base, moves=True)
    spin = case.rng.uniform(-3.0, 3.0, 3)
    case.data.qvel[3:6] = spin  # in the trunk's frame
    case.forward()
    links, ankles = link_speeds(case.legs, case.found, case.rates, spin)
    trunk = np.cross(spin, case.legs.trunk_com)
    com = com_velocity(case.legs, links, trunk)
    seen = case.data.subtree_linvel[1] @ case.turn
    np.testing.assert_allclose(com, seen, atol=1e-10)
    momentum = angular_momentum(case.legs, case.found.coms, links, trunk)
    np.testing.assert_allclose(momentum, case.points_momentum(), atol=1e-10)
    for leg in range(2):
        speed = case.velocity(case.ankle(leg)) @ case.turn
        np.testing.assert_allclose(ankles[leg], speed, atol=1e-10)


def attitude_with_rates(case, angles, spin):
    """Euler rates by differences of what the simulator's quaternion turns to."""

    def euler(time_s):
        quaternion = case.data.qpos[3:7].copy()
        mujoco.mju_quatIntegrate(quaternion, spin, time_s)
        m = np.empty(9)
        mujoco.mju_quat2Mat(m, quaternion)
        return np.array(
            [np.arctan2(m[7], m[8]), -np.arcsin(m[6]), np.arctan2(*m[3::-3])]
        )

    rates = (euler(1e-5) - euler(-1e-5)) / 2e-5
    return Attitude(*angles[::-1], *rates)


@settings(max_examples=60)
@given(SEEDS, COUNTS, st.tuples(*[st.floats(-0.5, 0.5)] * 3), st.sampled_from([0, 1]))
def test_the_support_sees_the_com_as_the_simulator_does(seed, count, base, leg):
    """Place from the ankle of a tipped foot, velocity from its corner that bears."""
    case = Case(seed, count, base, moves=True)
    spin, side = case.rng.uniform(-1.0, 1.0, 3), 1.0 - 2.0 * leg
    case.data.qvel[3:6] = spin
    case.forward()
    attitude = attitude_with_rates(case, base, spin)
    view = see_support(case.legs, attitude, side, case.joints, case.rates)

    foot, other = case.ankle(leg), case.ankle(1 - leg)
    ahead = foot.xmat.reshape(3, 3)[:2, 0]
    ahead = ahead / np.linalg.norm(ahead)
    axes = np.array([ahead, side * np.array([-ahead[1], ahead[0]])])
    place = axes @ (case.data.subtree_com[1] - foot.xpos)[:2]
    turn = foot.xmat.reshape(3, 3)
    assume(np.abs(turn[2, :2]).min() > 0.02)
    legs = case.legs
    along = legs.sole_front if turn[2, 0] < 0.0 else legs.sole_rear
    across = -np.sign(turn[2, 1]) * legs.sole_half_width
    bears = foot.xpos + turn @ [along, across, -legs.ankle_height]
    moves = np.zeros((3, case.model.nv))
    body = case.model.site_bodyid[foot.id]
    mujoco.mj_jac(case.model, case.data, moves, None, bears, body)
    speed = axes @ (case.data.subtree_linvel[1] - moves @ case.data.qvel)[:2]
    np.testing.assert_allclose(view.com[:2], place, atol=1e-9)
    np.testing.assert_allclose(view.com[2:], speed, atol=1e-6)
    swing = axes @ (other.xpos - foot.xpos)[:2]
    np.testing.assert_allclose(view.swing[:2], swing, atol=1e-9)


def sole_point(case, leg, x, y):
    site = case.ankle(leg)
    lever = np.array([x, y, -case.legs.ankle_height])
    return site.xpos + site.xmat.reshape(3, 3) @ lever


def expected_torques(case, leg, force, zmp, accelerations):
    """Gravity + sum J_i^T m_i a_i - J_zmp^T F, in that leg's joints."""
    dofs, last = case.dofs(leg), case.count - 1
    acts = sole_point(case, leg, *zmp)
    result = case.data.qfrc_bias - case.jacobian(acts, leg, last).T @ force
    for link, a in enumerate(accelerations):
        at = case.data.xipos[2 + case.count * leg + link]
        pull = case.legs.link_mass[leg, link] * a
        result = result + case.jacobian(at, leg, link).T @ pull
    return result[dofs]


@settings(max_examples=60)
@given(SEEDS, COUNTS, st.floats(0.0, 1.0))
def test_any_leg_carries_ground_force_weight_and_inertia(seed, count, part):
    case = Case(seed, count)
    for leg in range(2):
        force = case.rng.uniform(-300.0, 300.0, 3)
        zmp = case.rng.uniform(-0.1, 0.1, 2)
        pulls = case.rng.uniform(-20.0, 20.0, (count, 3))
        load = LegLoad(force, *zmp.tolist(), part)
        torques = holding_torques(case.legs, case.found, leg, load, pulls)
        expected = expected_torques(case, leg, force, zmp, part * pulls)
        np.testing.assert_allclose(torques, expected, atol=1e-8)


@settings(max_examples=30)
@given(SEEDS, COUNTS)
def test_each_of_any_two_legs_carries_its_own_load(seed, count):
    case = Case(seed, count)
    links = case.rng.uniform(-9.0, 9.0, (2, 3, count, 3))
    loads = [
        LegLoad(
            case.rng.uniform(-300.0, 300.0, 3),
            *case.rng.uniform(-0.1, 0.1, 2).tolist(),
            inertia,
        )
        for inertia in (0.0, 0.7)
    ]
    torques = load_torques(case.legs, case.found, *loads, links)
    for leg, load in enumerate(loads):
        pulls = load.inertia * links[leg, 2]
        expected = expected_torques(case, leg, load.force, load[1:3], pulls)
        own = slice(count * leg, count * (leg + 1))
        np.testing.assert_allclose(torques[own], expected, atol=1e-8)
