"""The telemetry stream: frames, drivers, and clients that are slow, many or mad."""

import asyncio
import json
import math
import queue
import random
import socket
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress

import pytest
from api_server import API, PATIENCE_S, TOKEN, FakeLoop, served, small_library
from patience import Deadline
from telemetry_factory import FALLEN, told
from websockets.exceptions import ConnectionClosed, InvalidStatus

from gaitchain.backends.base import PunchesState
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.live.messages import (
    Disturb,
    Drive,
    EmergencyStop,
    LetGo,
    Mode,
    PushRobot,
    Stop,
)
from gaitchain.service.api import make_service
from gaitchain.service.api_feed import LOOP_BEGINS, LOOP_SILENT
from gaitchain.service.api_limits import ApiLimits
from gaitchain.service.channel import Asker
from gaitchain.service.command_gateway import RefusedError
from gaitchain.service.settings import Settings
from gaitchain.service.stream import Client

VALUES = [0, -0.0, 0.01, 1e-300, 1e9, -1, 2**70, 10**400, math.nan, math.inf]
VALUES += [0.02, "x", "\ud800", None, True, [], {}, [0.1], {"vx": 1}]
DRIVE = json.dumps({"type": "drive", "vx": 0.01})


@pytest.fixture(scope="module")
def here():
    with served() as server:
        yield server


def test_frames_come_and_move_on(here):
    with here.stream() as watching:
        frames = [json.loads(watching.recv(timeout=PATIENCE_S)) for _ in range(5)]
    times = [frame["time_s"] for frame in frames]
    assert all(frame["type"] == "frame" for frame in frames)
    assert times == sorted(set(times)), "no frame twice, none out of order"


def test_a_faster_client_gets_more(here):
    with here.stream("hz=100") as fast, here.stream("hz=10") as slow:
        for _ in range(3):
            slow.recv(timeout=PATIENCE_S)
        last = json.loads(slow.recv(timeout=PATIENCE_S))["time_s"]
        count = 0
        while json.loads(fast.recv(timeout=PATIENCE_S))["time_s"] < last:
            count += 1
    assert count > 8


@pytest.mark.parametrize(
    "query",
    ["hz=0", "hz=101", "hz=nan", "hz=-inf", "hz=x", "hz=", "driver=a%20b", "driver=%a"],
)
def test_a_bad_query_is_refused(here, query):
    with pytest.raises(InvalidStatus) as refused:
        here.stream(query)
    assert refused.value.response.status_code == 422
    name, _ = query.split("=")
    detail = json.loads(refused.value.response.body)["detail"]
    assert detail.startswith(f"{name} ")
    assert " to " in detail


def test_a_socket_drives_and_lets_go_when_it_closes(here):
    with here.stream("driver=page") as driving:
        driving.send(json.dumps({"type": "drive", "vx": 0.02, "yaw_rate": -0.1}))
        assert here.loop.until_asked(Drive) == Drive("page", 0.02, 0.0, -0.1)
        here.until_driver("page")
    assert here.loop.until_asked(LetGo) == LetGo("page")


def test_a_socket_steers_by_parts_of_the_range(here):
    span = small_library().command_range
    with here.stream("driver=page") as driving:
        pulled = {"ahead": 0.6, "turn": -0.6, "most": 0.6}
        driving.send(json.dumps({"type": "steer", **pulled}))
        half = span.at((0.3, 0.0, -0.3)).motion
        assert here.loop.until_asked(Drive) == Drive("page", *half)
        here.until_driver("page")
    assert here.loop.until_asked(LetGo) == LetGo("page")


@pytest.mark.parametrize("kind", ["start", "rest", "reset", "push", "disturb"])
def test_a_socket_that_took_the_wheel_by_a_button_lets_go_as_well(here, kind):
    with here.stream("driver=page") as pressing:
        more = {"impulse_ns": 1.0, "direction_deg": 0} if kind == "push" else {}
        pressing.send(json.dumps({"type": kind, **more}))
        here.until_driver("page")
    assert here.loop.until_asked(LetGo) == LetGo("page")
    here.until_driver("")


def test_a_socket_that_did_not_drive_lets_nothing_go(here):
    with here.stream("driver=watcher") as watching:
        watching.send('{"type": "stop"}')
        here.loop.until_asked(Stop)
    with here.stream("driver=other") as driving:
        driving.send(DRIVE)
        assert here.loop.until_asked(Drive, LetGo).driver == "other"
    assert here.loop.until_asked(LetGo) == LetGo("other")


def test_a_page_that_comes_back_keeps_the_wheel(here):
    with here.stream("driver=same") as later:
        with here.stream("driver=same") as before:
            before.send(DRIVE)
            here.loop.until_asked(Drive)
        later.send('{"type": "drive", "vx": 0.03}')
        assert here.loop.until_asked(Drive, LetGo).vx == 0.03
    assert here.loop.until_asked(LetGo) == LetGo("same")


def test_sockets_without_a_name_do_not_share_one(here):
    names = []
    for _ in range(2):
        with here.stream() as driving:
            driving.send(DRIVE)
            names.append(here.loop.until_asked(Drive).driver)
        here.loop.until_asked(LetGo)
        here.until_driver("")
    assert len(set(names)) == 2


def test_a_second_driver_is_told_and_watches(here):
    with here.stream("driver=first") as first, here.stream("driver=second") as second:
        first.send(DRIVE)
        here.until_driver("first")
        second.send(DRIVE)
        assert "first drives, second watches" in _complaint(second)
        assert json.loads(second.recv(timeout=PATIENCE_S))["driver"] == "first"
        second.send('{"type": "emergency_stop"}')
        assert here.loop.until_asked(EmergencyStop) == EmergencyStop("second")
    here.until_driver("")


def test_pushes_go_the_same_way(here):
    with here.stream("driver=me") as pushing:
        pushing.send('{"type": "push", "impulse_ns": 2, "direction_deg": -90}')
        assert here.loop.until_asked(PushRobot) == PushRobot("me", 2.0, -90.0)
        pushing.send('{"type": "push", "impulse_ns": 2000}')
        assert "at most 62.0 N s" in _complaint(pushing)
        pushing.send('{"type": "push", "impulse_ns": 2, "body": "any"}')
        assert here.loop.until_asked(PushRobot).body == "any"


def test_disturbances_go_the_same_way(here):
    with here.stream("driver=me") as client:
        client.send('{"type": "disturb", "punches": {"most_ns": 20}, "arms": "random"}')
        asked = Disturb("me", PunchesState(20.0, 5.0), "random")
        assert here.loop.until_asked(Disturb) == asked
        client.send('{"type": "disturb", "punches": {"most_ns": 99}}')
        assert "punches.most_ns 99 N s: at most 62.0 N s" in _complaint(client)
        client.send('{"type": "disturb", "payload": 11}')
        assert _complaint(client).startswith("payload 11: ")
        client.send('{"type": "disturb", "payload": null, "punches": null}')
        assert here.loop.until_asked(Disturb) == Disturb("me", None, payload=0.0)


@pytest.mark.parametrize(
    ("message", "says"),
    [
        ('{"type": "drive", "vx": 2}', "2 m/s ahead: this library walks"),
        ('{"type": "drive", "vx": NaN}', "vx nan: "),
        ('{"type": "drive", "vx": 1e400}', "vx inf: "),
        ('{"type": "drive", "vx": "0"}', "vx '0': "),
        ('{"type": "drive", "speed": 1}', "speed 1: "),
        ('{"type": "steer", "ahead": 2}', "ahead 2: "),
        ('{"type": "steer", "vx": 0.1}', "vx 0.1: "),
        ('{"type": "fly"}', "'fly'"),
        ('{"type": 3}', "type"),
        ("{}", "type"),
        ("[]", ""),
        ("", "JSON"),
        ("nonsense", "JSON"),
        ("[" * 2000, "JSON"),
        (b"\xff\x00", "JSON"),
        ("x" * 3000, "3000 bytes: at most 2048"),
    ],
)
def test_a_bad_message_is_answered_and_no_more(here, message, says):
    with here.stream() as client:
        client.send(message)
        assert says in _complaint(client)
        assert _frame(client)["type"] == "frame"


def test_bytes_that_are_json_are_read(here):
    with here.stream("driver=bytes") as client:
        client.send(DRIVE.encode())
        assert here.loop.until_asked(Drive).driver == "bytes"
    here.loop.until_asked(LetGo)
    here.until_driver("")


def test_who_sends_nothing_but_nonsense_is_closed():
    limits = ApiLimits(bad_messages=5, requests_per_s=1e6)
    with served(limits) as here, here.stream() as mad, here.stream() as sane:
        with suppress(ConnectionClosed):
            for _ in range(20):
                mad.send("nonsense")
        assert _closed_with(mad) == 1008
        assert _frame(sane)["type"] == "frame"


def test_a_huge_message_closes_the_socket(here):
    with here.stream(max_size=None) as mad, here.stream() as sane:
        with pytest.raises(ConnectionClosed):
            mad.send("x" * 1_000_000)
            while True:
                mad.recv(timeout=PATIENCE_S)
        assert _frame(sane)["type"] == "frame"


def test_a_flood_closes_its_client_and_nobody_else(here):
    # Nobody reads what the other one is told meanwhile, which its end would wait for.
    sane_one = here.stream("driver=sane", max_queue=None)
    with here.stream("driver=flood") as mad, sane_one as sane:
        with suppress(ConnectionClosed):
            for _ in range(20_000):
                mad.send(DRIVE)
        assert _closed_with(mad) == 1008
        first = _frame(sane)
        assert _frame(sane)["time_s"] > first["time_s"]
        sane.send('{"type": "stop"}')
    health = here.client.get(f"{API}/health").json()
    assert health["loop"]["mode"] == "standing"
    here.until_driver("")


def test_the_emergency_stop_overtakes_a_flood_of_commands(here):
    here.loop.deaf.set()
    _drain(here.loop.asked)
    with here.stream("driver=flood") as mad:
        for _ in range(150):
            mad.send(DRIVE)
        mad.send("nonsense")
        _complaint(mad)  # so all before it were taken
        assert here.client.post(f"{API}/emergency-stop").status_code == 202
        here.loop.deaf.clear()
        before = 0
        while isinstance(here.loop.asked.get(timeout=PATIENCE_S), Drive):
            before += 1
    assert before < 150
    here.until_driver("")


def test_a_stop_is_taken_while_a_complaint_waits_for_a_client_that_reads_nothing():
    hub = FakeHub(ApiLimits())
    stops = ['{"type": "stop"}', '{"type": "emergency_stop"}']
    asyncio.run(FakeSocket(DRIVE, *stops, takes=False).serve(hub))
    assert hub.acts == ["stop", "emergency_stop"]


@pytest.mark.parametrize("kind", ["stop", "emergency_stop"])
def test_a_stop_is_done_whatever_else_its_message_says_which_is_told(kind):
    hub = FakeHub(ApiLimits())
    socket = FakeSocket(json.dumps({"type": kind, "foo": []}))
    asyncio.run(socket.serve(hub))
    assert hub.acts == [kind]
    assert len(socket.sent) == 1
    assert "foo" in socket.sent[0]


def test_the_latest_complaint_is_the_one_that_is_sent():
    hub, socket = FakeHub(ApiLimits()), FakeSocket("[", '{"type": "fly"}')
    asyncio.run(socket.serve(hub))
    assert len(socket.sent) == 1
    assert "fly" in socket.sent[0]


def test_a_stop_beyond_the_limit_is_taken_before_its_client_is_closed():
    hub = FakeHub(ApiLimits(messages_per_s=1.0))
    beyond = ['{"type": "start"}', '{"type": "emergency_stop"}', '{"type": "stop"}']
    socket = FakeSocket('{"type": "let_go"}', *beyond)
    asyncio.run(socket.serve(hub))
    assert hub.acts == ["let_go", "emergency_stop", "stop"]
    assert socket.closed == [(1008, "more than 1 messages a second")]


def test_a_stop_after_too_much_nonsense_is_taken_as_well():
    hub = FakeHub(ApiLimits(bad_messages=1))
    socket = FakeSocket("[", "[", '{"type": "start"}', '{"type": "emergency_stop"}')
    asyncio.run(socket.serve(hub))
    assert hub.acts == ["emergency_stop"]
    assert socket.closed == [(1008, "too many messages that cannot be read")]


def test_one_client_too_many_is_refused():
    with served(ApiLimits(sockets=2, requests_per_s=1e6)) as here:
        here.until(lambda: _health(here)["clients"] == 0)
        with here.stream(), here.stream():
            with pytest.raises(InvalidStatus) as refused:
                here.stream()
            assert refused.value.response.status_code == 503
            assert b"2 clients watch already" in refused.value.response.body
        here.until(lambda: _health(here)["clients"] == 0)
        with here.stream() as again:
            assert _frame(again)


@pytest.mark.slow
def test_a_client_that_does_not_read_is_hung_up_on_and_delays_nobody():
    limits = ApiLimits(stalled_s=3.0, requests_per_s=1e6)
    with served(limits) as here:
        here.loop.changes["reason"] = "x" * 50_000  # so that buffers are soon full
        with (
            _handshaken(here, receive=4096) as stalled,
            here.stream("hz=20") as watching,
        ):
            here.until(lambda: _health(here)["clients"] == 2)
            before = _frame(watching)["time_s"]
            seen = 0
            while _health(here)["clients"] > 1:
                assert _frame(watching)["time_s"] > before
                seen += 1
            assert seen > 5, "the other one got frames all the while"
            health = here.client.get(f"{API}/health").json()
            assert health["dropped_frames"] > 10
            _read_to_the_end(stalled)


def test_a_client_that_takes_all_late_is_no_error(caplog):
    limits = ApiLimits(stalled_s=1.0, requests_per_s=1e6)
    with served(limits) as here:
        here.loop.changes["reason"] = "x" * 50_000
        with _handshaken(here, receive=4096) as late:
            here.until(lambda: _health(here)["clients"] == 1)
            here.until(lambda: _health(here)["clients"] == 0)
            _read_to_the_end(late)  # before it is dropped
        dropped_s = time.monotonic() + 1.5 * limits.stalled_s
        here.until(lambda: time.monotonic() > dropped_s)
    assert not [r for r in caplog.records if r.name == "asyncio"]


def test_a_client_that_only_pings_is_hung_up_on_too():
    limits = ApiLimits(stalled_s=0.5, requests_per_s=1e6)
    with served(limits) as here:
        here.loop.changes["reason"] = "x" * 50_000
        with _handshaken(here, receive=4096) as mad:
            ping = b"\x89\xfd\x00\x00\x00\x00" + b"p" * 125
            with pytest.raises((ConnectionResetError, BrokenPipeError)):
                while True:
                    mad.sendall(ping * 100)
        assert here.client.get(f"{API}/health").status_code == 200


def test_a_silent_loop_is_told_on_the_stream():
    limits = ApiLimits(silent_s=0.2, requests_per_s=1e6)
    with served(limits) as here, here.stream() as watching:
        here.loop.silent.set()
        assert "silent" in _complaint(watching)
        watching.send(DRIVE)
        assert "silent" in _complaint(watching)
        here.loop.silent.clear()
        assert _frame(watching)


def test_the_cause_of_a_fall_is_told():
    rows = list(_pushed_over())
    assert rows[-1].mode == Mode.STOPPED
    limits = ApiLimits(silent_s=60.0, requests_per_s=1e6)
    with served(limits) as here, here.stream() as watching:
        here.loop.silent.set()
        here.loop.tell(*rows)
        frame = here.until(lambda: _fallen(here, watching, rows[-1]))
        fall = here.client.get(f"{API}/fall").json()
    assert fall["sentence"] == frame["fall"]
    assert fall["sentence"].startswith("The robot fell at ")
    assert fall["cause"]["advice"] in fall["sentence"]
    assert fall["time_s"] == rows[-1].time_s


def test_a_fall_that_nobody_can_explain_is_told_all_the_same():
    robot = small_library().robot
    with served() as here:
        here.loop.tell(told(robot, 100.0, **FALLEN))
        here.until(lambda: here.client.get(f"{API}/fall").status_code == 200)
        fall = here.client.get(f"{API}/fall").json()
        assert fall["sentence"].startswith(
            "The robot fell: the trunk leans by 51 deg, limit 50."
        )
        assert fall["cause"] is None
        assert here.client.get(f"{API}/state").json()["fall"] is None


@pytest.mark.slow
def test_a_hundred_thousand_odd_messages_break_nothing(tmp_path):
    library, chance = small_library(), random.Random(5)
    loop, asker = FakeLoop(tmp_path, shared=True), Asker(tmp_path)
    settings = Settings(library="")
    service = make_service(settings, library, ApiLimits(), tmp_path, asker)
    service.feed.start()
    client = Client(service.hub, None, 25.0, "fuzz")
    answers = {"taken": 0, "refused": 0}
    try:
        for _ in range(100_000):
            complaint = client.take(_odd_message(chance))
            assert complaint is None or 0 < len(complaint) < 600
            if complaint is not None:
                complaint.encode()
            answers["taken" if complaint is None else "refused"] += 1
    finally:
        service.feed.close()
        asker.close()
        loop.close()
    assert min(answers.values()) > 1000
    span = library.command_range
    while not loop.asked.empty():
        request = loop.asked.get()
        if isinstance(request, Drive):
            asked = request.vx, request.vy, request.yaw_rate
            for value, (least, most) in zip(asked, span.ends, strict=True):
                assert least <= value <= most
        if isinstance(request, PushRobot):
            assert 0.0 < request.impulse_ns <= 62.0


def test_odd_messages_over_the_wire_break_nothing():
    limits = ApiLimits(
        messages_per_s=1e6,
        frames_per_s=1e6,
        bad_messages=10_000_000,
        requests_per_s=1e6,
    )
    with served(limits, shared=True) as here:
        with ThreadPoolExecutor(4) as workers:
            for done in [workers.submit(_send_odd, here, seed) for seed in range(4)]:
                done.result()
        assert here.client.get(f"{API}/state").status_code == 200


def test_clients_come_and_go_at_once(here):
    def come_and_go(_):
        with here.stream("hz=100") as watching:
            watching.recv(timeout=PATIENCE_S)

    with ThreadPoolExecutor(8) as workers:
        assert len(list(workers.map(come_and_go, range(60)))) == 60
    here.until(lambda: _health(here)["clients"] == 0)


def test_the_server_ends_while_clients_are_connected():
    before = set(threading.enumerate())
    with served() as here:
        watching = here.stream()
        stalled = _handshaken(here, receive=4096)
        watching.recv(timeout=PATIENCE_S)
    with watching, pytest.raises(ConnectionClosed):
        while True:
            watching.recv(timeout=PATIENCE_S)
    stalled.close()
    assert set(threading.enumerate()) <= before


def test_frames_are_made_once_for_all_clients(tmp_path):
    asker = Asker(tmp_path)
    service = make_service(
        Settings(library=""), small_library(), ApiLimits(), tmp_path, asker
    )
    service.feed.hear(told(small_library().robot))
    assert service.hub.frame() is service.hub.frame()
    asker.close()


def test_a_loop_that_is_yet_to_begin_is_not_said_to_be_restarted(tmp_path):
    asker = Asker(tmp_path)
    limits = ApiLimits(silent_s=0.0)
    service = make_service(
        Settings(library=""), small_library(), limits, tmp_path, asker
    )
    assert service.feed.latest is None
    assert service.feed.why_silent == LOOP_BEGINS
    service.feed.hear(told(small_library().robot))
    assert service.feed.why_silent == LOOP_SILENT
    asker.close()


class FakeHub:
    """A hub whose loop is silent, and a gateway that refuses to drive."""

    def __init__(self, limits):
        self.limits, self.acts, self.gateway, self.feed = limits, [], self, self
        self.why_silent = LOOP_SILENT

    def frame(self):
        return None

    def act(self, _, what):
        self.acts.append(what)

    def drive(self, *_):
        raise RefusedError(409, "another one drives")


class FakeSocket:
    """A client's connection: messages that came, and then its end."""

    def __init__(self, *texts, takes=True):
        """Take what came.

        Args:
            texts: messages.
            takes: whether what is sent to it is ever taken.
        """
        self._came = [{"type": "websocket.receive", "text": text} for text in texts]
        self._takes, self.sent, self.closed = takes, [], []
        self._done = asyncio.Event()

    async def serve(self, hub):
        """Serve it as one client."""
        await Client(hub, self, 25.0, "me").serve()

    async def accept(self):
        pass

    async def receive(self):
        if not self._came:
            await self._done.wait()
            return {"type": "websocket.disconnect"}
        return self._came.pop(0)

    async def send_text(self, text):
        if not self._takes:
            if not self._came:
                self._done.set()
            await asyncio.Event().wait()
        self.sent.append(text)
        self._done.set()

    async def close(self, *why):
        self.closed.append(why)


def _pushed_over():
    """Telemetry of a standing robot that is pushed over."""
    robot = small_library().robot
    stand = robot.legs.stand
    backend = MujocoBackend(robot)
    backend.connect(stand)
    backend.push(40.0, 90.0)
    for tick in range(1000):
        sensors, time_s = backend.read(), 100.0 + 0.01 * tick
        yield told(
            robot,
            time_s,
            joint_position=tuple(sensors.joint_position.tolist()),
            joint_velocity=tuple(sensors.joint_velocity.tolist()),
            joint_load=tuple(backend.loads().tolist()),
            truth=backend.truth(),
            **(FALLEN if backend.fallen else {}),
        )
        if backend.fallen:
            return
        backend.write(stand)


def _fallen(here, watching, last):
    here.loop.tell(last)  # again: a slow listener misses some, and a loop goes on
    frame = _frame(watching)
    known = frame["fall"] and "being looked for" not in frame["fall"]
    return frame if known else None


def _odd_message(chance):
    """A message that is nearly right, or not at all."""
    kind = chance.random()
    if kind < 0.15:
        return bytes(chance.randrange(256) for _ in range(chance.randrange(40)))
    if kind < 0.25:
        return "".join(chr(chance.randrange(1, 0xD7FF)) for _ in range(9))
    value = chance.choice(VALUES)
    kinds = ["drive", "steer", "push", "stop", "start", "let_go", "fly", 1]
    names = ["vx", "vy", "yaw_rate", "impulse_ns", "direction_deg", "type", "\ud800"]
    message = {"type": chance.choice([*kinds, "emergency_stop"])}
    for _ in range(chance.randrange(3)):
        message[chance.choice(names)] = value
    text = json.dumps(message)
    if kind > 0.8:
        at, mark = chance.randrange(len(text)), chance.choice('"}[\\\0,')
        text = f"{text[:at]}{mark}{text[at + 1 :]}"
    return text


def _send_odd(here, seed):
    chance = random.Random(seed)
    with here.stream(f"hz=1&driver=odd-{seed}") as client:
        for _ in range(1000):
            message = _odd_message(chance)
            client.send(message)
        client.send('{"type": "the last"}')
        while "the last" not in client.recv(timeout=PATIENCE_S):
            pass


def _health(here):
    return here.client.get(f"{API}/health").json()


def _complaint(client):
    return _received(client, "error")["detail"]


def _frame(client):
    return _received(client, "frame")


def _received(client, kind):
    deadline = Deadline()
    while (told := json.loads(client.recv(timeout=PATIENCE_S)))["type"] != kind:
        assert not deadline.passed(), f"no {kind}, but {told}"
    return told


def _closed_with(client):
    with pytest.raises(ConnectionClosed) as closed:
        while True:
            client.recv(timeout=PATIENCE_S)
    return closed.value.rcvd.code


def _drain(waiting):
    try:
        while True:
            waiting.get_nowait()
    except queue.Empty:
        return


def _handshaken(here, receive):
    """A telemetry socket of which nobody reads anything but the handshake."""
    raw = socket.socket()
    raw.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive)
    raw.settimeout(PATIENCE_S)
    raw.connect(("127.0.0.1", here.port))
    head = (
        f"GET {API}/stream?hz=100 HTTP/1.1\r\nHost: 127.0.0.1:{here.port}\r\n"
        f"Authorization: Bearer {TOKEN}\r\nUpgrade: websocket\r\n"
        "Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
    )
    raw.sendall(head.encode())
    assert raw.recv(12) == b"HTTP/1.1 101"
    return raw


def _read_to_the_end(raw):
    try:
        while raw.recv(65536):
            pass
    except ConnectionResetError:
        pass
