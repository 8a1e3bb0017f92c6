"""Places and footsteps over the HTTP API: what reaches the loop, and what does not."""

import json
import math

import msgspec
import pytest
from api_server import API, PATIENCE_S, TOKEN, served, small_library

from gaitchain.gait.command_range import CommandRange
from gaitchain.live.messages import FollowSteps, Going, GoTo, Mode, ReplayState
from gaitchain.service import command_gateway
from gaitchain.service.api_limits import ApiLimits
from gaitchain.walker.footsteps import Footstep
from gaitchain.walker.place import Place
from gaitchain.walker.stride_generator import StrideGenerator

HERE = Place(1.0, 2.0)
HALF = 0.5 * small_library().poses.stance
FEET = Place(1.0, 2.0 + HALF), Place(1.0, 2.0 - HALF)
KNOWN = {"place": HERE, "feet": FEET}
LONGEST = float(small_library().poses.strides[:, 0].max())
REPLAY = ReplayState(0.0, 1.0, 1.0, playing=False)
GOAL = {"x": 1.5, "y": 2.5, "yaw": 0.5}


@pytest.fixture(scope="module")
def service():
    with served() as server:
        yield server


@pytest.fixture
def here(service):
    tell(service, **KNOWN)
    yield service
    tell(service, **KNOWN)
    service.client.delete(f"{API}/driver", headers={"X-Driver": "rest"})
    service.until_driver("")


def tell(here, **changes):
    """Let the loop tell this from now on, and wait until it has come."""
    here.loop.changes = changes
    usual = {"going": None, "mode": "standing", "place": None, "replay": None}
    wanted = usual | json_of(changes)
    here.until(lambda: {k: state(here)[k] for k in wanted} == wanted)


def json_of(changes):
    known = {k: v for k, v in changes.items() if k in ("mode", "place")}
    for name in ("going", "replay"):
        if changes.get(name) is not None:
            known[name] = json.loads(msgspec.json.encode(changes[name]))
    if "place" in known:
        known["place"] = list(known["place"])
    return known


def state(here):
    return here.client.get(f"{API}/state").json()


def landing(left, ahead):
    return {"left": left, "x": 1.0 + ahead, "y": 2.0 + (HALF if left else -HALF)}


def follow(here, *steps):
    return here.client.put(f"{API}/footsteps", json={"steps": steps})


def test_a_goal_reaches_the_loop(here):
    answer = here.client.put(f"{API}/goal", json={**GOAL, "crouch": 1.0})
    assert answer.status_code == 202
    assert answer.json() == {"asked": "go_to", "driver": "rest"}
    low = small_library().command_range.crouch[0]
    expected = GoTo("rest", (Place(1.5, 2.5, 0.5),), low)
    assert here.loop.until_asked(GoTo) == expected


def test_a_goal_goes_the_same_way_by_the_stream(here):
    with here.stream("driver=me") as client:
        client.send(json.dumps({"type": "go_to", **GOAL}))
        assert here.loop.until_asked(GoTo) == GoTo("me", (Place(1.5, 2.5, 0.5),))


def test_how_far_it_is_is_in_the_state(here):
    tell(here, going=Going(Place(1.5, 2.5), 1, 0, 0.7, 0.1, arrived=False), **KNOWN)
    found = state(here)["going"]
    assert found["goal"] == [1.5, 2.5, 0.0]
    assert (found["distance_m"], found["arrived"]) == (0.7, False)
    tell(here, going=Going(None, 0, 2, math.nan, math.nan, arrived=False), **KNOWN)
    assert state(here)["going"]["distance_m"] is None


@pytest.mark.parametrize(
    ("goal", "says"),
    [
        ({"x": 1}, "y: Field required"),
        ({"x": 1001, "y": 0}, "x 1001: "),
        ({"x": "1", "y": 0}, "x '1': "),
        ({"x": 1, "y": 0, "z": 0}, "z 0: "),
        ({"x": 1, "y": 0, "crouch": 2}, "crouch 2: "),
    ],
)
def test_a_bad_goal_is_refused_by_name_and_value(here, goal, says):
    answer = here.client.put(f"{API}/goal", json=goal)
    assert answer.status_code == 422
    assert answer.json()["detail"].startswith(says)
    with here.stream() as client:
        client.send(json.dumps({"type": "go_to", **goal}))
        assert says in complaint(client)


def complaint(client):
    while (said := json.loads(client.recv(timeout=PATIENCE_S)))["type"] != "error":
        pass
    return said["detail"]


def test_a_goal_without_a_way_is_refused_but_not_on_the_way(here, monkeypatch):
    gateway = here.app.state.service.gateway
    monkeypatch.setattr(gateway, "_span", CommandRange((-0.3, 0.5)))
    answer = here.client.put(f"{API}/goal", json=GOAL)
    assert answer.status_code == 409
    said = answer.json()["detail"]
    assert said.startswith("goal (1.5, 2.5, 0.5): the way there leads to the left and ")
    with here.stream() as client:
        client.send(json.dumps({"type": "go_to", **GOAL}))
        assert "leads to the left" in complaint(client)
    on_the_way = Going(Place(1.5, 2.5, 0.5), 1, 0, 0.7, 0.1, arrived=False)
    tell(here, going=on_the_way, **KNOWN)
    assert here.client.put(f"{API}/goal", json=GOAL).status_code == 202


@pytest.fixture
def old(here, monkeypatch):
    """A loop that has run for an hour; clients ask at once, however busy this is."""
    monkeypatch.setattr(here.app.state.service.gateway._errands, "_now", lambda: 0.0)
    grow_old(here)
    return here


def grow_old(here):
    here.loop.grow_old()
    here.until(lambda: state(here)["time_s"] >= 3600.0)


def begin_anew(here):
    here.loop.begin_anew()
    here.until(lambda: state(here)["time_s"] < 3600.0)


def test_a_goal_that_is_but_repeated_does_not_lead_a_new_loop(old):
    """Its numbers are of places that are no more."""

    def answer(goal=GOAL):
        return old.client.put(f"{API}/goal", json=goal)

    assert answer().status_code == 202
    begin_anew(old)
    for _ in range(3):
        assert answer().status_code == 409
    assert "the loop began anew since this was asked for" in answer().json()["detail"]
    grow_old(old)
    assert answer({**GOAL, "x": 1.4}).status_code == 202, "another one is meant"
    begin_anew(old)
    assert answer({**GOAL, "x": 1.4}).status_code == 409
    old.client.put(f"{API}/command", json={"vx": 0.0})
    assert answer({**GOAL, "x": 1.4}).status_code == 202


def test_footsteps_that_are_but_repeated_do_not_lead_a_new_loop(old):
    assert follow(old, landing(left=True, ahead=0.3 * LONGEST)).status_code == 202
    old.loop.until_asked(FollowSteps)
    begin_anew(old)
    again = follow(old, landing(left=True, ahead=0.3 * LONGEST))
    assert again.status_code == 409
    assert "the loop began anew" in again.json()["detail"]


def test_footsteps_reach_the_loop(here):
    steps = landing(True, LONGEST), landing(False, LONGEST)
    assert follow(here, *steps).status_code == 202
    asked = here.loop.until_asked(FollowSteps)
    assert asked.steps == tuple(Footstep(s["left"], s["x"], s["y"]) for s in steps)


def test_the_first_footsteps_wait_for_no_tables(here, monkeypatch):
    """They are computed before requests are answered: a stop may wait behind."""
    monkeypatch.setattr(StrideGenerator, "__init__", None)
    assert follow(here, landing(True, 0.0)).status_code == 202


def test_a_flood_of_footsteps_is_not_looked_at(here, monkeypatch):
    """A stop waits for each plan that is; here as many come back as never."""
    plan = [landing(i % 2 == 0, 0.0) for i in range(200)]
    looked, look = [], command_gateway.check_footsteps

    def counted(strides, feet, steps, stance):
        looked.append(len(steps))
        look(strides, feet, steps, stance)

    monkeypatch.setattr(command_gateway, "check_footsteps", counted)
    few = ApiLimits(requests_per_s=1e6, footsteps_per_s=1e-6)
    with served(few) as other:
        tell(other, **KNOWN)
        wrong = [*plan[:-1], landing(False, 9.0)]
        statuses = [follow(other, *wrong).status_code for _ in range(5)]
        assert statuses == [409, 409, 429, 429, 429]
        answer = follow(other, plan[0])
        assert answer.status_code == 429
        assert "new footsteps a second" in answer.json()["detail"]
        stopped = other.client.post(f"{API}/emergency-stop")
        assert stopped.status_code == 202
    assert sum(looked) == few.footsteps


def test_a_step_that_cannot_be_made_is_answered_with_its_number(here):
    answer = follow(here, landing(True, 0.0), landing(False, 9.0))
    assert answer.status_code == 409
    assert "footstep 2, the right foot at 10" in answer.json()["detail"]
    answer = follow(here, landing(True, 0.0), landing(True, 0.0))
    assert "footstep 2: the left foot again" in answer.json()["detail"]
    assert follow(here).status_code == 422
    with here.stream() as client:
        wanted = {"type": "follow_steps", "steps": [landing(True, 9.0)]}
        client.send(json.dumps(wanted))
        assert "footstep 1, the left foot at 10" in complaint(client)


def test_footsteps_begin_from_a_stand_but_are_repeated_on_the_way(here):
    tell(here, mode=Mode.WALKING, **KNOWN)
    answer = follow(here, landing(True, 0.0))
    assert answer.status_code == 409
    assert "begin from a stand; the robot is walking" in answer.json()["detail"]
    tell(here, **KNOWN)
    assert follow(here, landing(True, 0.0)).status_code == 202
    on_the_way = Going(None, 0, 1, math.nan, math.nan, arrived=False)
    tell(here, mode=Mode.WALKING, going=on_the_way, **KNOWN)
    assert follow(here, landing(True, 0.0)).status_code == 202
    assert follow(here, landing(False, 0.0)).status_code == 409


@pytest.mark.parametrize("lacks", [{}, {**KNOWN, "replay": REPLAY}])
def test_where_nothing_measures_the_place_it_says_so(here, lacks):
    tell(here, **lacks)
    for answer in (
        here.client.put(f"{API}/goal", json=GOAL),
        follow(here, landing(True, 0.0)),
    ):
        assert answer.status_code == 409
        assert "library of strides" in answer.json()["detail"]


def test_places_need_token_and_wheel_as_all_commands_do(here):
    for path, wish in (("goal", GOAL), ("footsteps", {"steps": [landing(True, 0.0)]})):
        nobody = here.client.put(
            f"{API}/{path}", json=wish, headers={"Authorization": "Bearer no"}
        )
        assert nobody.status_code == 401
        foreign = {"Origin": "http://evil.test"}
        stranger = here.client.put(f"{API}/{path}", json=wish, headers=foreign)
        assert stranger.status_code == 403
    assert here.drive("one", vx=0.1).status_code == 202
    here.until_driver("one")
    answer = here.client.put(f"{API}/goal", json=GOAL)
    assert answer.status_code == 409
    assert "one drives, rest watches" in answer.json()["detail"]
    here.client.delete(f"{API}/driver", headers={"X-Driver": "one"})
    assert TOKEN not in answer.text
