"""The live loop sent to places and by footsteps, and all that ends it."""

import math

import pytest
from live_robot import FaultyRobot, Live, library

from gaitchain.gait.command_range import CommandRange
from gaitchain.live.messages import (
    Drive,
    EmergencyStop,
    FollowSteps,
    GoTo,
    LetGo,
    Mode,
    Rest,
    Start,
    Stop,
    decode_request,
    encode,
)
from gaitchain.live.trip import MOST_PLACES
from gaitchain.walker.footsteps import Footstep
from gaitchain.walker.place import Place

GOAL = Place(0.25, 0.1, math.radians(25.0))
HALF = 0.5 * library().poses.stance


def steps(*ahead):
    """Footsteps so far ahead, the left foot first."""
    feet = [(k % 2 == 0, x) for k, x in enumerate(ahead)]
    return tuple(Footstep(left, x, HALF if left else -HALF) for left, x in feet)


@pytest.fixture
def live():
    return Live().run(3.0)


def run(live, seconds, errand):
    """Tick on; the driver repeats the errand twice a second."""
    for _ in range(round(2.0 * seconds)):
        live.ask(errand)
        live.run(0.5)
    return live


def until(live, happens, errand, limit_s=20.0):
    """Tick on until something is so."""
    for _ in range(round(2.0 * limit_s)):
        if happens():
            return
        run(live, 0.5, errand)
    raise AssertionError(f"not within {limit_s} s: {live.last.going}")


def test_it_goes_to_a_place_and_says_how_far_it_is(live):
    errand = GoTo("me", (GOAL,))
    run(live, 1.0, errand)
    going = live.last.going
    assert live.mode is Mode.WALKING
    assert (going.goal, going.places_left, going.arrived) == (GOAL, 1, False)
    assert 0.0 < going.distance_m < math.hypot(GOAL.x, GOAL.y) + 0.02
    assert live.last.command != (0.0, 0.0, 0.0)
    until(live, lambda: live.last.going.arrived, errand)
    assert live.mode is Mode.STANDING
    assert live.last.going.distance_m < 0.03
    assert abs(live.last.going.turn_rad) < math.radians(2.1)
    x, y = live.robot.data.qpos[:2]
    assert math.hypot(x - GOAL.x, y - GOAL.y) < 0.05


def test_how_low_a_driver_wants_it_to_go_there_is_told(live):
    """That was the crouch of the command before, with which nobody goes there."""
    depth = 0.8 * library().command_range.crouch[0]
    run(live, 0.5, GoTo("me", (GOAL,), depth))
    assert live.last.crouch_asked == depth
    assert live.last.crouch == pytest.approx(depth)
    run(live, 0.5, GoTo("me", (GOAL,)))
    assert live.last.crouch_asked == 0.0
    live.ask(Drive("me", crouch=0.5 * depth))
    live.run(0.1)
    assert live.last.crouch_asked == 0.5 * depth


@pytest.mark.parametrize("end", [0.6, 0.9])
def test_places_on_the_way_are_passed_without_a_stand(live, end):
    way = Place(0.3, 0.0), Place(end, 0.0)
    errand, modes = GoTo("me", way), []
    run(live, 1.0, errand)
    assert live.last.going.places_left == 2
    assert live.last.going.goal == way[-1]
    until(live, lambda: modes.append(live.mode) or live.last.going.arrived, errand)
    assert live.last.going.places_left == 1
    walked = modes[modes.index(Mode.WALKING) :]
    assert Mode.STANDING not in walked[:-1]
    assert live.robot.data.qpos[0] == pytest.approx(end, abs=0.05)


def test_it_makes_footsteps(live):
    errand = FollowSteps("me", steps(0.1, 0.2, 0.2))
    run(live, 0.5, errand)
    assert 0 < live.last.going.footsteps_left <= 3
    assert live.last.going.goal is None
    until(live, lambda: live.last.going.arrived, errand)
    assert live.robot.data.qpos[0] == pytest.approx(0.2, abs=0.04)
    assert [foot.x for foot in live.last.feet] == pytest.approx([0.2] * 2, abs=0.04)


def test_a_step_that_cannot_be_made_is_refused_by_its_number(live):
    run(live, 1.0, FollowSteps("me", steps(0.1, 0.9)))
    assert live.mode is Mode.STANDING
    assert live.last.going is None
    (said,) = live.happened("command")
    assert said.startswith("follow steps by me refused: footstep 2, the right foot")


@pytest.mark.parametrize(
    "end",
    [
        Drive("me", 0.0, 0.0, 0.0),
        Drive("me", 0.2, 0.0, 0.0),
        Stop("another"),
        EmergencyStop("another"),
    ],
    ids=["zero", "command", "stop", "emergency"],
)
def test_a_command_or_a_stop_ends_it(live, end):
    run(live, 1.0, GoTo("me", (GOAL,)))
    live.ask(end)
    live.run(0.1)
    assert live.last.going is None
    assert live.loop.modes.lease.errand is None


def test_what_a_stop_has_ended_is_not_begun_again_by_who_repeats_it(live):
    errand = GoTo("me", (GOAL,))
    run(live, 1.0, errand)
    live.ask(Stop("another"))
    run(live, 4.0, errand)
    assert live.mode is Mode.STANDING
    assert live.last.going is None
    refused = "go to by me refused: a stop is in force; send a zero command first"
    assert refused in live.happened("command")
    assert live.last.driver == ""  # who is refused does not keep the wheel
    live.ask(Drive("me"))
    run(live, 1.0, errand)
    assert live.last.going is not None


def test_a_planner_that_plans_anew_does_not_undo_a_stop(live):
    """Each of its ways is another one, by some millimetres."""
    ways = [GoTo("ros", (GOAL._replace(x=0.25 + 0.001 * k),)) for k in range(8)]
    run(live, 1.0, ways[0])
    live.ask(Stop("another"))
    for way in ways[1:4]:
        run(live, 1.0, way)
    live.ask(LetGo("ros"))
    for way in ways[4:]:
        run(live, 1.0, way)
    assert live.mode is Mode.STANDING
    assert live.last.going is None
    run(live, 1.0, GoTo("another", (GOAL,)))  # who was not stopped goes where it likes
    assert live.last.going is not None


def test_a_robot_that_rested_does_not_set_out_again_by_itself():
    live = Live(backend=FaultyRobot(physical=True))
    live.run(0.1).ask(Start("me"))
    live.run(3.5)
    errand = GoTo("me", (Place(0.2, 0.0),))
    until(live, lambda: live.last.going and live.last.going.arrived, errand)
    live.ask(Rest("me"))
    live.run(0.02)
    assert live.mode is Mode.OFF
    assert live.last.going is None
    live.ask(Start("me"))  # at once: its legs are where they were
    modes = [live.run(0.02).mode for _ in range(200)]
    assert Mode.STANDING in modes
    assert Mode.WALKING not in modes


def test_a_lost_driver_ends_it(live):
    run(live, 1.0, GoTo("me", (GOAL._replace(x=3.0),)))
    live.run(2.4)
    assert live.last.going is not None
    live.run(0.7)
    assert live.last.going is None
    assert "nothing of me for 3 s" in live.happened("command")[-1]
    live.run(2.0)
    assert live.mode is Mode.STANDING


LOW = library().command_range.crouch[0]


@pytest.mark.parametrize("end", [(), (Stop("another"),)], ids=["silence", "stop"])
def test_a_robot_that_went_low_stays_low_after_its_way(live, end):
    """Nobody knows what is above it."""
    run(live, 1.0, GoTo("me", (Place(3.0),), LOW))
    live.ask(*end)
    live.run(6.0)
    assert live.last.going is None
    assert live.mode is Mode.STANDING
    assert live.last.crouch == pytest.approx(LOW)


def test_footsteps_leave_a_low_robot_low(live):
    live.ask(Drive("me", crouch=LOW))
    live.run(0.4)
    errand = FollowSteps("me", steps(0.1, 0.1))
    run(live, 0.5, errand)
    assert live.mode is Mode.WALKING
    assert live.last.crouch == pytest.approx(LOW)
    until(live, lambda: live.last.going.arrived, errand)
    live.run(5.0)  # the driver is silent
    assert live.last.crouch == pytest.approx(LOW)
    assert live.mode is Mode.STANDING


def test_it_is_for_the_driver_of_a_robot_that_stands_or_walks(live):
    live.ask(Drive("another"), GoTo("me", (GOAL,)))
    live.run(0.1)
    assert live.happened("command") == ["go to by me refused: another drives"]
    off = Live()
    off.ask(GoTo("me", (GOAL,)))
    off.run(0.1)
    assert "not standing or walking" in off.happened("command")[-1]


@pytest.mark.parametrize("places", [(), (Place(math.nan),), (Place(1e9),)])
def test_no_place_is_refused(live, places):
    run(live, 0.5, GoTo("me", places))
    assert live.last.going is None
    assert "go to by me refused: " in live.happened("command")[-1]


def test_a_place_that_is_too_far_is_refused_before_the_way_to_it(live):
    """Refused on the way, the robot would hold still on one leg."""
    way = Place(0.3), Place(0.6), Place(2000.0)
    run(live, 4.0, GoTo("me", way))
    assert live.mode is Mode.STANDING
    assert live.last.going is None
    (said,) = live.happened("command")
    assert said.startswith("go to by me refused: place 3 (2000.0, 0.0, 0.0): ")
    assert "within +-1000 m" in said


def only_back_and_ahead(live):
    """A library that neither turns nor steps aside."""
    library = live.loop.modes._walker.library
    known = vars(library)["command_range"]  # which was looked at already
    vars(library)["command_range"] = CommandRange(known.vx)
    return lambda: vars(library).update(command_range=known)


def test_a_place_without_a_way_is_refused_by_its_number(live, request):
    request.addfinalizer(only_back_and_ahead(live))
    run(live, 1.0, GoTo("me", (Place(0.3), Place(0.6, 0.0, 2.0), Place(0.6, 0.5))))
    assert live.mode is Mode.STANDING
    (said,) = live.happened("command")
    assert said.startswith("go to by me refused: place 3 (0.6, 0.5, 0.0): the way ")
    errand = GoTo("me", (Place(0.3, 0.0, 2.0), Place(0.6)))
    run(live, 1.0, errand)  # its heading on the way does not count
    assert live.last.going.places_left == 2


def test_a_way_that_is_lost_on_the_way_ends_without_a_fault(live, request):
    """The robot was pushed aside, say, and the library does not step aside."""
    run(live, 1.0, GoTo("me", (Place(0.5), Place(1.5))))
    assert live.mode is Mode.WALKING
    request.addfinalizer(only_back_and_ahead(live))
    feet = live.loop.modes._walker.gait._feet
    feet.update(
        {side: foot._replace(x=0.4, y=foot.y + 0.1) for side, foot in feet.items()}
    )
    live.run(2.0)
    assert live.last.going is None
    assert live.last.trouble is None
    assert live.mode in (Mode.STANDING, Mode.WALKING)
    assert "go to by me refused: goal (1.5, 0.0, 0.0)" in live.happened("command")[-1]


def test_a_way_of_very_many_places_is_refused(live):
    run(live, 0.5, GoTo("me", tuple(Place(0.06 * k) for k in range(MOST_PLACES + 1))))
    assert live.last.going is None
    (said,) = live.happened("command")
    assert said.startswith("go to by me refused: 1001 places: at most 1000 are walked ")


def test_the_rest_of_the_way_is_from_place_to_place(live):
    way = Place(0.3), Place(0.3, 0.4), Place(0.6, 0.4)
    run(live, 0.5, GoTo("me", way))
    here, going = live.last.place, live.last.going
    first = math.hypot(0.3 - here.x, here.y)
    assert going.distance_m == pytest.approx(first + 0.4 + 0.3)
    until(live, lambda: live.last.going.places_left == 2, GoTo("me", way))
    here, going = live.last.place, live.last.going
    second = math.hypot(0.3 - here.x, 0.4 - here.y)
    assert going.distance_m == pytest.approx(second + 0.3)


def test_errands_travel_as_they_are():
    for errand in (GoTo("me", (GOAL,), 0.01), FollowSteps("me", steps(0.1, 0.1))):
        assert decode_request(encode(errand)) == errand


def test_a_robot_that_rocks_on_both_feet_is_not_said_to_walk():
    live = Live(period_s=0.004).run(4.0)
    assert live.happened("mode") == ["off to rising: settling", "rising to standing"]
