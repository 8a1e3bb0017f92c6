"""REST of the HTTP API: what is passed on to the loop, and what is refused and why."""

import contextlib
import json
import math
import re
import runpy
import socket
from pathlib import Path

import httpx
import pytest
from api_server import API, PATIENCE_S, TOKEN, served, small_library
from hypothesis import given, settings
from hypothesis import strategies as st
from telemetry_factory import event, told

from gaitchain.backends.base import Disturbances, PunchesState
from gaitchain.errors import ServiceError
from gaitchain.live.messages import (
    Disturb,
    Drive,
    EmergencyStop,
    LetGo,
    PushRobot,
    Reset,
    Rest,
    Start,
    Stop,
)
from gaitchain.messages import Command
from gaitchain.service.api import check_guarded
from gaitchain.service.api_limits import Allowance, ApiLimits
from gaitchain.service.api_transport import listen
from gaitchain.service.settings import Settings
from gaitchain.sim.bodies import body_names

PULL = st.floats(-1.0, 1.0)
STEERING = st.fixed_dictionaries(
    {}, optional={"ahead": PULL, "left": PULL, "turn": PULL, "most": st.floats(0.01, 1)}
)


@pytest.fixture(scope="module")
def here():
    with served() as server:
        yield server


@pytest.fixture
def free(here):
    """The server while nobody drives."""
    yield here
    for name in ("me", "one", "two", "rest"):
        here.client.delete(f"{API}/driver", headers={"X-Driver": name})
    here.until_driver("")


def test_the_state_is_a_frame(here):
    frame = here.client.get(f"{API}/state").json()
    assert frame["type"] == "frame"
    assert frame["mode"] == "standing"
    assert frame["simulated"] is True
    assert frame["kind"] == "simulation"
    assert frame["joint_load"] == [None] * 12, "NaN is null"
    assert len(frame["scene"]["soles"][1]) == 4
    assert frame["fall"] is None


def test_the_library_tells_of_robot_and_chain(here):
    told_library, library = here.client.get(f"{API}/library").json(), small_library()
    assert told_library["name"] == library.robot.name
    assert told_library["fingerprint"] == library.robot.fingerprint
    assert told_library["qualified"] is True
    assert told_library["command_range"]["vy"] == list(library.command_range.vy)
    crouch = told_library["command_range"]["crouch"]
    assert crouch == list(library.command_range.crouch)
    assert told_library["joints"][3]["name"] == "left_knee"
    assert [len(layer["poses"]) for layer in told_library["layers"]] == [6, 1, 1, 6]
    last = told_library["layers"][3]["poses"][4]["primitives"]
    assert last["outward"] == pytest.approx(library.poses.strides[4, 1])
    edges = {(e["layer"], e["from"], e["to"]) for e in told_library["edges"]}
    assert (0, 0, 0) in edges
    assert (0, 1, 0) not in edges, "its cost is infinite"
    assert len(told_library["sole"]) == 4


def test_a_command_reaches_the_loop(free):
    answer = free.drive("me", vx=0.02, vy=-0.01)
    assert answer.status_code == 202
    assert answer.json() == {"asked": "drive", "driver": "me"}
    assert free.loop.until_asked(Drive) == Drive("me", 0.02, -0.01, 0.0)


def test_a_crouch_reaches_the_loop_in_metres_and_in_parts(free):
    most = small_library().command_range.crouch[0]
    assert free.drive("me", crouch=0.5 * most).status_code == 202
    assert free.loop.until_asked(Drive) == Drive("me", crouch=0.5 * most)
    me = {"X-Driver": "me"}
    answer = free.client.put(f"{API}/steering", json={"crouch": 0.25}, headers=me)
    assert answer.status_code == 202
    assert free.loop.until_asked(Drive) == Drive("me", crouch=0.25 * most)


def test_steering_and_what_is_told_of_it_follow_the_librarys_rule(free):
    span = small_library().command_range

    @settings(max_examples=30)
    @given(STEERING)
    def steer(steering):
        wish = {"ahead": 0.0, "left": 0.0, "turn": 0.0, "most": 1.0, **steering}
        *parts, most = wish.values()
        asked = span.steer(parts, most).motion
        answer = free.client.put(f"{API}/steering", json=steering)
        assert answer.json() == {"asked": "steer", "driver": "rest"}
        assert free.loop.until_asked(Drive) == Drive("rest", *asked)
        free.loop.changes = {"asked": asked}
        frame = free.until(lambda: _frame_that_tells(free, asked))
        assert tuple(frame["asked_parts"]) == span.parts(Command(*asked))

    steer()
    free.loop.changes = {}


@pytest.mark.parametrize(
    ("steering", "says"),
    [
        ({"ahead": 1.01}, "ahead 1.01: "),
        ({"turn": -2}, "turn -2: "),
        ({"most": 0}, "most 0: "),
        ({"crouch": -0.1}, "crouch -0.1: "),
        ({"left": "1"}, "left '1': "),
        ({"vx": 0.1}, "vx 0.1: "),
    ],
)
def test_a_bad_pull_of_the_wheel_is_refused(here, steering, says):
    answer = here.client.put(f"{API}/steering", json=steering)
    assert answer.status_code == 422
    assert answer.json()["detail"].startswith(says)


@pytest.mark.parametrize(
    ("method", "path", "kind"),
    [
        ("POST", "start", Start),
        ("POST", "stop", Stop),
        ("POST", "rest", Rest),
        ("POST", "reset", Reset),
        ("POST", "emergency-stop", EmergencyStop),
        ("DELETE", "driver", LetGo),
    ],
)
def test_what_needs_no_numbers_reaches_the_loop(free, method, path, kind):
    answer = free.client.request(method, f"{API}/{path}", headers={"X-Driver": "me"})
    assert answer.status_code == 202
    free.loop.until(kind("me"))


def test_a_push_reaches_the_loop(free):
    push = {"impulse_ns": 3.5, "direction_deg": 90}
    assert free.client.post(f"{API}/push", json=push).status_code == 202
    assert free.loop.until_asked(PushRobot) == PushRobot("rest", 3.5, 90.0)
    push |= {"elevation_deg": -20.5, "body": "left_foot"}
    assert free.client.post(f"{API}/push", json=push).status_code == 202
    expected = PushRobot("rest", 3.5, 90.0, -20.5, "left_foot")
    assert free.loop.until_asked(PushRobot) == expected


@pytest.mark.parametrize(
    ("change", "asked"),
    [
        ({"punches": {"most_ns": 20}}, {"punches": PunchesState(20.0, 5.0)}),
        (
            {"punches": {"most_ns": 2, "every_s": 0.5}},
            {"punches": PunchesState(2, 0.5)},
        ),
        ({"punches": None}, {"punches": None}),
        ({"arms": "random"}, {"arms": "random"}),
        ({"arms": None}, {"arms": "still"}),
        ({"payload": 0.2}, {"payload": 0.2}),
        ({"payload": None, "arms": "still"}, {"payload": 0.0, "arms": "still"}),
        ({}, {}),
    ],
)
def test_a_change_of_the_disturbances_reaches_the_loop(free, change, asked):
    answer = free.client.patch(f"{API}/disturbances", json=change)
    assert answer.status_code == 202
    assert answer.json() == {"asked": "disturb", "driver": "rest"}
    assert free.loop.until_asked(Disturb) == Disturb("rest", **asked)


def test_what_disturbs_the_robot_is_in_the_state(free):
    told = Disturbances(PunchesState(20.0, 5.0), "random", 0.2)
    free.loop.changes = {"disturbances": told}
    state = free.until(lambda: _disturbances(free))
    assert state == {
        "punches": {"most_ns": 20.0, "every_s": 5.0},
        "arms": "random",
        "payload": 0.2,
    }
    free.loop.changes = {}


def test_the_library_tells_what_may_disturb_its_robot(here):
    limits = here.client.get(f"{API}/library").json()["disturbances"]
    assert limits["impulse_ns"] == pytest.approx(62.0)
    assert limits["bodies"] == list(body_names(small_library().robot))
    assert limits["elevation_deg"] == [-90.0, 90.0]
    assert limits["every_s"] == [0.1, 1e6]
    assert limits["payload"] == [0.0, 10.0]


@pytest.mark.parametrize(
    ("body", "says"),
    [
        ('{"vx": 2.0}', "2 m/s ahead: this library walks -0.652 to 0.652 m/s"),
        ('{"yaw_rate": -9}', "-9 rad/s to the left: this library walks"),
        ('{"crouch": -0.01}', "crouch -0.01 m: this library goes 0 to 0.0"),
        ('{"crouch": 0.4}', "crouch 0.4 m: this library goes 0 to 0.0"),
        ('{"vx": NaN}', "vx nan: "),
        ('{"vx": 1e999}', "vx inf: "),
        ('{"vx": "0.1"}', "vx '0.1': "),
        ('{"vx": true}', "vx True: "),
        ('{"vx": null}', "vx: "),
        ('{"vx": [0.1]}', "vx: "),
        ('{"vx": %s}' % ("1" * 400), "vx 1111"),
        ('{"vx": %s}' % ("1" * 5000), "a number in the body has too many"),
        ('{"speed": 0.1}', "speed 0.1: "),
        ('{"\\ud800": 0.1}', "\\ud800': "),
        ('{"vx": 0.1', "not JSON: "),
        ("[" * 5000, "nested too deeply: requests have three levels"),
        ('"\xe9"', "no text in utf-8, at byte 1"),
        ("[0.1, 0, 0]", "object"),
        ("null", "object"),
        ("", "required"),
        ("\xff\xfe", ""),
    ],
)
def test_a_bad_command_is_refused_by_name_and_value(here, body, says):
    answer = here.client.put(
        f"{API}/command",
        content=body.encode("latin-1"),
        headers={"Content-Type": "application/json"},
    )
    assert answer.status_code == 422
    assert says in answer.json()["detail"]
    assert len(answer.json()["detail"]) < 600


@pytest.mark.parametrize(
    "kind", ["text/plain", "application/x-www-form-urlencoded", ""]
)
def test_a_body_that_is_not_said_to_be_json_is_refused_with_what_to_send(here, kind):
    """As curl does it; the empty kind is no header at all."""
    headers = {"Content-Type": kind} if kind else {}
    body = {"content": '{"vx": 0.01}', "headers": headers}
    for answer in (
        here.client.put(f"{API}/command", **body),
        here.client.post(f"{API}/session", **body),
    ):
        assert answer.status_code == 422
        would = "the body: send it with Content-Type: application/json"
        assert answer.json()["detail"] == would


def test_a_replay_is_as_fast_as_the_page_and_the_manual_say(here):
    root, manual = Path(__file__).parents[2], "a speed of 0.1 to 10;"
    page = (root / "src/gaitchain/service/page/replay.js").read_text("utf-8")
    listed = re.search(r"const SPEEDS = \[(.*?)\];", page)[1]
    offered = [float(speed) for speed in listed.split(",")]
    assert (min(offered), max(offered)) == (0.1, 10.0)
    assert manual in (root / "docs/drive.md").read_text("utf-8")
    for speed, status in ((0.09, 422), (0.1, 409), (10.0, 409), (10.1, 422)):
        answer = here.client.patch(f"{API}/replay", json={"speed": speed})
        assert answer.status_code == status, speed  # 409: no log is played


@pytest.mark.parametrize(
    ("push", "says"),
    [
        ({"impulse_ns": 1000}, "impulse_ns 1000 N s: at most 62.0 N s"),
        ({"impulse_ns": 0}, "impulse_ns 0: "),
        ({"impulse_ns": -3}, "impulse_ns -3: "),
        ({"impulse_ns": 3, "direction_deg": 361}, "direction_deg 361: "),
        ({"direction_deg": 0}, "impulse_ns: "),
        ({"impulse_ns": 3, "elevation_deg": -91}, "elevation_deg -91: "),
        ({"impulse_ns": 3, "body": "arm"}, "body 'arm': the robot has trunk, left_"),
        ({"impulse_ns": 3, "body": None}, "body: "),
    ],
)
def test_a_bad_push_is_refused(here, push, says):
    answer = here.client.post(f"{API}/push", json=push)
    assert answer.status_code == 422
    assert answer.json()["detail"].startswith(says)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"punches": {"most_ns": 63}}, "punches.most_ns 63 N s: at most 62.0 N s"),
        ({"punches": {"most_ns": 0}}, "punches.most_ns 0: "),
        ({"punches": {"every_s": 5}}, "punches.most_ns: "),
        ({"punches": {"most_ns": 1, "every_s": 0.01}}, "punches.every_s 0.01: "),
        ({"punches": 20}, "punches 20: "),
        ({"arms": "up"}, "arms 'up': Input should be 'still' or 'random'"),
        ({"payload": 11}, "payload 11: Input should be less than or equal to 10"),
        ({"payload": -0.1}, "payload -0.1: "),
        ({"payload": "1"}, "payload '1': "),
        ({"friction": 0.1}, "friction 0.1: "),
    ],
)
def test_a_bad_change_of_the_disturbances_is_refused(here, change, says):
    answer = here.client.patch(f"{API}/disturbances", json=change)
    assert answer.status_code == 422
    assert answer.json()["detail"].startswith(says)


@pytest.mark.parametrize("name", ["", "a b", "x" * 65, "ä", "a/b", "a\tb"])
def test_a_bad_name_of_a_driver_is_refused(here, name):
    headers = {"X-Driver": name.encode()}
    answer = here.client.post(f"{API}/start", headers=headers)
    assert answer.status_code == 422
    assert "X-Driver" in answer.json()["detail"]


@pytest.mark.parametrize("name", ["", "Karl M", "x" * 65, "ä", "a/b", "a\tb"])
def test_a_bad_name_of_a_driver_keeps_no_stop_back(here, name):
    headers = {"X-Driver": name.encode()}
    for path, kind in (("stop", Stop), ("emergency-stop", EmergencyStop)):
        answer = here.client.post(f"{API}/{path}", headers=headers)
        assert answer.status_code == 202
        assert answer.json()["driver"] == "rest"
        assert here.loop.until_asked(kind) == kind("rest")


def test_a_second_driver_is_refused_until_the_first_lets_go(free):
    assert free.drive("one", vx=0.01).status_code == 202
    free.until_driver("one")
    refused = free.drive("two", vx=0.01)
    assert refused.status_code == 409
    assert refused.json()["detail"].startswith("one drives, two watches")
    two = {"X-Driver": "two"}
    for path in ("start", "rest", "reset"):
        assert free.client.post(f"{API}/{path}", headers=two).status_code == 409
    push = free.client.post(f"{API}/push", json={"impulse_ns": 1}, headers=two)
    assert push.status_code == 409
    change = free.client.patch(f"{API}/disturbances", json={"payload": 1}, headers=two)
    assert change.status_code == 409
    for path in ("stop", "emergency-stop"):
        assert free.client.post(f"{API}/{path}", headers=two).status_code == 202
    assert free.drive("one", vx=0.02).status_code == 202
    free.client.delete(f"{API}/driver", headers={"X-Driver": "one"})
    free.until_driver("")
    assert free.drive("two", vx=0.01).status_code == 202


def test_events_have_numbers_that_go_on(here):
    here.loop.happen(event(1.0, "mode", "one"), event(1.1, "push", "two"))
    found = here.until(lambda: _events(here))
    assert [e["text"] for e in found[-2:]] == ["one", "two"]
    assert found[-1]["number"] == found[-2]["number"] + 1
    newest = found[-1]["number"]
    assert [e["text"] for e in _events(here, after=newest - 1)] == ["two"]
    assert not _events(here, after=newest)
    assert _events(here, after=newest + 1), "a number of the server before this one"
    assert here.client.get(f"{API}/state").json()["events"][-1]["text"] == "two"
    for bad in ("-1", "x", "1.5", str(2**70), "nan"):
        answer = here.client.get(f"{API}/events", params={"after": bad})
        assert answer.status_code == 422, bad


def test_no_more_than_200_events_are_kept(here):
    here.loop.happen(*(event(2.0, "log", f"{i}") for i in range(300)))
    here.until(lambda: _events(here)[-1]["text"] == "299")
    assert len(_events(here)) == 200
    assert len(here.client.get(f"{API}/state").json()["events"]) == 10


def test_health_counts_clients(here):
    with here.stream() as watching:
        watching.recv(timeout=PATIENCE_S)
        health = here.client.get(f"{API}/health").json()
    assert health["loop"]["mode"] == "standing"
    assert health["loop"]["pace"]["period_s"] == 0.004
    assert health["clients"] == 1
    whole = {"sent": 0, "lost": 0, "note": "", "holds": False, "supply_v": None}
    assert health["link"] == whole


def test_damaged_telemetry_is_passed_over(here):
    here.loop.tell(b"no telemetry", told(small_library().robot, 5.0, steps=77))
    with here.stream() as watching:
        while json.loads(watching.recv(timeout=PATIENCE_S))["steps"] == 77:
            pass
    assert here.client.get(f"{API}/state").status_code == 200


def test_a_silent_loop_is_said_but_still_stopped():
    with served(ApiLimits(silent_s=0.2, requests_per_s=1e6)) as here:
        here.loop.silent.set()
        here.until(lambda: here.client.get(f"{API}/state").status_code != 200)
        refused = here.client.get(f"{API}/state")
        assert refused.status_code == 503
        assert "silent" in refused.json()["detail"]
        assert here.drive("me", vx=0.01).status_code == 503
        assert here.client.get(f"{API}/health").status_code == 503
        assert here.client.get(f"{API}/health").json()["loop"] is None
        assert here.client.post(f"{API}/emergency-stop").status_code == 202
        assert here.loop.until_asked(EmergencyStop) == EmergencyStop("rest")


def test_before_the_first_telemetry_the_loop_is_silent():
    with served(live=False) as here:
        assert here.client.get(f"{API}/state").status_code == 503
        assert here.client.get(f"{API}/events").json() == {"events": []}
        assert here.client.get(f"{API}/fall").status_code == 404


@pytest.mark.parametrize("settings", [{"backend": "mock"}, {"replay": "a.mcap"}])
def test_only_a_simulated_robot_is_pushed(settings):
    with served(**settings) as here:
        refused = here.client.post(f"{API}/push", json={"impulse_ns": 1})
        assert refused.status_code == 409
        log = "this is a replay of a log, " if "replay" in settings else ""
        detail = f"{log}only a simulated robot can be pushed"
        assert refused.json()["detail"] == detail
        refused = here.client.patch(f"{API}/disturbances", json={"payload": 0.1})
        assert refused.status_code == 409
        assert refused.json()["detail"].endswith("a simulated robot can be disturbed")
        state = here.client.get(f"{API}/state").json()
        assert state["simulated"] is False
        assert state["kind"] == ("mock" if "backend" in settings else "unknown")
        assert state["disturbances"] is None
        assert here.client.get(f"{API}/library").json()["disturbances"] is None


@pytest.mark.parametrize("what", ["command", "steering", "rest", "get-up"])
def test_nobody_drives_a_log(what):
    with served(replay="a.mcap") as here:
        driven = what in ("command", "steering")
        send = here.client.put if driven else here.client.post
        refused = send(f"{API}/{what}", **({"json": {}} if driven else {}))
        assert refused.status_code == 409
        assert refused.json()["detail"] == "this is a replay of a log: nobody drives it"


def test_too_many_requests_are_refused_but_not_the_emergency_stop():
    with served(ApiLimits(requests_per_s=8)) as here:
        answers = [here.client.get(f"{API}/health") for _ in range(30)]
        refused = [answer for answer in answers if answer.status_code == 429]
        assert refused
        assert refused[0].headers["retry-after"] == "1"
        assert "8 requests a second" in refused[0].json()["detail"]
        for _ in range(20):
            assert here.client.post(f"{API}/emergency-stop").status_code == 202
        strange = {"Authorization": "Bearer wrong"}
        stops = [
            here.client.post(f"{API}/emergency-stop", headers=strange).status_code
            for _ in range(20)
        ]
        assert 429 in stops, "who guesses tokens is not let off"


def test_a_large_body_is_refused(here):
    large = b" " * 20_000
    whole = here.client.put(f"{API}/command", content=large)
    assert whole.status_code == 413
    parts = here.client.put(f"{API}/command", content=iter([large, large]))
    assert parts.status_code == 413
    assert "16384 bytes" in parts.json()["detail"]


def test_a_stop_stops_whatever_its_body_is():
    """A large body, and one that never comes: a stop has none to wait for."""
    large = b" " * 20_000
    with served() as here:
        for path, kind in (("stop", Stop), ("emergency-stop", EmergencyStop)):
            for body in (large, b"{", iter([large, large])):
                answer = here.client.post(f"{API}/{path}", content=body)
                assert answer.status_code == 202
                assert here.loop.until_asked(kind) == kind("rest")
        with _connected(here) as slow:
            head = f"POST {API}/emergency-stop HTTP/1.1\r\nHost: localhost\r\n"
            head += f"Authorization: Bearer {TOKEN}\r\nContent-Length: 99999999\r\n\r\n"
            slow.sendall(head.encode())
            assert b" 202 " in slow.recv(100)


def test_who_is_slow_over_a_request_is_hung_up_on():
    with served(ApiLimits(request_s=0.3)) as here:
        for begun in (b"", b"GET / HTTP/1.1\r\nHost: local"):
            with _connected(here) as slow:
                slow.sendall(begun)
                assert _is_over(slow)
        with _connected(here) as slow:
            head = f"PUT {API}/command HTTP/1.1\r\nHost: localhost\r\n"
            head += f"Authorization: Bearer {TOKEN}\r\nContent-Length: 10\r\n\r\n"
            slow.sendall(head.encode())
            assert _is_over(slow)
        assert here.client.get(f"{API}/health").status_code == 200


_HALF = (
    b"",
    b"POST /api/v1/stop HTTP/1.1\r\nHost: a\r\n",
    b"POST /api/v1/stop HTTP/1.1\r\nHost: a\r\nContent-Length: 9\r\n\r\n{",
)


@pytest.mark.parametrize("sent", _HALF)
def test_connections_that_ask_nothing_shut_nobody_out(sent):
    with served(ApiLimits(connections=8, request_s=1e4)) as here:
        opened = [_connected(here) for _ in range(40)]
        for connection in opened:
            with contextlib.suppress(OSError):  # hung up on already
                connection.sendall(sent)
        stopped = here.client.post("/api/v1/emergency-stop")
        assert stopped.status_code == 202
        here.loop.until_asked(EmergencyStop)
        assert _is_over(opened[0])  # who was idle for longest
        for connection in opened:
            connection.close()


def test_what_is_not_http_is_refused(here):
    for sent in (b"\x00" * 100, b"GET\r\n\r\n", b"GET / HTTP/1.1\r\n\r\n", b"\x16\x03"):
        with _connected(here) as other:
            other.sendall(sent)
            other.shutdown(socket.SHUT_WR)
            answer = other.recv(1000)
            assert not answer or answer.startswith(b"HTTP/1.1 4"), sent


def test_no_page_loads_anything_from_elsewhere(here):
    for path in ("/docs", "/redoc"):
        assert here.client.get(path).status_code == 404
    page = here.client.get("/")
    assert page.status_code == 200
    assert "http://" not in page.text
    assert "https://" not in page.text
    assert here.client.get("/page/frame.js").status_code == 200
    for path in ("/page/", "/page", "/page/none.js", "/page/../api.py"):
        assert here.client.get(path).status_code == 404, path
    assert here.client.get("/page/%2e%2e/api.py").status_code == 404


def test_every_answer_has_the_security_headers(here):
    for path in ("/", f"{API}/state", "/nothing", "/viewer/", "/openapi.json"):
        answer = here.client.get(path)
        assert answer.headers["x-content-type-options"] == "nosniff"
        policy = answer.headers["content-security-policy"]
        assert "frame-ancestors 'self'" in policy
        assert ("unsafe" in policy) == path.startswith("/viewer")
        assert "server" not in answer.headers
    assert here.client.get(f"{API}/state").headers["cache-control"] == "no-store"


def test_the_openapi_document_knows_the_limits(here):
    document = here.client.get("/openapi.json").json()
    assert document["openapi"].startswith("3.1")
    motion = document["components"]["schemas"]["Motion"]["properties"]
    span = small_library().command_range
    assert motion["vx"]["minimum"] == span.vx[0]
    assert motion["yaw_rate"]["maximum"] == span.yaw_rate[1]
    schemas = document["components"]["schemas"]
    pushed = schemas["PushRequest"]["properties"]
    assert pushed["impulse_ns"]["maximum"] == pytest.approx(62.0)
    assert pushed["body"]["enum"] == [*body_names(small_library().robot), "any"]
    punched = schemas["PunchesRequest"]["properties"]
    assert punched["most_ns"]["maximum"] == pytest.approx(62.0)
    assert punched["every_s"]["minimum"] == 0.1
    assert document["security"]
    for path, methods in document["paths"].items():
        for route in methods.values():
            assert {"401", "403"} <= route["responses"].keys(), path


def test_every_number_that_is_sent_is_described(here):
    """Of what a message inherits, too; units are in brackets."""
    schemas = here.client.get("/openapi.json").json()["components"]["schemas"]
    bare = [
        f"{message}.{field}"
        for message, schema in schemas.items()
        for field, part in schema.get("properties", {}).items()
        if "description" not in part and '"number"' in json.dumps(part)
    ]
    assert not bare
    for message, field, unit in (
        ("Pace", "late_p99_s", "s"),
        ("TelemetryFrame", "estimated_tilt", "rad"),
        ("JointInfo", "lower", "rad"),
    ):
        assert f"[{unit}]" in schemas[message]["properties"][field]["description"]


def test_docs_api_md_is_what_the_code_says():
    docs = Path(__file__).parents[2] / "docs"
    make = runpy.run_path(str(docs / "api_reference.py"))["api_markdown"]
    assert (docs / "api.md").read_text("utf-8") == make(), (
        "run `python docs/api_reference.py`"
    )


def test_nobody_else_is_let_in_without_a_token():
    for host in ("127.0.0.1", "localhost", "::1"):
        check_guarded(Settings(library="", host=host))
    check_guarded(Settings(library="", host="0.0.0.0", token="t"))
    for host in ("0.0.0.0", "::", "", "192.168.1.7", "robot.local"):
        with pytest.raises(ServiceError, match="give a --token-file"):
            check_guarded(Settings(library="", host=host))


def test_an_address_that_cannot_be_had_is_named():
    with (
        listen("127.0.0.1", 0) as taken,
        pytest.raises(ServiceError, match="choose another port"),
    ):
        listen("127.0.0.1", taken.getsockname()[1])
    with pytest.raises(ServiceError, match=r"--host 203\.0\.113\.1 --port 0"):
        listen("203.0.113.1", 0)
    with pytest.raises(ServiceError, match=r"no\.such\.host\.invalid"):
        listen("no.such.host.invalid", 0)


def test_an_allowance_fills_up_again():
    now = [0.0]
    allowance = Allowance(2.0, 3.0, lambda: now[0])
    assert [allowance.take() for _ in range(4)] == [True, True, True, False]
    now[0] = 0.5
    assert [allowance.take() for _ in range(2)] == [True, False]
    now[0] = math.inf
    assert allowance.take()


def _frame_that_tells(here, asked):
    frame = here.client.get(f"{API}/state").json()
    return frame if tuple(frame["asked"]) == asked else None


def _disturbances(here):
    return here.client.get(f"{API}/state").json()["disturbances"]


def _events(here, after=0):
    answer = here.client.get(f"{API}/events", params={"after": after})
    return answer.json()["events"]


def _answers(here):
    try:
        return here.client.get(f"{API}/health").status_code in (200, 503)
    except httpx.TransportError:
        return False


def _connected(here):
    return socket.create_connection(("127.0.0.1", here.port), PATIENCE_S)


def _is_over(connection):
    """Whether the server hangs up; waits for it."""
    try:
        while connection.recv(1000):
            pass
    except ConnectionResetError:
        pass
    return True
