"""Floods of what no app ever sees, with and without a token, and stops between them."""

import asyncio
import json
import select
import socket
import subprocess
import sys
from contextlib import ExitStack, suppress

import h11
import pytest
from api_server import API, PATIENCE_S, TOKEN, nothing_asked, served
from patience import Deadline

from gaitchain.live.messages import EmergencyStop
from gaitchain.service.api_limits import ApiLimits
from gaitchain.service.api_transport import listen, server_of

FLOODERS = 20
TURN_BYTES = 4096  # a few ms, whatever is in them
MASK = bytes(4)
TEXT, MORE, PING, PONG, CLOSE = b"\x81", b"\x00", b"\x89", b"\x8a", b"\x88"
BEGUN = b"\x01\x80" + MASK  # a message that is not over
FRAMES = {
    "pings": PING + b"\x80" + MASK,
    "pongs": PONG + b"\x80" + MASK,
    "fragments": MORE + b"\x80" + MASK,
}
CHUNKED = "Transfer-Encoding: chunked\r\nContent-Type: application/json\r\n\r\n"


def limits(**others):
    return ApiLimits(**{"stalled_s": 0.5, "requests_per_s": 1e6, **others})


@pytest.fixture(scope="module")
def here():
    with served(limits()) as server:
        yield server


def head(method, path, token=TOKEN, more=""):
    """The line and headers of a request, but not their end."""
    known = f"Authorization: Bearer {token}\r\n" if token else ""
    return f"{method} {path} HTTP/1.1\r\nHost: localhost\r\n{known}{more}"


def connected(here):
    return socket.create_connection(("127.0.0.1", here.port), PATIENCE_S)


def upgraded(here, path=f"{API}/stream?hz=1", more=""):
    """A socket that was asked for."""
    raw = connected(here)
    asked = (
        "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
    )
    raw.sendall((head("GET", path, more=asked + more) + "\r\n").encode())
    return raw


def pour(raw, data):
    """Send without end, and read, until hung up on; return the end of what came."""
    came = b""
    raw.setblocking(False)
    deadline = Deadline()
    while not deadline.passed():
        readable, writable, _ = select.select([raw], [raw], [], PATIENCE_S)
        with suppress(BlockingIOError):
            try:
                if writable:
                    raw.send(data)
            except ConnectionError:
                return came
            try:
                if readable and not (new := raw.recv(65536)):
                    return came
            except ConnectionError:
                return came
            if readable:
                came = (came + new)[-200:]
    raise AssertionError("nobody hung up")


@pytest.mark.parametrize("kind", FRAMES)
def test_a_socket_that_floods_with_what_is_no_message_is_closed(here, kind):
    with upgraded(here) as mad:
        assert mad.recv(12) == b"HTTP/1.1 101"
        mad.sendall(BEGUN)
        came = pour(mad, FRAMES[kind] * 1000)
    assert b"\x03\xf0more than 400 frames a second" in came, "1008, and why"
    assert here.client.get(f"{API}/health").status_code == 200


@pytest.mark.parametrize(
    "sent",
    [
        (head("GET", "/x", token=""), "a:b\r\n" * 1000),
        (head("PUT", f"{API}/command", more=CHUNKED), "1\r\n \r\n" * 1000),
        (head("POST", f"{API}/stop", more=CHUNKED), "1\r\n \r\n" * 1000),
        (head("GET", "/x", token="", more=CHUNKED), "1\r\n \r\n" * 1000),
    ],
)
def test_a_request_that_floods_with_lines_is_hung_up_on(here, sent):
    with connected(here) as mad:
        mad.sendall(sent[0].encode())
        pour(mad, sent[1].encode())
    assert here.client.get(f"{API}/health").status_code == 200


def test_a_head_that_is_too_large_is_refused(here):
    with connected(here) as mad:
        mad.sendall((head("GET", "/x") + "a: " + "b" * 20_000).encode())
        assert mad.recv(12) == b"HTTP/1.1 400"


@pytest.mark.parametrize("odd", ["a: b\r\n" * 200, f"a: {'b' * 9000}\r\n"])
def test_a_head_that_only_http_allows_opens_no_socket(here, odd):
    with upgraded(here, more=odd) as mad, suppress(ConnectionResetError):
        assert mad.recv(1000) == b""


def test_a_body_of_many_lines_is_no_flood(here):
    body = "\n" * 5000 + json.dumps({"vx": 0.01})
    kind = {"Content-Type": "application/json"}
    for _ in range(3):
        answer = here.client.put(f"{API}/command", content=body, headers=kind)
        assert answer.status_code == 202
    parts = iter([b" \n" * 20] * 20 + [b'{"vx": 0}'])  # which httpx sends as chunks
    answer = here.client.put(f"{API}/command", content=parts, headers=kind)
    assert answer.status_code in (202, 409)
    here.client.delete(f"{API}/driver")


def test_who_asks_too_often_is_answered_late_and_the_stop_at_once():
    with served(limits(requests_per_s=1, refused_s=1e4), live=False) as here:
        asked = (head("GET", f"{API}/health") + "\r\n").encode()
        with connected(here) as first, connected(here) as mad:
            first.sendall(asked)
            assert first.recv(12) == b"HTTP/1.1 503"  # it tells nothing yet
            mad.sendall(asked)
            for _ in range(10):
                stopped = here.client.post(f"{API}/emergency-stop")
                assert stopped.status_code == 202
            assert not select.select([mad], [], [], 0)[0]


def test_connections_whose_requests_wait_shut_no_stop_out():
    few = limits(connections=8, requests_per_s=1, refused_s=1e4, request_s=1e4)
    with served(few) as here, ExitStack() as stack:
        for _ in range(40):
            mad = stack.enter_context(connected(here))
            with suppress(OSError):
                mad.sendall((head("GET", "/x", token="") + "\r\n").encode())
        stopped = here.client.post(f"{API}/emergency-stop")
        assert stopped.status_code == 202
        here.loop.until_asked(EmergencyStop)


BROKEN = CHUNKED + "zz\r\n"


@pytest.mark.parametrize(
    ("method", "path", "token", "status"),
    [
        ("GET", "/x", "", 401),
        ("GET", f"{API}/state", TOKEN, 200),
        ("PUT", f"{API}/command", TOKEN, 400),
        ("PUT", f"{API}/command", "", 401),
        ("POST", f"{API}/emergency-stop", TOKEN, 202),
    ],
)
def test_a_body_that_is_no_http_is_answered_by_what_was_done(
    here, caplog, method, path, token, status
):
    with connected(here) as mad:
        mad.sendall((head(method, path, token) + BROKEN).encode())
        assert mad.recv(12).decode() == f"HTTP/1.1 {status}"
        with suppress(ConnectionResetError):
            while mad.recv(65536):
                pass
    if status == 202:
        here.loop.until_asked(EmergencyStop)
    assert not caplog.records


def test_a_body_that_ends_badly_after_its_answer_is_hung_up_on(here, caplog):
    with connected(here) as mad:
        mad.sendall((head("GET", "/x", "") + CHUNKED).encode())
        assert mad.recv(12) == b"HTTP/1.1 401"
        pour(mad, b"zz\r\n")
    assert not caplog.records


@pytest.mark.parametrize("begun", [b"", BEGUN])
def test_text_that_is_not_utf_8_closes_its_socket_and_logs_nothing(here, caplog, begun):
    kind = b"\x80" if begun else TEXT
    with upgraded(here) as mad:
        assert mad.recv(12) == b"HTTP/1.1 101"
        mad.sendall(begun + kind + b"\x82" + MASK + b"\xff\xfe")
        came = b""
        with suppress(ConnectionResetError):
            while new := mad.recv(65536):
                came = (came + new)[-200:]
    assert b"\x03\xeftext that is not UTF-8" in came, "1007, and why"
    assert here.client.get(f"{API}/health").status_code == 200
    assert not caplog.records


def test_a_frame_that_is_none_on_a_socket_not_let_in_logs_nothing(here, caplog):
    for _ in range(20):
        with upgraded(here, "/no/such/path") as mad, suppress(OSError):
            mad.sendall(b"\xff\xff" * 100)
            while mad.recv(65536):
                pass
    assert here.client.get(f"{API}/health").status_code == 200
    assert not caplog.records


def test_what_makes_errors_fills_no_log():
    program = (
        "import logging; from gaitchain.service.part import _log\n"
        "logging.basicConfig(handlers=[_log()])\n"
        "for _ in range(1000): logging.error('again')"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert 0 < done.stderr.count("again") < 500


async def in_a_server(task):
    """Serve nothing, while a task is done with the server and its port."""
    server = server_of(nothing_asked, ApiLimits())
    with listen("127.0.0.1", 0) as listening:
        serving = asyncio.create_task(server.serve(sockets=[listening]))
        deadline = Deadline()
        while not server.started:
            await asyncio.sleep(0)
            assert not deadline.passed()
        found = await task(server, listening.getsockname()[1])
        server.should_exit = True
        await serving
    return found


def test_a_turn_of_the_loop_reads_little_of_each_connection(monkeypatch):
    read, most = [0], [0]
    receive = h11.Connection.receive_data

    def counted(self, data):
        read[0] += len(data)
        most[0] = max(most[0], read[0])
        return receive(self, data)

    async def flooded(server, port):
        with ExitStack() as stack:
            for _ in range(FLOODERS):
                mad = socket.create_connection(("127.0.0.1", port), PATIENCE_S)
                stack.enter_context(mad).setblocking(False)
                mad.send(b"GET / HTTP/1.1\r\n" + b"a: b\r\n" * 10_000)
            deadline = Deadline()
            while most[0] < 1000 or len(server.server_state.connections) < FLOODERS:
                read[0] = 0
                await asyncio.sleep(0)
                assert not deadline.passed()
            return most[0]

    monkeypatch.setattr(h11.Connection, "receive_data", counted)
    assert 0 < asyncio.run(in_a_server(flooded)) <= FLOODERS * TURN_BYTES


def test_many_connections_may_wait_to_be_accepted():
    """Else the system drops them, and a stop is tried again a second later."""

    async def connecting(_, port):
        with ExitStack() as stack:
            waiting = set()
            for _ in range(200):
                client = stack.enter_context(socket.socket())
                client.setblocking(False)
                client.connect_ex(("127.0.0.1", port))
                waiting.add(client)
            deadline = Deadline()
            while waiting and not deadline.passed():  # the server's loop stands still
                for client in select.select([], waiting, [], 1.0)[1]:
                    assert client.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR) == 0
                    waiting.remove(client)
            return len(waiting)

    assert asyncio.run(in_a_server(connecting)) == 0
