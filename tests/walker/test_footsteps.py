"""Footsteps and places: carried out in physics, or refused with the number."""

import math

import numpy as np
import pytest

from gaitchain.analysis.simulated_walk import WatchedLoop
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.errors import CommandError
from gaitchain.gait.library_file import load_library
from gaitchain.messages import Command
from gaitchain.sim.world import World
from gaitchain.walker.footsteps import Footstep, landing_from
from gaitchain.walker.place import Place
from gaitchain.walker.walker import Walker
from gaitchain.walker.waypoints import Near

LIBRARY = load_library("src/gaitchain/data/res.gait")
HUGE = 10**400
HALF = 0.5 * LIBRARY.poses.stance
AHEAD = [
    Footstep(left, x, HALF if left else -HALF)
    for left, x in ((True, 0.08), (False, 0.2), (True, 0.32), (False, 0.32))
]
AROUND = [
    Footstep(
        left,
        -side * HALF * math.sin(yaw),
        side * HALF * math.cos(yaw),
        yaw,
    )
    for left, side, yaw in (
        *((True, 1.0, 0.2), (False, -1.0, 0.2)),
        *((True, 1.0, 0.4), (False, -1.0, 0.4)),
    )
]


def walking(walker, seed=3):
    world = World(model_error=0.1, seed=seed)
    return WatchedLoop(walker, MujocoBackend(LIBRARY.robot, world))


def carry_out(steps):
    """Return where the feet are before and after, (2, 2) each, and the walker."""
    walker = Walker(LIBRARY)
    loop = walking(walker)
    before = loop.backend.foot_positions()[:, :2].copy()
    walker.follow_steps(steps)
    while walker.gait.footsteps_left or not walker.standing:
        assert loop.run_until(loop.ticks + 1)
        assert loop.time_s < 20.0
    return before, loop.backend.foot_positions()[:, :2].copy(), walker


@pytest.mark.parametrize("steps", [AHEAD, AROUND], ids=["ahead", "around"])
def test_feet_land_where_they_were_to(steps):
    before, after, walker = carry_out(steps)
    wanted = [[s for s in steps if s.left][-1], [s for s in steps if not s.left][-1]]
    for foot, step in enumerate(wanted):
        made = after[foot] - before.mean(axis=0)
        np.testing.assert_allclose(made, step[1:3], atol=0.02)
    assert walker.place.yaw == pytest.approx(wanted[0].yaw, abs=0.03)
    assert walker.gait.steps == len(steps)


def test_the_other_foot_is_put_beside_the_last_one():
    before, after, walker = carry_out(AHEAD[:3])
    assert walker.gait.steps == 4
    np.testing.assert_allclose(after[:, 0] - before[:, 0], 0.32, atol=0.02)


@pytest.mark.parametrize(
    ("steps", "said"),
    [
        ([], "no footstep"),
        ([Footstep(True, 0.9, HALF)], "footstep 1, the left foot at 0.9, 0.1 m: it "),
        ([AHEAD[0], AHEAD[1]._replace(x=0.9)], "footstep 2, the right .* nearest "),
        ([AHEAD[0], AHEAD[0]], "footstep 2: the left foot again"),
        ([AHEAD[0]._replace(yaw=math.nan)], "footstep 1 .*number"),
        ([AHEAD[0]._replace(x="a")], "footstep 1 .*: x, y and yaw must be numbers"),
        ([AHEAD[0]._replace(yaw=1e9)], r"footstep 1 .* within \+-1000 m and rad"),
        ([AHEAD[0]._replace(left="x")], "footstep 1: left is 'x'; give one such as"),
        ([AHEAD[0], 1], "footstep 2: 1 is none; give one such as Footstep"),
        ("ab", "footstep 1: 'a' is none"),
        (None, "footsteps None: give a list of Footstep"),
    ],
)
def test_what_the_chain_cannot_make_is_refused(steps, said):
    walker = Walker(LIBRARY)
    with pytest.raises(CommandError, match=said):
        walker.follow_steps(steps)
    assert walker.gait.footsteps_left == 0


def test_footsteps_begin_from_a_stand_and_end_with_a_command():
    walker = Walker(LIBRARY)
    loop = walking(walker)
    walker.follow_steps(AHEAD)
    walker.command(Command())
    assert walker.gait.footsteps_left == 0
    walker.command(Command(0.2))
    loop.run_until(100)
    with pytest.raises(CommandError, match="begin from a stand"):
        walker.follow_steps(AHEAD)


def test_what_is_refused_ends_neither_way_nor_footsteps():
    walker = Walker(LIBRARY)
    walker.go_to(Place(1.0))
    with pytest.raises(CommandError, match="no command to follow"):
        walker.follow([])
    with pytest.raises(CommandError):
        walker.follow_steps([Footstep(True, 3.0, HALF)])
    assert walker.goal == Place(1.0)
    walker.follow_steps(AHEAD)
    with pytest.raises(CommandError, match="no command to follow"):
        walker.follow([])
    assert walker.footsteps_left >= len(AHEAD)


def test_key_poses_take_no_footsteps(library):
    walker = Walker(library)
    with pytest.raises(CommandError, match="library of strides"):
        walker.follow_steps(AHEAD)
    with pytest.raises(CommandError, match="go_to: key poses"):
        walker.go_to(Place(1.0))


@pytest.mark.parametrize("side", [True, False])
def test_a_landing_is_seen_from_the_other_foot(side):
    """Half a turn of the frame changes nothing of it."""
    sign = 1.0 if side else -1.0
    step = Footstep(side, 0.3, sign * 0.25, sign * 0.1)
    landing = landing_from(Place(0.1, -sign * 0.1), step, 0.2)
    np.testing.assert_allclose(landing, (0.2, 0.15, 0.1))
    back = Footstep(side, -0.3, -sign * 0.25, math.pi + sign * 0.1)
    turned = landing_from(Place(-0.1, sign * 0.1, math.pi), back, 0.2)
    np.testing.assert_allclose(turned, landing)


def test_the_robot_goes_to_a_place_and_stands_there():
    walker = Walker(LIBRARY)
    assert walker.goal is None
    assert not walker.arrived
    loop = walking(walker)
    goal = Place(0.4, 0.3, math.radians(60.0))
    walker.go_to(goal)
    assert walker.goal == goal
    start = loop.backend.foot_positions().mean(axis=0)
    while not walker.arrived:
        assert loop.run_until(loop.ticks + 1)
        assert loop.time_s < 30.0
    made = loop.backend.foot_positions().mean(axis=0) - start
    assert math.dist(made[:2], goal[:2]) < 0.03
    assert loop.backend.heading == pytest.approx(goal.yaw, abs=math.radians(3.0))
    walker.command(Command(0.1))
    assert walker.goal is None


@pytest.mark.parametrize("goal", [Place(math.nan), Place(2e3), Place(yaw=math.inf)])
def test_a_place_that_cannot_be_is_refused(goal):
    walker = Walker(LIBRARY)
    with pytest.raises(CommandError, match="must be numbers within"):
        walker.go_to(goal)


@pytest.mark.parametrize(
    "near",
    [
        (math.nan, 1),
        (-1, 1),
        (0, 0),
        (0.1, math.nan),
        ("a", 1),
        (None, None),
        (HUGE, 1),
    ],
)
def test_what_no_robot_is_near_enough_to_is_refused(near):
    walker = Walker(LIBRARY)
    with pytest.raises(CommandError, match="distance and turn must be numbers above 0"):
        walker.go_to(Place(1.0), Near(*near))
    assert walker.goal is None


def test_nearness_may_have_no_limit():
    walker = Walker(LIBRARY)
    walker.go_to(Place(1.0, yaw=1.0), Near(0.02, math.inf))
    assert walker.goal == Place(1.0, yaw=1.0)


def test_arguments_of_another_kind_are_refused_with_one_that_would_do():
    walker = Walker(LIBRARY)
    for ask, says in (
        (lambda: walker.go_to((1, 0, 0)), r"goal \(1, 0, 0\): give a Place, such as"),
        (lambda: walker.go_to(Place("a", 0, 0)), r"\('a', 0, 0\): x, y and yaw must"),
        (lambda: walker.go_to(Place(1.0), (1, 1)), r"near \(1, 1\): give Near\("),
        (lambda: walker.go_to(Place(1.0), crouch="a"), "crouch 'a': need 0 or more"),
        (lambda: walker.go_to(Place(1.0), crouch=math.nan), "crouch nan: need 0 or m"),
        (lambda: walker.go_to(Place(1.0), crouch=math.inf), "crouch inf: need 0 or m"),
        (lambda: walker.go_to(Place(1.0), crouch=HUGE), "crouch 10+: need 0 or more"),
        (lambda: walker.go_to(Place(HUGE)), r"goal \(10+: x, y and yaw must"),
        (
            lambda: walker.command(Command("a")),
            "vx is 'a', no number .*; give one such",
        ),
        (lambda: walker.command(Command(crouch=HUGE)), "crouch is 10+, no number of a"),
        (lambda: walker.follow([Command(HUGE)]), "vx is 10+, no number of a float's"),
        (lambda: walker.command((0.1, 0, 0)), r"\(0.1, 0, 0\) is no command"),
        (lambda: walker.follow([Command(), None]), "None is no command"),
        (lambda: walker.follow(5), "commands 5: give a list of Command"),
    ):
        with pytest.raises(CommandError, match=says):
            ask()
    assert walker.goal is None
    assert walker.commanded == Command()
    assert walker.command(Command(np.float32(0.1))).vx == pytest.approx(0.1)
