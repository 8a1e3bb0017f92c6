"""Way points: geometry, the controller on a robot that obeys, and walks in physics."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ideal_steps import walk_way

from gaitchain.analysis.simulated_walk import run_waypoints
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.cli.libraries import read_library
from gaitchain.cli.waypoints import show_visits, visit_json
from gaitchain.errors import CommandError
from gaitchain.gait.command_range import CommandRange
from gaitchain.messages import Command
from gaitchain.sim.world import World
from gaitchain.walker.place import Place
from gaitchain.walker.walker import Walker
from gaitchain.walker.waypoints import Near, Way, check_way, near_of, steer

MOST = CommandRange((-0.3, 0.6), (-0.1, 0.1), (-0.7, 0.7))
SLOW_S = 0.7
coordinates = st.floats(-5.0, 5.0)
angles = st.floats(-3.1, 3.1)
places = st.builds(Place, coordinates, coordinates, angles)


def matrix(place):
    """(3, 3) homogeneous transform, the oracle of the frames."""
    c, s = math.cos(place.yaw), math.sin(place.yaw)
    return np.array([[c, -s, place.x], [s, c, place.y], [0.0, 0.0, 1.0]])


@given(places, places)
def test_a_place_seen_from_another_is_a_change_of_frame(place, other):
    seen = np.linalg.inv(matrix(other)) @ matrix(place)
    np.testing.assert_allclose(matrix(place.seen_from(other)), seen, atol=1e-9)


@given(places, coordinates, coordinates)
def test_moving_is_along_the_own_heading(place, ahead, left):
    expected = matrix(place) @ [ahead, left, 1.0]
    moved = place.moved(ahead, left)
    np.testing.assert_allclose(moved[:2], expected[:2], atol=1e-9)
    assert moved.yaw == place.yaw


@given(places)
def test_a_command_is_one_that_the_library_walks(off):
    command = steer(off, MOST, SLOW_S)
    assert MOST.share(command) <= 1.0 + 1e-9


@given(places)
def test_an_obedient_robot_arrives_about_as_soon_as_it_can(off):
    """It does what it is told, step by step; the way straight there is the longest."""
    robot, near = Place(), Near(0.02, 0.02)
    longest = MOST.share(type(steer(off, MOST, SLOW_S))(*off)) + 8.0 * SLOW_S
    period_s, time_s = 0.05, 0.0
    while not near.holds(off.seen_from(robot)):
        command = steer(off.seen_from(robot), MOST, SLOW_S)
        vx, vy, rate = command.motion
        turned = robot._replace(yaw=robot.yaw + 0.5 * rate * period_s)
        moved = turned.moved(vx * period_s, vy * period_s)
        robot = moved._replace(yaw=robot.yaw + rate * period_s)
        time_s += period_s
        assert time_s < 1.5 * longest
    # To turn on the way may be sooner than either plan; to slow down takes longer.
    about_s = Way(off, MOST, SLOW_S, near).time_from(Place())
    assert 0.5 * about_s - 2.0 * SLOW_S < time_s < 2.0 * about_s + 8.0 * SLOW_S


def test_the_time_of_a_way_is_that_of_its_sooner_plan():
    def time_s(*off):
        return Way(Place(*off), MOST, SLOW_S, Near(0.02, 0.02)).time_from(Place())

    assert time_s(6.0, 0.0, 0.0) == pytest.approx(6.0 / 0.6)
    assert time_s(0.0, 0.05, 0.35) == pytest.approx(0.5 + 0.5)
    turns_s = math.pi / 0.7
    assert time_s(0.0, 6.0, 0.0) == pytest.approx(10.0 + SLOW_S + turns_s)
    ahead = Way(Place(0.0, 1.0), CommandRange((0.0, 0.6)), SLOW_S, Near(0.02, 0.02))
    assert ahead.time_from(Place()) == math.inf


BACK_AND_AHEAD = CommandRange((-0.3, 0.6))


@pytest.mark.parametrize(
    ("most", "goal", "says"),
    [
        (BACK_AND_AHEAD, Place(1.0, 0.5), "leads to the left, .* it walks back, ahead"),
        (BACK_AND_AHEAD, Place(1.0, 0.0, -1.0), "leads around to the right"),
        (CommandRange((0.0, 0.5)), Place(-1.0), "leads back, .* it walks ahead"),
        (
            CommandRange((-0.3, 0.0), (-0.1, 0.1)),
            Place(1.0, 0.5, 1.0),
            "leads ahead and around",
        ),
        (CommandRange((0.0, 0.0)), Place(1.0), "leads ahead, .* it walks nowhere"),
    ],
)
def test_a_place_that_the_range_has_no_way_to_is_refused(most, goal, says):
    near = Near(0.02, 0.02)
    assert Way(goal, most, SLOW_S, near).time_from(Place()) == math.inf
    with pytest.raises(CommandError, match=says) as refused:
        check_way(Place(), goal, most, near, "place 7")
    assert str(refused.value).startswith(f"place 7 {tuple(goal)}: ")


@pytest.mark.parametrize(
    ("most", "goal"),
    [
        (BACK_AND_AHEAD, Place(1.0, 0.019, -0.019)),
        (CommandRange((0.0, 0.5), (0.0, 0.0), (-1.0, 1.0)), Place(-1.0, 0.5, 3.0)),
        (CommandRange((0.0, 0.0)), Place(0.01, -0.01, 0.01)),
        (MOST, Place(-5.0, 3.0, -3.0)),
    ],
)
def test_what_is_near_enough_needs_no_way(most, goal):
    near = Near(0.02, 0.02)
    check_way(Place(), goal, most, near)
    way = Way(goal, most, SLOW_S, near)
    assert math.isfinite(way.time_from(Place()))
    command = way.command(Place(), stepping=False)
    assert way.ends_at(Place()) or not command.stops


def test_the_walker_refuses_a_place_that_it_would_never_reach(brisk):
    ahead = replace(brisk)
    vars(ahead)["command_range"] = BACK_AND_AHEAD
    walker = Walker(ahead)
    with pytest.raises(CommandError, match=r"goal \(1.0, 0.5, 0.0\): the way .* left"):
        walker.go_to(Place(1.0, 0.5))
    assert walker.goal is None
    walker.go_to(Place(1.0))
    assert walker.goal == Place(1.0)


def test_a_reset_on_the_way_stands(brisk):
    """It walked on, with the way's last command and without a goal."""
    walker, backend = Walker(brisk), MujocoBackend(brisk.robot)
    backend.connect(walker.stand)
    walker.go_to(Place(1.0), crouch=0.005)
    walker.step(backend.read())
    assert not walker.commanded.stops
    walker.reset()
    assert walker.goal is None
    assert walker.commanded == Command(crouch=0.005)
    for _ in range(150):
        backend.write(walker.step(backend.read()).position)
    assert walker.standing
    assert walker.gait.steps == 0
    walker.command(Command(0.2))
    walker.reset()
    assert walker.commanded == Command(0.2)


def test_a_far_place_is_faced_and_a_near_one_is_stepped_to():
    beside = steer(Place(0.0, 3.0, 0.0), MOST, SLOW_S)
    assert beside.vy == 0.0
    assert beside.yaw_rate > 0.0
    near = steer(Place(0.0, 0.05, 0.0), MOST, SLOW_S)
    assert near.vy > 0.0
    assert near.yaw_rate == 0.0
    behind = steer(Place(-0.3, 0.0, 0.0), MOST, SLOW_S)
    assert behind.vx < 0.0


def test_where_it_would_stand_is_where_it_stands_when_told(brisk):
    walker, backend = Walker(brisk), MujocoBackend(brisk.robot)
    walker.command(Command(0.3, 0.0, 0.3))
    for _ in range(400):
        backend.write(walker.step(backend.read()).position)
    expected = walker.stop_place
    assert walker.place.seen_from(expected).x < -0.02  # it is a step on
    walker.command(Command())
    while not walker.standing:
        backend.write(walker.step(backend.read()).position)
    assert walker.stop_place == walker.place
    missed = walker.place.seen_from(expected)
    assert math.hypot(missed.x, missed.y) < 0.015
    assert abs(missed.yaw) < math.radians(4.0)


@pytest.mark.parametrize("goal", [Place(0.5), Place(-0.5), Place(0.0, 0.4)])
def test_it_goes_less_than_half_a_step_beyond_its_goal(brisk, goal):
    """The middle of the feet moves by half of what one foot steps."""
    walker, backend = Walker(brisk), MujocoBackend(brisk.robot)
    walker.go_to(goal)
    far, ticks = 0.0, 0
    start = backend.foot_positions().mean(axis=0)
    while not walker.arrived and ticks < 3000:
        backend.write(walker.step(backend.read()).position)
        x, y, _ = backend.foot_positions().mean(axis=0) - start
        along = (x * goal.x + y * goal.y) / math.hypot(goal.x, goal.y)
        far, ticks = max(far, along - math.hypot(goal.x, goal.y)), ticks + 1
    assert walker.arrived
    axis = int(goal.y != 0.0)
    assert far < 0.5 * np.abs(brisk.poses.strides[:, axis]).max()
    assert walker.gait.steps < 25


def obey(way, robot, slips, stops=3):
    """Walk a point robot that slips when it stops; return where it stands at last."""
    for _ in range(stops):
        for _ in range(200):
            command = way.command(robot, stepping=True)
            if command.stops:
                break
            vx, vy, rate = command.motion
            moved = robot.moved(vx * 0.35, vy * 0.35)
            robot = moved._replace(yaw=robot.yaw + rate * 0.35)
        else:
            raise AssertionError("it never stops")
        robot = robot.moved(*slips)
        if way.command(robot, stepping=False).stops:
            break
    return robot


@given(places)
def test_what_its_stops_usually_miss_is_learned(goal):
    way = Way(goal, MOST, SLOW_S, Near(0.02, 0.035))
    assert way.ends_at(obey(way, Place(), (-0.03, 0.01), stops=3))
    blind = Way(goal, MOST, SLOW_S, Near(0.02, 0.035))
    assert not blind.ends_at(obey(blind, Place(), (-0.03, 0.01), stops=1))


@given(st.floats(-1.0, 1.0), st.floats(-0.019, 0.019))
def test_it_stops_where_the_rest_cannot_be_made_up(x, y):
    way = Way(Place(x, y), BACK_AND_AHEAD, SLOW_S, Near(0.03, 0.035))
    robot = obey(way, Place(), (0.0, 0.0))
    assert abs(robot.x - x) < 0.03


STRIDES = read_library("res").poses.strides
LACKS = {
    "nothing": np.zeros(len(STRIDES), dtype=bool),
    "steps aside": STRIDES[:, 1] > 0.0,
    "steps back": STRIDES[:, 0] < 0.0,
    "both": (STRIDES[:, 1] > 0.0) | (STRIDES[:, 0] < 0.0),
    "turns": STRIDES[:, 2] != 0.0,
}


def lacking(what):
    """RES's library, of which no step with such strides has passed."""
    library = read_library("res")
    kept = np.outer(~LACKS[what], ~LACKS[what])
    runs, passes = (kept * n for n in (library.pair_runs, library.pair_passes))
    return replace(library, pair_runs=runs, pair_passes=passes)


@pytest.mark.parametrize("what", LACKS)
def test_it_arrives_by_steps_whichever_direction_its_library_lacks(what):
    """Where it has to turn for the last centimetres it turned on the spot for ever."""
    library, rng = lacking(what), np.random.default_rng(3)
    near = near_of(library)
    leg = library.robot.reduced.leg_length
    wide = what not in ("nothing", "turns")
    assert near.distance == pytest.approx((0.06 if wide else 0.02) * leg)
    for seed in range(12):
        goal = Place(*rng.uniform(-1.5, 1.5, 2), rng.uniform(-3.1, 3.1))
        if what == "turns":
            goal = goal._replace(yaw=0.0)
        check_way(Place(), goal, library.command_range, near)
        stands = walk_way(library, Way.of(library, goal), 200, 0.003, seed)
        assert stands is not None, f"it never stops at {goal}"
        assert near.holds(goal.seen_from(stands))


@pytest.mark.parametrize(
    ("most", "place", "goal"),
    [
        (
            CommandRange((-0.1, 0.4), (-0.1, 0.1)),
            Place(1.0, 0.0, math.radians(-2.1)),
            Place(2.0),
        ),
        (
            CommandRange((0.0, 0.4), (0.0, 0.0), (0.0, 1.0)),
            Place(1.0, 0.05, 0.1),
            Place(2.0),
        ),
    ],
)
def test_who_lost_its_way_by_a_slip_goes_as_near_as_it_can(most, place, goal):
    """It stood where it was, metres short."""
    way = Way(goal, most, SLOW_S, Near(0.02, math.radians(2.0)))
    assert way.command(place, stepping=True).vx > 0.3
    stands = obey(way, place, (0.0, 0.0))
    assert abs(goal.seen_from(stands).x) < 0.02
    assert not way.ends_at(stands)


def test_a_real_walk_ends_where_it_was_to(brisk):
    goals = (Place(0.3, 0.1, math.radians(20.0)), Place(0.1, -0.1, 0.0))
    walker = Walker(brisk)
    backend = MujocoBackend(brisk.robot, World(model_error=0.1, seed=5))
    record, visits = run_waypoints(walker, backend, goals)
    assert record.fell_at_s is None
    near = near_of(brisk)
    for visit, goal in zip(visits, goals, strict=True):
        assert visit.goal == goal
        assert visit.arrived
        assert near.holds(goal.seen_from(visit.place))
        # The simulator knows where it really is: the legs measured it to centimetres.
        assert math.hypot(visit.off.x, visit.off.y) < near.distance + 0.04
        assert abs(visit.off.yaw) < near.turn + math.radians(3.0)
    times = [visit.time_s for visit in visits]
    assert times == sorted(times)


def test_a_place_that_is_not_reached_in_time_is_said(brisk, capsys):
    backend = MujocoBackend(brisk.robot)
    _, (visit,) = run_waypoints(
        Walker(brisk), backend, (Place(5.0, 0.0, 0.0),), seconds=2.0
    )
    assert not visit.arrived
    assert visit.off.x > 4.0
    assert visit_json(visit)["given_up_s"] == 2.0
    show_visits(brisk, (visit.goal,), [visit])
    assert "no, given up after 2 s" in capsys.readouterr().out


@pytest.mark.slow
def test_a_far_place_gets_the_time_that_the_way_takes():
    library, goal = read_library("res"), Place(40.0, 0.0, 0.0)
    walker, backend = Walker(library), MujocoBackend(library.robot)
    _, (visit,) = run_waypoints(walker, backend, (goal,))
    assert visit.time_s > goal.x / library.speed_range[1] > 60.0
    assert visit.arrived
    assert visit.given_up_s is None


def test_key_poses_do_not_measure_where_they_are(library):
    walker = Walker(library)
    assert walker.place is None
    with pytest.raises(CommandError, match="way points need a library of strides"):
        run_waypoints(walker, MujocoBackend(library.robot), (Place(),))
