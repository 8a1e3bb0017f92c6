"""The 3-D view's own port lets in who knows its secret, and nobody else."""

import httpx
import pytest
from patience import PATIENCE_S
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from gaitchain.service.viewer_gate import HEADER, gated
from gaitchain.sim.scene_meshes import local_server

SECRET = "known to the proxy alone"


@pytest.fixture(scope="module")
def port():
    with gated(SECRET), local_server() as server:
        yield server.get_port()


def asked(port, headers):
    return httpx.get(
        f"http://127.0.0.1:{port}/",
        headers=headers,
        timeout=PATIENCE_S,
        trust_env=False,
    )


@pytest.mark.parametrize("headers", [{}, {HEADER: ""}, {HEADER: "another one"}])
def test_a_stranger_sees_nothing(port, headers):
    answer = asked(port, headers)
    assert (answer.status_code, answer.content) == (403, b"")
    with pytest.raises(InvalidStatus, match="403"):
        connect(
            f"ws://127.0.0.1:{port}/",
            origin="http://evil.example",
            additional_headers=headers,
            open_timeout=PATIENCE_S,
            proxy=None,
        )


def test_the_proxy_is_let_in(port):
    assert asked(port, {HEADER: SECRET}).status_code == 200
    with connect(
        f"ws://127.0.0.1:{port}/",
        additional_headers={HEADER: SECRET},
        open_timeout=PATIENCE_S,
        close_timeout=PATIENCE_S,
        proxy=None,
    ):
        pass
