"""A loop that gets a robot up: OP3 in its own model, by a way that was found for it."""

import math
import os
from pathlib import Path

import numpy as np
import pytest
from live_robot import PERIOD_S, Live
from planned_library import planned_library

from gaitchain.backends.whole_body import WholeBodyBackend
from gaitchain.build.own_model import own_model, use_implicit_integrator
from gaitchain.discover.loaded_robot import load_robot
from gaitchain.errors import BackendError
from gaitchain.gait.get_up import load_get_up
from gaitchain.live.messages import (
    EmergencyStop,
    GetUp,
    Mode,
    PushRobot,
    Rest,
    Start,
    Stop,
    TroubleKind,
)
from gaitchain.sim.world import World
from gaitchain.walker.place import Place
from gaitchain.walker.riser import TRIES, Riser

SHARED = Path(__file__).parents[3] / "shared" / "robots"
FILE = Path(os.environ.get("MENAGERIE_ROOT") or SHARED) / "robotis_op3/op3.xml"
WAYS = Path(__file__).parents[1] / "support" / "op3.getup"
HARD_NS = 6.0  # a push that OP3 does not withstand
LONGEST_S = 15.0
pytestmark = pytest.mark.skipif(
    not FILE.is_file(), reason=f"no {FILE}; set MENAGERIE_ROOT"
)


@pytest.fixture(scope="module")
def op3_library():
    return planned_library(load_robot(FILE))


@pytest.fixture
def op3(op3_library):
    """A loop whose robot stands; it knows its way up."""
    model = own_model(FILE, op3_library.robot, World())
    use_implicit_integrator(model)
    live = Live(backend=WholeBodyBackend(model, op3_library), of=op3_library)
    live.loop.modes.up.riser = Riser(load_get_up(WAYS, op3_library.robot), PERIOD_S)
    return live.run(3.0)


def knock_over(live, direction_deg):
    live.ask(PushRobot("me", HARD_NS, direction_deg))
    live.run(4.0)
    assert live.mode is Mode.STOPPED
    assert live.last.trouble is TroubleKind.FALL
    assert live.last.can_get_up
    return live


@pytest.mark.slow
@pytest.mark.parametrize(
    ("direction_deg", "side"), [(0.0, "front"), (180.0, "back"), (160.0, "back")]
)
def test_it_gets_up_from_where_it_fell_and_stands(op3, direction_deg, side):
    height = op3.last.truth.qpos[2]
    knock_over(op3, direction_deg)
    assert op3.last.truth.qpos[2] < 0.6 * height
    op3.ask(GetUp("me"))
    op3.run(LONGEST_S)
    assert op3.mode is Mode.STANDING
    assert not op3.last.can_get_up
    assert op3.last.truth.qpos[2] == pytest.approx(height, rel=0.05)
    assert max(map(abs, op3.last.truth.tilt)) < 0.1
    done = op3.happened("mode")
    assert done[-3:] == [
        "stopped to getting_up: straightening, try 1 of 3",
        "getting_up to rising: up again",
        "rising to standing",
    ]
    reasons = {told.reason for told in op3.port.told}
    assert f"getting up from the {side}, try 1 of 3" in reasons


def stood_at(live):
    """Return the middle between the feet, and the heading, as the simulator has it."""
    bodies = [live.robot.data.body(f"{side}_ank_roll_link") for side in "lr"]
    x, y, _ = np.mean([body.xpos for body in bodies], axis=0)
    ahead = live.robot.data.body("body_link").xmat.reshape(3, 3)[:, 0]
    return Place(float(x), float(y), math.atan2(ahead[1], ahead[0]))


@pytest.mark.slow
def test_its_place_goes_on_from_where_it_fell(op3):
    """It falls aside, and turns by more than a right angle."""
    walker = op3.loop.modes._walker
    walker.keep_odometry()
    op3.run(3.0, drive=(0.15, 0.0, 0.0))
    began, by_itself, real = op3.last.odometry, op3.last.place, stood_at(op3)
    assert by_itself.x > 0.2
    knock_over(op3, 90.0)
    op3.ask(GetUp("me"))
    op3.run(LONGEST_S)
    while op3.mode in (Mode.GETTING_UP, Mode.RISING):  # after another try
        op3.run(1.0)
    assert op3.mode is Mode.STANDING
    told = op3.last.place.seen_from(by_itself)
    true = stood_at(op3).seen_from(real)
    assert abs(true.yaw) > 0.3
    assert told.yaw == pytest.approx(true.yaw, abs=math.radians(3.0))
    leg = walker.library.robot.reduced.leg_length
    assert math.hypot(told.x, told.y) < 0.5 * leg  # of before the fall
    assert math.dist(op3.last.odometry.place[:2], op3.last.place[:2]) < 0.5 * leg
    assert op3.last.odometry.attitude[2] == pytest.approx(op3.last.place.yaw)
    assert op3.last.odometry.distance >= began.distance
    assert op3.last.odometry.covariance[0] > began.covariance[0] + (0.4 * leg) ** 2


@pytest.mark.slow
def test_the_joints_are_told_no_jumps(op3):
    knock_over(op3, 0.0)
    op3.ask(GetUp("me"))
    told = len(op3.port.told) + 1  # the first is where the joints are
    op3.run(LONGEST_S)
    targets = np.array([t.joint_target for t in op3.port.told[told:]])
    fastest = np.abs(np.diff(targets, axis=0)).max() / PERIOD_S
    assert fastest < 1.05 * op3_speed(op3)


def op3_speed(live):
    limit = np.array(live.loop.modes._walker.library.robot.legs.speed_limit)
    return float(limit.max())


def test_an_emergency_stop_takes_the_torque_off_on_the_way(op3):
    knock_over(op3, 0.0)
    op3.ask(GetUp("me"))
    op3.run(3.0)
    assert op3.mode is Mode.GETTING_UP
    op3.ask(EmergencyStop("somebody else"))
    op3.run(2.0)
    assert op3.mode is Mode.STOPPED
    assert op3.last.trouble is TroubleKind.EMERGENCY_STOP
    assert not op3.last.can_get_up
    np.testing.assert_allclose(op3.robot.loads(), 0.0, atol=1e-6)


def test_a_stop_by_anybody_ends_it_and_leaves_the_way_up(op3):
    knock_over(op3, 0.0)
    op3.ask(GetUp("me"))
    op3.run(3.0)
    op3.ask(Stop("somebody else"))
    op3.run(0.02)
    assert op3.mode is Mode.STOPPED
    assert op3.last.trouble is TroubleKind.FALL
    assert op3.last.reason == "getting up was stopped by somebody else"
    op3.run(2.0)
    np.testing.assert_allclose(op3.robot.loads(), 0.0, atol=1e-6)
    assert op3.last.can_get_up
    op3.ask(GetUp("me"))
    op3.run(0.1)
    assert op3.mode is Mode.GETTING_UP


def test_who_fell_at_rest_is_not_started_and_may_get_up(op3):
    op3.ask(Rest("me"))
    op3.ask(PushRobot("me", HARD_NS, 0.0))
    op3.run(4.0)
    op3.ask(Start("me"))
    op3.run(0.1)
    assert op3.mode is Mode.STOPPED
    assert op3.last.trouble is TroubleKind.LYING
    assert op3.last.can_get_up
    assert op3.last.reason.endswith("; let it get up, or set it up and reset")
    op3.ask(GetUp("me"))
    op3.run(0.1)
    assert op3.mode is Mode.GETTING_UP


@pytest.mark.slow
def test_who_cannot_get_up_stops_and_says_so(op3):
    """Held down by its trunk."""
    knock_over(op3, 0.0)
    base = op3.robot._body.in_model.base
    hold = op3.robot.write_whole

    def held(position):
        hold(position)
        op3.robot.data.qvel[op3.robot.model.body_dofadr[base] :][:6] = 0.0

    op3.robot.write_whole = held
    op3.ask(GetUp("me"))
    op3.run(TRIES * LONGEST_S)
    assert op3.mode is Mode.STOPPED
    assert op3.last.reason == f"given up: it does not stand after {TRIES} tries"
    assert op3.last.can_get_up  # somebody may have freed it


def test_a_robot_that_has_not_fallen_is_not_moved(op3):
    op3.ask(GetUp("me"))
    op3.run(0.1)
    assert op3.mode is Mode.STANDING
    assert "get up by me refused: the robot is standing, not stopped" in " ".join(
        event.text for event in op3.events
    )
    op3.ask(EmergencyStop("me"))
    op3.run(2.0)  # refusals are told once a second
    op3.ask(GetUp("me"))
    op3.run(0.1)
    assert op3.mode is Mode.STOPPED
    assert any("it has not fallen" in event.text for event in op3.events)


def test_without_a_way_it_says_what_would_do(op3):
    op3.loop.modes.up.riser = None
    op3.ask(PushRobot("me", HARD_NS, 0.0))
    op3.run(4.0)
    assert not op3.last.can_get_up
    op3.ask(GetUp("me"))
    op3.run(0.1)
    assert op3.mode is Mode.STOPPED
    assert any("--own-model and --get-up" in event.text for event in op3.events)


def test_a_robot_that_is_lost_on_the_way_is_let_go(op3):
    knock_over(op3, 0.0)
    op3.ask(GetUp("me"))
    op3.run(2.5)

    def lost():
        raise BackendError("the bus does not answer")

    op3.robot.read_whole = lost
    op3.run(0.5)
    assert op3.mode is Mode.STOPPED
    assert op3.last.trouble is TroubleKind.LINK
    assert "the bus does not answer" in op3.last.reason
