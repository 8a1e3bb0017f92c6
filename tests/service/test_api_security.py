"""Who is let in: tokens, Host and Origin, on every route, socket and file."""

import json
import select
import signal
import socket
import subprocess
import sys
from contextlib import contextmanager
from urllib.parse import quote

import httpx
import pytest
from api_server import API, PATIENCE_S, TOKEN, served, small_library
from patience import Deadline
from starlette.routing import Mount, Route, WebSocketRoute
from websockets.exceptions import InvalidStatus

from gaitchain.gait.library_file import save_library
from gaitchain.service.auth import COOKIE, cookie_of, same_secret
from gaitchain.service.settings import Settings, load_settings, save_settings

STRANGERS = [
    {},
    {"Authorization": "Bearer wrong"},
    {"Authorization": "Bearer"},
    {"Authorization": f"Bearer {TOKEN}x"},
    {"Authorization": f"Bearer {TOKEN[:-1]}"},
    {"Authorization": f"Basic {TOKEN}"},
    {"Authorization": TOKEN},
    {"Authorization": "Bearer \xff"},
    {"Cookie": f"{COOKIE}={quote(TOKEN, safe='')}"},  # of no server's port
    {"Cookie": f"{COOKIE}=wrong"},
    {"Cookie": f"{COOKIE}="},
    {"Cookie": f"other={TOKEN}"},
]
ELSEWHERE = [
    "http://evil.example",
    "null",
    "",
    "http://127.0.0.1:1",
    "http://127.0.0.1",
    "http://127.0.0.1:{port}.evil.example",
    "ftp://127.0.0.1:{port}",
    "http://localhost:{port}",
    "http://127.0.0.1:{port}/",
]
FOREIGN = ["evil.example", "127.0.0.1.evil.example:{port}", "localhost.evil", "[::2]"]
FOREIGN += ["0.0.0.0", "192.168.1.7:{port}", "robot.local", "[", "@127.0.0.1", "a:b:c"]


@pytest.fixture(scope="module")
def here():
    with served() as server:
        yield server


@pytest.fixture(scope="module")
def stranger(here):
    with httpx.Client(base_url=here.client.base_url, trust_env=False) as client:
        yield client


def test_every_route_refuses_strangers(here, stranger, caplog):
    routes = list(_routes(here.app))
    assert len(routes) >= 24
    assert {("WS", f"{API}/stream"), ("GET", "/viewer/x"), ("GET", "/page/x")} <= set(
        routes
    )
    for method, path in [*routes, ("GET", "/no/such/route"), ("GET", "/page/main.js")]:
        for headers in STRANGERS:
            if method == "WS":
                status = _refused(here, path, headers)
            else:
                status = stranger.request(
                    method, path, headers=_bytes(headers), json={"token": "wrong"}
                ).status_code
            assert status == 401, (method, path, headers)
    assert not caplog.records, "strangers fill no log"


def test_no_socket_opens_on_a_path_without_one(here):
    for path in ("/", f"{API}/state", "/page/main.js", "/nothing"):
        with pytest.raises(InvalidStatus):
            here.socket(path)


def test_every_route_refuses_what_other_sites_send(here):
    for method, path in _routes(here.app):
        for pattern in ELSEWHERE:
            headers = {"Origin": pattern.format(port=here.port)}
            if method == "WS":
                status = _refused(here, path, headers, token=TOKEN)
            elif method in ("GET", "HEAD"):
                continue  # no answer says that other sites may read it
            else:
                answer = here.client.request(method, path, headers=headers, json={})
                status = answer.status_code
            assert status == 403, (method, path, headers)


def test_no_other_site_may_read_an_answer(here):
    headers = {"Origin": "http://evil.example"}
    for path in (f"{API}/state", "/", "/page/main.js"):
        answer = here.client.get(path, headers=headers)
        assert not [name for name in answer.headers if "access-control" in name]
    asked = {**headers, "Access-Control-Request-Method": "PUT"}
    answer = here.client.options(f"{API}/command", headers=asked)
    assert answer.status_code == 405
    assert not [name for name in answer.headers if "access-control" in name]


def test_this_site_may_send(here):
    origin = {"Origin": f"http://127.0.0.1:{here.port}"}
    assert here.client.post(f"{API}/stop", headers=origin).status_code == 202
    with here.stream(headers=origin.items()) as watching:
        assert watching.recv(timeout=PATIENCE_S)
    behind_tls = {"Origin": f"https://127.0.0.1:{here.port}"}
    assert here.client.post(f"{API}/stop", headers=behind_tls).status_code == 202


def test_every_route_refuses_another_name_of_this_computer(here):
    for method, path in _routes(here.app):
        if method == "WS":
            continue
        headers = {"Host": "evil.example"}
        answer = here.client.request(method, path, headers=headers, json={})
        assert answer.status_code == 403, (method, path)
    for pattern in FOREIGN:
        host = pattern.format(port=here.port)
        answer = here.client.get(f"{API}/state", headers={"Host": host})
        assert answer.status_code == 403, host
        assert _status_of_upgrade(here, host) == b"403", host


def test_the_names_of_loopback_are_let_in(here):
    for host in ("localhost", "LOCALHOST:99", "127.0.0.1", "127.3.2.1", "[::1]:8700"):
        answer = here.client.get(f"{API}/state", headers={"Host": host})
        assert answer.status_code == 200, host


def test_the_name_that_is_served_is_let_in():
    with served(host="Robot.example") as here:
        for host, status in (("robot.example:80", 200), ("robot2.example", 403)):
            answer = here.client.get(f"{API}/state", headers={"Host": host})
            assert answer.status_code == status, host


def test_on_all_addresses_numbers_and_the_own_name_are_let_in():
    own = socket.gethostname()
    with served(host="0.0.0.0") as here:
        for host, status in (
            ("192.168.1.7:8700", 200),
            ("[fe80::1]", 200),
            (own, 200),
            (f"{own}.local:1", 200),
            ("evil.example", 403),
            ("192.168.1.7.evil.example", 403),
        ):
            answer = here.client.get(f"{API}/state", headers={"Host": host})
            assert answer.status_code == status, host


def test_a_browser_signs_in_by_its_address(here, stranger):
    for wrong in ("", "wrong", TOKEN.lower() + "x"):
        refused = stranger.get("/", params={"token": wrong})
        assert refused.status_code == 303
        assert "set-cookie" not in refused.headers
        assert "token=" not in refused.headers["location"]
        form = stranger.get(refused.headers["location"])
        assert form.status_code == 401
        assert '<p role="alert">This token is wrong.' in form.text
    with _fresh(here) as browser:
        answer = browser.get("/", params={"token": TOKEN})
        assert (answer.status_code, answer.headers["location"]) == (303, "/")
        _check_cookie(answer.headers["set-cookie"], here.port)
        assert browser.get("/").status_code == 200
        assert browser.get(f"{API}/state").status_code == 200
        name = cookie_of(here.port)
        value = browser.cookies[name]
    cookie = [("Cookie", f"{name}={value}")]
    with here.socket(f"{API}/stream", token="", headers=cookie) as watching:
        assert watching.recv(timeout=PATIENCE_S)


@pytest.mark.parametrize("params", [{}, {"token": TOKEN}, {"token": "wrong"}])
@pytest.mark.parametrize("known", [{}, {"Authorization": f"Bearer {TOKEN}"}])
def test_who_asks_for_the_head_of_the_page_alone_gets_that(here, known, params):
    heads, wholes = _fresh(here), _fresh(here)  # neither has the other's cookie
    with heads, wholes:
        head = heads.head("/", params=params, headers=known)
        whole = wholes.get("/", params=params, headers=known)
    assert (head.status_code, head.content) == (whole.status_code, b"")
    for name in ("content-length", "content-type", "location", "cache-control"):
        assert head.headers.get(name) == whole.headers.get(name)


def test_a_browser_signs_in_and_out_by_session(here, stranger):
    wrong = stranger.post(f"{API}/session", json={"token": "wrong"})
    assert wrong.status_code == 401
    assert "set-cookie" not in wrong.headers
    for odd in ({}, {"token": 3}, {"token": "x" * 300}, {"token": "a", "b": 1}, []):
        assert stranger.post(f"{API}/session", json=odd).status_code == 422
    with _fresh(here) as browser:
        answer = browser.post(f"{API}/session", json={"token": TOKEN})
        assert answer.status_code == 204
        _check_cookie(answer.headers["set-cookie"], here.port)
        assert browser.get(f"{API}/state").status_code == 200
        out = browser.delete(f"{API}/session")
        assert out.status_code == 204
        assert "Max-Age=0" in out.headers["set-cookie"]
        assert browser.get(f"{API}/state").status_code == 401


def test_a_stranger_gets_a_form_instead_of_the_page(stranger):
    answer = stranger.get("/")
    assert answer.status_code == 401
    assert answer.headers["content-type"].startswith("text/html")
    assert 'type="password"' in answer.text
    assert "<script" not in answer.text
    assert "alert" not in answer.text
    assert answer.headers["www-authenticate"] == "Bearer"
    assert answer.headers["cache-control"] == "no-store"


def test_without_a_token_only_names_and_origins_count():
    with served(token="") as here, _fresh(here) as anybody:
        assert anybody.get(f"{API}/state").status_code == 200
        assert anybody.get("/").status_code == 200
        assert anybody.post(f"{API}/session", json={"token": "x"}).status_code == 204
        signed = anybody.get("/", params={"token": "x"})
        assert signed.status_code == 303
        assert "set-cookie" not in signed.headers
        evil = {"Origin": "http://evil.example"}
        assert anybody.post(f"{API}/stop", headers=evil).status_code == 403
        assert _refused(here, f"{API}/stream", evil) == 403


def test_secrets_are_compared_whole():
    assert same_secret("ä\ud800", "ä\ud800")
    assert not same_secret("", "a")
    assert not same_secret("a", "ab")


@pytest.mark.slow
def test_the_part_serves_until_it_is_told_to_end_and_logs_no_token(tmp_path):
    with _part(tmp_path / "one") as one, _part(tmp_path / "other") as other:
        _use(one, tmp_path / "one")
        one.send_signal(signal.SIGTERM)
        _use(other, tmp_path / "other")
        other.stdin.close()
        for part in (one, other):
            assert part.wait(PATIENCE_S) == 0
            assert (part.stdout.read(), part.stderr.read()) == (b"", b"")


@contextmanager
def _part(folder):
    """The API as the supervisor starts it."""
    folder.mkdir()
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    save_library(small_library(), folder / "small.gait")
    settings = Settings(library=str(folder / "small.gait"), port=port, token=TOKEN)
    save_settings(settings, folder)
    part = subprocess.Popen(
        [sys.executable, "-m", "gaitchain.service.part", "api", str(folder)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    try:
        with part:
            yield part
    finally:
        part.kill()  # no harm if it has ended


def _use(part, folder):
    """Ask a part for this and that, once it answers."""
    base_url = f"http://127.0.0.1:{load_settings(folder).port}"
    deadline = Deadline()
    with httpx.Client(base_url=base_url, trust_env=False) as new:
        while not _answers(new):
            assert part.poll() is None
            assert not deadline.passed()
            select.select([part.stderr], [], [], 0.05)
        wrong = new.get("/", params={"token": "wrong"}, follow_redirects=True)
        assert wrong.status_code == 401
        assert new.get("/", params={"token": TOKEN}).status_code == 303
        assert new.get(f"{API}/state").status_code == 503
        assert new.get("/viewer/").status_code == 503


def _answers(client):
    try:
        return client.get("/").status_code == 401
    except httpx.TransportError:
        return False


def _routes(app):
    """(method, path) of every route, socket and mounted folder of an app."""
    for route in app.routes:
        if isinstance(route, Mount):
            yield "GET", f"{route.path}/x"
        elif isinstance(route, WebSocketRoute):
            yield "WS", route.path.replace("{path:path}", "x")
        elif isinstance(route, Route):
            for method in route.methods:
                yield method, route.path.replace("{path:path}", "x")
        else:
            assert isinstance(getattr(route, "path", None), str), route
            methods = getattr(route, "methods", None) or {"WS"}
            for method in methods:
                yield method, route.path.replace("{path:path}", "x")


def _refused(here, path, headers, token=""):
    """The status with which a socket is refused."""
    with pytest.raises(InvalidStatus) as refused:
        here.socket(path, token=token, headers=headers.items())
    detail = json.loads(refused.value.response.body or b"{}")
    assert detail["detail"]
    return refused.value.response.status_code


def _status_of_upgrade(here, host):
    with socket.create_connection(("127.0.0.1", here.port), PATIENCE_S) as raw:
        head = (
            f"GET {API}/stream HTTP/1.1\r\nHost: {host}\r\nUpgrade: websocket\r\n"
            f"Authorization: Bearer {TOKEN}\r\nConnection: Upgrade\r\n"
            "Sec-WebSocket-Version: 13\r\n"
            "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
        )
        raw.sendall(head.encode())
        return raw.recv(12)[-3:]


def _check_cookie(header, port):
    cookie, *flags = header.split("; ")
    assert cookie.startswith(f"{cookie_of(port)}=")  # servers side by side differ
    assert " " not in cookie
    assert {flag.lower() for flag in flags} == {"httponly", "path=/", "samesite=strict"}


def _bytes(headers):
    return {name: value.encode("latin-1") for name, value in headers.items()}


def _fresh(here):
    return httpx.Client(
        base_url=here.client.base_url, trust_env=False, timeout=PATIENCE_S
    )
