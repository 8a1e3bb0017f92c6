"""The 3-D view behind the API's port: what is passed on, and what is not."""

import http
import socket
import threading
from contextlib import contextmanager

import httpx
import pytest
from api_server import PATIENCE_S, TOKEN, served
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.http11 import Response
from websockets.sync.server import serve

from gaitchain.service.api_limits import ApiLimits
from gaitchain.service.auth import COOKIE

PROTOCOL = "viser-v9"
PAGE = b"<script>a view</script>" * 40_000


class View:
    """A server of files and sockets, as the 3-D view's."""

    def __init__(self):
        self.asked = []
        self.flooded = threading.Event()
        self._server = serve(
            self._talk,
            "127.0.0.1",
            0,
            process_request=self._answer,
            select_subprotocol=lambda _, names: PROTOCOL if PROTOCOL in names else None,
            max_size=None,
        )
        self.port = self._server.socket.getsockname()[1]
        self._thread = threading.Thread(target=self._server.serve_forever)
        self._thread.start()

    def close(self):
        self._server.shutdown()
        self._thread.join()

    def _answer(self, _, request):
        self.asked.append(request)
        if request.headers.get("Upgrade") == "websocket":
            return None
        status, body = http.HTTPStatus.OK, PAGE
        if request.path == "/gone":
            status, body = http.HTTPStatus.NOT_FOUND, b"NOT FOUND"
        headers = Headers(
            {
                "Content-Type": "text/html; charset=utf-8",
                "Content-Length": str(len(body)),
                "Set-Cookie": "view=1",
                "Content-Security-Policy": "none",
                "X-Odd": "1",
            }
        )
        return Response(status, status.phrase, headers, body)

    def _talk(self, connection):
        connection.send(connection.subprotocol or "none")
        for message in connection:
            if message == "close":
                return
            if message == "refuse":
                connection.close(1002, "another version of the view")
                return
            if message == "die":
                connection.socket.shutdown(socket.SHUT_RDWR)
                return
            if message == "flood":
                try:
                    while True:
                        connection.send(b"\0" * 100_000)
                except ConnectionClosed:
                    self.flooded.set()
                    return
            connection.send(message)


@contextmanager
def viewed(limits=None, **settings):
    """A view, and the API before it."""
    view = View()
    try:
        limits = limits or ApiLimits(requests_per_s=1e6)
        with served(limits, viewer_port=view.port, live=False, **settings) as here:
            yield view, here
    finally:
        view.close()


@pytest.fixture(scope="module")
def pair():
    with viewed() as both:
        yield both


@pytest.mark.parametrize(
    ("path", "asked"),
    [
        ("/viewer", "/"),
        ("/viewer/", "/"),
        ("/viewer/a/b.js", "/a/b.js"),
        ("/viewer//elsewhere.example/", "//elsewhere.example/"),
        ("/viewer/%3Fa", "/%3Fa"),
        ("/viewer/%2e%2e/%2e%2e/x", "/x"),
    ],
)
def test_files_come_through(pair, path, asked):
    view, here = pair
    view.asked.clear()
    answer = here.client.get(path)
    assert answer.status_code == 200
    assert answer.content == PAGE
    assert answer.headers["content-type"] == "text/html; charset=utf-8"
    assert len(view.asked) == 1
    assert view.asked[0].path == asked


def test_neither_tokens_nor_cookies_go_to_the_view_or_come_from_it(pair):
    view, here = pair
    view.asked.clear()
    headers = {"Cookie": f"{COOKIE}=1; other=2", "X-Odd": "1", "Accept-Language": "en"}
    answer = here.client.get("/viewer/", headers=headers)
    with here.socket("/viewer", headers=headers.items()) as talking:
        talking.recv(timeout=PATIENCE_S)
    for request in view.asked:
        text = str(request.headers).lower()
        for hidden in ("cookie", "authorization", TOKEN, "x-odd", "x-forwarded"):
            assert hidden not in text
    assert view.asked[0].headers["accept-language"] == "en"
    assert view.asked[0].headers["host"] == f"127.0.0.1:{view.port}"
    assert "set-cookie" not in answer.headers
    assert "x-odd" not in answer.headers
    assert "wasm-unsafe-eval" in answer.headers["content-security-policy"]


def test_a_header_that_is_not_ascii_goes_to_the_view_as_it_came(pair):
    view, here = pair
    view.asked.clear()
    for odd in (b"\xe9", "ä, €".encode()):
        answer = here.client.get("/viewer/", headers={b"Accept-Language": odd})
        assert answer.status_code == 200
        asked = view.asked.pop().headers["accept-language"]
        assert asked.encode("ascii", "surrogateescape") == odd


def test_what_the_view_refuses_is_refused(pair):
    _, here = pair
    answer = here.client.get("/viewer/gone")
    assert (answer.status_code, answer.content) == (404, b"NOT FOUND")
    assert here.client.post("/viewer/").status_code == 405


@pytest.mark.parametrize("path", ["/viewer", "/viewer/", "/viewer/any"])
def test_messages_go_both_ways(pair, path):
    _, here = pair
    with here.socket(path, subprotocols=["other", PROTOCOL]) as talking:
        assert talking.subprotocol == PROTOCOL
        assert talking.recv(timeout=PATIENCE_S) == PROTOCOL
        for message in ("text", b"\0\1", "ä" * 9999, b""):
            talking.send(message)
            assert talking.recv(timeout=PATIENCE_S) == message


def test_a_socket_without_a_protocol_is_passed_on(pair):
    _, here = pair
    with here.socket("/viewer") as talking:
        assert talking.subprotocol is None
        assert talking.recv(timeout=PATIENCE_S) == "none"
        talking.send("close")
        with pytest.raises(ConnectionClosed) as closed:
            talking.recv(timeout=PATIENCE_S)
    assert closed.value.rcvd.code == 1012


def test_why_the_view_takes_a_client_no_more_is_passed_on(pair):
    _, here = pair
    with here.socket("/viewer") as talking:
        talking.recv(timeout=PATIENCE_S)
        talking.send("refuse")
        with pytest.raises(ConnectionClosed) as closed:
            talking.recv(timeout=PATIENCE_S)
    told = closed.value.rcvd
    assert (told.code, told.reason) == (1002, "another version of the view")


@pytest.mark.parametrize("given", [{}, {"Accept-Encoding": "gzip"}])
def test_a_file_is_packed_only_for_who_takes_that(pair, given):
    view, here = pair
    view.asked.clear()
    request = here.client.build_request("GET", "/viewer/")
    del request.headers["accept-encoding"]  # httpx's own
    request.headers.update(given)
    assert here.client.send(request).content == PAGE
    assert view.asked[0].headers["accept-encoding"] == (
        given.get("Accept-Encoding", "identity")
    )


def test_a_stranger_reaches_no_view(pair):
    view, here = pair
    view.asked.clear()
    for path in ("/viewer", "/viewer/", "/viewer/a.js"):
        answer = httpx.get(here.client.base_url.join(path), trust_env=False)
        assert answer.status_code == 401
        for headers, status in (({}, 401), ({"Origin": "http://evil.example"}, 401)):
            with pytest.raises(InvalidStatus) as refused:
                here.socket(path, token="", headers=headers.items())
            assert refused.value.response.status_code == status
        with pytest.raises(InvalidStatus) as refused:
            here.socket(path, headers=[("Origin", "http://evil.example")])
        assert refused.value.response.status_code == 403
    assert not view.asked


@pytest.mark.parametrize("path", ["a" * 3000, "a" * 12_000, "%C3%A4" * 2000])
def test_a_path_that_no_file_of_the_view_has_is_refused(path):
    with viewed() as (view, here):
        answer = here.client.get(f"/viewer/{path}")
        assert answer.status_code == 414
        assert "2048 characters" in answer.json()["detail"]
        assert not view.asked


def test_a_view_that_is_down_is_said(caplog):
    with socket.socket() as nobody:
        nobody.bind(("127.0.0.1", 0))
        down = nobody.getsockname()[1]
        for port in (0, down):
            with served(viewer_port=port, live=False) as here:
                answer = here.client.get("/viewer/")
                assert answer.status_code == 503
                assert "3-D view" in answer.json()["detail"]
                assert answer.headers["refresh"] == "2", "the page's frame asks again"
                with pytest.raises(InvalidStatus) as refused:
                    here.socket("/viewer")
                assert refused.value.response.status_code == 503
    assert not _said(caplog)


def test_a_view_that_dies_closes_its_sockets(caplog):
    with viewed() as (view, here):
        with here.socket("/viewer") as talking:
            talking.recv(timeout=PATIENCE_S)
            view.close()
            talking.send("die")
            with pytest.raises(ConnectionClosed):
                talking.recv(timeout=PATIENCE_S)
        assert here.client.get("/viewer/").status_code == 503
        assert here.client.get("/api/v1/fall").status_code == 404
    assert not _said(caplog)


def test_one_viewer_too_many_is_refused():
    limits = ApiLimits(viewers=1, requests_per_s=1e6)
    with viewed(limits) as (_, here):
        with here.socket("/viewer") as one:
            one.recv(timeout=PATIENCE_S)
            assert here.client.get("/api/v1/health").json()["viewers"] == 1
            with pytest.raises(InvalidStatus) as refused:
                here.socket("/viewer")
            assert refused.value.response.status_code == 503
        here.until(lambda: here.client.get("/api/v1/health").json()["viewers"] == 0)
        with here.socket("/viewer") as another:
            another.recv(timeout=PATIENCE_S)


@pytest.mark.slow
def test_a_viewer_that_does_not_read_is_closed_and_not_buffered(caplog):
    limits = ApiLimits(stalled_s=0.5, requests_per_s=1e6)
    with viewed(limits) as (view, here):
        with here.socket("/viewer", max_queue=1, close_timeout=1) as stalled:
            stalled.recv(timeout=PATIENCE_S)
            stalled.send("flood")
            assert view.flooded.wait(PATIENCE_S), "its view was let go"
        here.until(lambda: here.client.get("/api/v1/health").json()["viewers"] == 0)
    assert not _said(caplog)


def _said(caplog):
    """What was logged, but for the view's own server."""
    return [r for r in caplog.records if r.name != "websockets.server"]
