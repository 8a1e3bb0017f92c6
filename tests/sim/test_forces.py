"""Pushes on any body, punches, arms and payload; oracles are MuJoCo and statics."""

from itertools import islice

import mujoco
import numpy as np
import pytest
from other_robots import with_legs

from gaitchain.backends.base import Disturbances, PunchesState
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.cli.world_options import parse_punches, parse_pushes
from gaitchain.discover.loaded_robot import load_robot
from gaitchain.errors import CommandError
from gaitchain.messages import CONTROL_PERIOD_S, GRAVITY
from gaitchain.robot.box_robot import box_legs
from gaitchain.robot.robot import Robot
from gaitchain.sim.arm_motion import ArmMotion
from gaitchain.sim.bodies import body_names
from gaitchain.sim.push import Punches, Push
from gaitchain.sim.push_force import Pushes, draw_punches
from gaitchain.sim.world import DISTURBANCES, World
from gaitchain.sim.world_draws import PUNCHES_STREAM, stream_of

RES = load_robot("res")
STAND = np.zeros(12)


def _punches_stream(seed: int) -> np.random.Generator:
    return stream_of(World(seed=seed), PUNCHES_STREAM)


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


def _contacts(backend: MujocoBackend) -> tuple[np.ndarray, np.ndarray]:
    """Load of each foot (2,) [N], and centre of pressure of both (2,) [m]."""
    model, data, wrench = backend.model, backend.data, np.zeros(6)
    loads, moment = np.zeros(2), np.zeros(2)
    for i, contact in enumerate(data.contact):
        mujoco.mj_contactForce(model, data, i, wrench)
        bodies = model.geom_bodyid[contact.geom]
        loads += wrench[0] * np.isin(backend.feet, bodies)
        moment += wrench[0] * contact.pos[:2]
    return loads, moment / loads.sum()


@pytest.mark.parametrize("elevation_deg", [0.0, 90.0])
def test_a_push_on_a_foot_is_no_force_of_the_ground(elevation_deg: float) -> None:
    """Sole loads and ZMP are those of MuJoCo's contacts."""
    backend = _standing(world=World(foot_sensors=True))
    _stand_on(backend, 0.5)
    backend.push(6.0, 30.0, elevation_deg, "left_foot")
    for _ in range(12):  # the push, and two periods after it
        backend.write(STAND)
        loads, centre = _contacts(backend)
        np.testing.assert_allclose(backend.read().foot_load, loads, atol=1e-6)
        np.testing.assert_allclose(backend.zmp(), centre, atol=1e-3)
        wrench = np.reshape(backend.truth().wrench, (2, 6))
        np.testing.assert_allclose(wrench[:, 5], loads, atol=1e-6)
    assert not backend.data.xfrc_applied.any()


def test_an_unknown_body_is_refused_with_those_that_there_are() -> None:
    with pytest.raises(CommandError, match=r"body 'arm': the robot has trunk, left_"):
        MujocoBackend(RES, World(push=(Push(1.0, 0.0, 0.0, body="arm"),)))


def test_punches_follow_from_the_seed_and_hit_heavy_bodies_more_often() -> None:
    masses = MujocoBackend(RES).masses
    punches = Punches(20.0, every_s=2.0)
    drawn, again = (
        list(islice(draw_punches(stream, punches, masses), count))
        for stream, count in ((_punches_stream(4), 4000), (_punches_stream(4), 10))
    )
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
    arms = ArmMotion(RES, World(seed=1, arms="random"))
    upright, com = np.eye(3), np.array([0.0, 0.0, 0.1])
    np.testing.assert_array_equal(arms.wrench(0.0, upright, com), np.zeros(6))
    # Arms that rest in an aim for a moment: their acceleration is 0 there.
    wrench = arms.wrench(0.8, upright, com)
    places = arms._places(0.8) - arms._places(0.0)
    weight = 0.05 * RES.reduced.mass * GRAVITY
    expected = [-weight * places[:, 1].sum(), weight * places[:, 0].sum(), 0.0]
    np.testing.assert_allclose(wrench[3:], expected, atol=0.02 * weight)
    np.testing.assert_allclose(wrench[:3], 0.0, atol=0.02 * weight)


def test_raised_arms_weigh_downhill_on_a_slope() -> None:
    """Axes are those of the floor, to which gravity is not square."""
    flat, steep = (
        ArmMotion(RES, World(seed=1, arms="random", slope_deg=slope))
        for slope in (0.0, 10.0)
    )
    found = [arms.wrench(0.8, np.eye(3), np.zeros(3)) for arms in (flat, steep)]
    places = (flat._places(0.8) - flat._places(0.0)).sum(axis=0)
    turned = np.array([0.0, 0.0, 1.0]) - World(slope_deg=10.0).up
    more = 0.05 * RES.reduced.mass * GRAVITY * np.cross(places, turned)
    np.testing.assert_allclose(found[1][3:] - found[0][3:], more, atol=1e-9)
    np.testing.assert_array_equal(found[1][:3], found[0][:3])


@pytest.mark.parametrize("body", ["trunk", "upper"])
def test_two_pushes_at_once_are_both_taken_away(body) -> None:
    """The upper part of a trunk is pushed as a part of the trunk, too."""
    pushes = Push(3.0, 0.0, 0.0, 0.02), Push(3.0, 90.0, 0.0, 0.02, body=body)
    backend = MujocoBackend(RES, World(push=pushes, waist=2000.0))
    backend.connect(STAND)
    for _ in range(2):
        backend.write(STAND)
        assert backend.data.xfrc_applied.any() or backend.data.time > 0.02
    backend.write(STAND)
    np.testing.assert_allclose(backend.data.xfrc_applied, 0.0, atol=1e-9)


def test_the_forces_of_moving_arms_add_up_to_what_their_momentum_changed_by() -> None:
    """From rest to rest the impulse is 0: F = -m r'' leaves no momentum."""
    arms = ArmMotion(RES, World(seed=2, arms="random"))
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


def _standing(robot: Robot = RES, world: World | None = None) -> MujocoBackend:
    backend = MujocoBackend(robot, world)
    backend.connect(robot.legs.stand)
    return backend


def _stand_on(backend: MujocoBackend, seconds: float) -> None:
    for _ in range(round(seconds / CONTROL_PERIOD_S)):
        backend.write(backend.data.ctrl.copy())


@pytest.mark.parametrize("boxes", [True, False])
def test_bodies_are_known_without_the_simulator(boxes: bool) -> None:
    robot = RES if boxes else with_legs(RES, box_legs(RES.reduced))
    assert body_names(robot) == tuple(MujocoBackend(robot).masses)


def test_a_payload_taken_up_while_standing_is_as_one_from_the_start() -> None:
    backend = _standing()
    built = MujocoBackend(RES, World(payload=0.2)).model
    backend.disturb(Disturbances(None, "still", 0.2))
    for name in ("body_mass", "body_subtreemass", "body_invweight0", "dof_invweight0"):
        np.testing.assert_allclose(getattr(backend.model, name), getattr(built, name))
    _stand_on(backend, 1.0)
    weight = 1.2 * RES.reduced.mass * GRAVITY
    assert backend.foot_loads().sum() == pytest.approx(weight, rel=0.02)
    backend.connect(RES.legs.stand)  # a reset of the robot leaves its load on it
    assert backend.disturbances == Disturbances(None, "still", 0.2)
    backend.disturb(Disturbances(None, "still", 0.0))
    assert backend.masses == pytest.approx(MujocoBackend(RES).masses)


def test_a_payload_beyond_its_limits_is_refused_and_changes_nothing() -> None:
    backend = _standing()
    with pytest.raises(CommandError, match=r"payload is 11\.0, must be 0 to 10"):
        backend.disturb(Disturbances(None, "random", 11.0))
    assert backend.disturbances == Disturbances(None, "still", 0.0)
    assert backend.masses == MujocoBackend(RES).masses


def test_punches_begin_when_they_are_asked_for_and_end_so() -> None:
    backend = _standing()
    _stand_on(backend, 0.5)
    backend.disturb(Disturbances(PunchesState(0.4, 0.2), "still", 0.0))
    _stand_on(backend, 0.1)
    assert not backend.take_punches()
    for due_s in (0.7, 0.9, 1.1):
        _stand_on(backend, 0.2)
        (punch,) = backend.take_punches()
        assert punch.at_s == pytest.approx(due_s)
        assert not backend.take_punches(), "each is told once"
    backend.disturb(Disturbances(PunchesState(0.4, 0.2), "still", 0.1))
    _stand_on(backend, 0.2)
    assert len(backend.take_punches()) == 1, "a payload does not begin them anew"
    backend.disturb(Disturbances(None, "still", 0.1))
    _stand_on(backend, 0.5)
    assert not backend.take_punches()


def test_punches_keep_their_own_duration_where_something_else_changes() -> None:
    backend = MujocoBackend(RES, World(punches=Punches(5.0, 2.0, 0.3)))
    backend.connect(np.array(RES.legs.stand))
    now = backend.disturbances
    backend.disturb(Disturbances(now.punches, now.arms, 0.1))
    assert backend.world.punches == Punches(5.0, 2.0, 0.3)
    assert backend.world.payload == 0.1


def test_punches_that_last_longer_than_their_interval_are_refused() -> None:
    """What was left of each was lost."""
    with pytest.raises(CommandError, match=r"duration_s is 1\.5, must be at most ever"):
        Punches(5.0, 1.0, 1.5)


def test_a_robot_is_pushed_and_punched_after_any_time() -> None:
    backend = _standing()
    backend.model.opt.gravity[:] = 0.0
    backend.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    backend.data.time = late_s = 1.2e6  # two weeks
    backend.push(1.0, 0.0)
    _stand_on(backend, 0.12)
    assert _momentum(backend)[0] == pytest.approx(1.0, rel=0.01)
    backend.disturb(Disturbances(PunchesState(0.4, 0.2), "still", 0.0))
    _stand_on(backend, 0.3)
    (punch,) = backend.take_punches()
    assert punch.at_s == pytest.approx(late_s + 0.32, abs=1e-3)


def test_punches_that_are_switched_on_again_are_others_until_a_reset() -> None:
    backend = _standing()

    def first() -> Push:
        backend.disturb(Disturbances(PunchesState(0.4, 0.1), "still", 0.0))
        _stand_on(backend, 0.11)
        backend.disturb(Disturbances(None, "still", 0.0))
        return backend.take_punches()[0]

    one, other = first(), first()
    assert one.impulse_ns != other.impulse_ns
    backend.connect(RES.legs.stand)
    assert first() == one


def test_arms_swing_when_they_are_asked_to_and_come_to_rest() -> None:
    def wrench(seconds: float) -> float:
        norms = []
        for _ in range(round(seconds / CONTROL_PERIOD_S)):
            _stand_on(backend, CONTROL_PERIOD_S)
            norms.append(np.linalg.norm(backend.data.xfrc_applied[1]))
        return float(max(norms))

    backend = _standing()
    assert wrench(1.0) == 0.0
    backend.disturb(Disturbances(None, "random", 0.0))
    assert wrench(0.02) < 0.5, "they begin at rest"
    assert wrench(2.0) > 1.0
    backend.disturb(Disturbances(None, "still", 0.0))
    assert wrench(2.4) > 1.0, "on their way back they are borne as well"
    assert wrench(1.0) == 0.0
    backend.disturb(Disturbances(None, "random", 0.0))
    assert wrench(2.0) > 1.0


def test_a_push_on_any_body_hits_one_and_says_which() -> None:
    backend = _standing()
    pushes = [backend.push(0.1, 0.0, body="any") for _ in range(40)]
    hit = {push.body for push in pushes}
    assert "any" not in hit
    assert hit <= set(backend.masses)
    assert len(hit) > 1
    up = backend.push(3.0, 90.0, 20.0, "left_foot")
    assert str(up) == "a push of 3 N s to 90 deg, 20 deg up on left_foot"
    with pytest.raises(CommandError, match="body 'arm': the robot has trunk, left_"):
        backend.push(1.0, 0.0, body="arm")
    with pytest.raises(
        CommandError, match=r"elevation_deg is 91\.0, must be -90 to 90"
    ):
        backend.push(1.0, 0.0, 91.0)


def test_what_a_disturbance_is_can_be_told() -> None:
    told = [
        DISTURBANCES[name].tell(value)
        for name, value in [
            ("payload", 0.2),
            ("arms", "random"),
            ("punches", Punches(20.0, 5.0)),
            ("punches", None),
        ]
    ]
    assert told == [
        "payload 20 %",
        "arms random",
        "punches of up to 20 N s every 5 s",
        "no punches",
    ]


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
