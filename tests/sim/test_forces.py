"""Pushes on any body, punches, arms and payload; oracles are MuJoCo and statics."""

from itertools import islice

import mujoco
import numpy as np
import pytest

from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.cli.world_options import parse_punches, parse_pushes
from gaitchain.discover.loaded_robot import load_robot
from gaitchain.errors import CommandError
from gaitchain.messages import CONTROL_PERIOD_S, GRAVITY
from gaitchain.sim.arm_motion import ArmMotion
from gaitchain.sim.push_force import Pushes, draw_punches
from gaitchain.sim.world import Punches, Push, World

RES = load_robot("res")
STAND = np.zeros(12)


def _momentum(backend: MujocoBackend) -> np.ndarray:
    model, data = backend.model, backend.data
    mujoco.mj_subtreeVel(model, data)
    return float(model.body_mass.sum()) * np.array(data.subtree_linvel[1])


def test_a_push_gives_its_impulse_to_the_robot_whatever_body_it_hits() -> None:
    for body in ("trunk", "left_crus"):
        push = Push(3.0, 30.0, 0.0, 0.02, elevation_deg=40.0, body=body)
        backend = MujocoBackend(RES, World(push=(push,)))
        backend.connect(STAND)
        backend.model.opt.gravity[:] = 0.0
        backend.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
        for _ in range(round(0.04 / CONTROL_PERIOD_S)):
            backend.write(STAND)
        expected = 3.0 * np.array(push.axis(0.0))
        np.testing.assert_allclose(_momentum(backend), expected, atol=0.02)


def test_an_unknown_body_is_refused_with_those_that_there_are() -> None:
    with pytest.raises(CommandError, match=r"body 'arm': the robot has trunk, left_"):
        MujocoBackend(RES, World(push=(Push(1.0, 0.0, 0.0, body="arm"),)))


def test_punches_follow_from_the_seed_and_hit_heavy_bodies_more_often() -> None:
    masses = MujocoBackend(RES).masses
    punches = Punches(20.0, every_s=2.0)
    drawn = list(islice(draw_punches(World(seed=4), punches, masses), 4000))
    again = list(islice(draw_punches(World(seed=4), punches, masses), 10))
    assert drawn[:10] == again
    assert [push.at_s for push in again] == [2.0 * (i + 1) for i in range(10)]
    impulses = np.array([push.impulse_ns for push in drawn])
    assert impulses.min() >= 0.0
    assert impulses.max() <= 20.0
    assert abs(impulses.mean() - 10.0) < 0.5
    axes = np.array([push.axis(0.0) for push in drawn])  # uniform on the sphere
    np.testing.assert_allclose(axes.mean(axis=0), 0.0, atol=0.05)
    np.testing.assert_allclose((axes**2).mean(axis=0), 1.0 / 3.0, atol=0.03)
    hit = np.mean([push.body == "trunk" for push in drawn])
    assert abs(hit - masses["trunk"] / sum(masses.values())) < 0.03


def test_a_punch_is_over_before_the_next_one_is_due() -> None:
    first, second = Push(1.0, 0.0, 1.0, 0.1), Push(2.0, 90.0, 2.0, 0.1)
    pushes = Pushes((), iter((first, second)))
    assert pushes
    assert not pushes.impulses_within(0.5, 0.1, 0.0)
    np.testing.assert_allclose(
        pushes.impulses_within(1.0, 0.05, 0.0)["trunk"], [0.5, 0.0, 0.0], atol=1e-12
    )
    assert pushes.known(1.05) == [first]
    np.testing.assert_allclose(
        pushes.impulses_within(2.0, 0.2, 0.0)["trunk"], [0.0, 2.0, 0.0], atol=1e-12
    )
    assert pushes.known(2.2) == [first, second]
    assert not pushes.impulses_within(3.0, 1.0, 0.0)
    assert not pushes


def test_arms_at_rest_push_nothing_and_raised_ones_shift_the_weight() -> None:
    arms = ArmMotion(RES, World(seed=1))
    upright, com = np.eye(3), np.array([0.0, 0.0, 0.1])
    np.testing.assert_array_equal(arms.wrench(0.0, upright, com), np.zeros(6))
    # Arms that rest in an aim for a moment: their acceleration is 0 there.
    wrench = arms.wrench(0.8, upright, com)
    places = arms._places(0.8) - arms._places(0.0)
    weight = 0.05 * RES.reduced.mass * GRAVITY
    expected = [-weight * places[:, 1].sum(), weight * places[:, 0].sum(), 0.0]
    np.testing.assert_allclose(wrench[3:], expected, atol=0.02 * weight)
    np.testing.assert_allclose(wrench[:3], 0.0, atol=0.02 * weight)


def test_the_forces_of_moving_arms_add_up_to_what_their_momentum_changed_by() -> None:
    """From rest to rest the impulse is 0: F = -m r'' leaves no momentum."""
    arms = ArmMotion(RES, World(seed=2))
    times = np.linspace(0.0, 0.8, 2001)
    forces = [arms.wrench(float(t), np.eye(3), np.zeros(3))[:3] for t in times]
    assert np.abs(forces).max() > 1.0
    np.testing.assert_allclose(np.trapezoid(forces, times, axis=0), 0.0, atol=0.02)


def test_moving_arms_disturb_a_standing_robot_and_still_ones_do_not() -> None:
    def sway(arms: str) -> float:
        backend = MujocoBackend(RES, World(seed=3, arms=arms))
        backend.connect(STAND)
        tilts = []
        for _ in range(300):
            backend.write(STAND)
            tilts.append(backend.tilt)
        return float(np.ptp(tilts, axis=0).max())

    assert sway("random") > 5.0 * sway("still")


def test_payload_adds_its_part_of_the_mass_to_the_trunk() -> None:
    plain, loaded = MujocoBackend(RES), MujocoBackend(RES, World(payload=0.2))
    more = {n: m - plain.masses[n] for n, m in loaded.masses.items()}
    assert more.pop("trunk") == pytest.approx(0.2 * RES.reduced.mass)
    assert set(more.values()) == {0.0}


def test_pushes_and_punches_are_read_from_text() -> None:
    (push,) = parse_pushes("5@90@2@left_foot")
    assert push == Push(5.0, 90.0, 2.0, body="left_foot")
    assert parse_punches("20") == Punches(20.0, 5.0)
    assert parse_punches("20@2.5") == Punches(20.0, 2.5)
    with pytest.raises(CommandError, match=r"--punches '20@x': expected impulse"):
        parse_punches("20@x")
    with pytest.raises(CommandError, match=r"--punches '-3': most_ns is -3"):
        parse_punches("-3")


def test_arms_do_what_is_declared() -> None:
    with pytest.raises(CommandError, match="arms is 'up', must be still or random"):
        World(arms="up")
