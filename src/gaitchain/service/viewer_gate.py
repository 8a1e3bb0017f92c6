"""A secret that the 3-D view's own port asks for, so that only the proxy is let in.

viser takes no such thing, and answers whoever reaches its port: any page in a browser
of this computer could open its socket, as browsers let sockets go anywhere.
"""

import hmac
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http import HTTPStatus
from typing import Any

import websockets.asyncio.server as websockets_server
from websockets import Headers
from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

HEADER = "X-Gaitchain-View"
"""Header that has to hold the secret."""
_Process = Callable[[ServerConnection, Request], Any]


@contextmanager
def gated(secret: str) -> Iterator[None]:
    """Let servers that begin within ask for a secret; for the process of the view.

    Args:
        secret: that each request has to bring; empty for none.
    """
    serve = websockets_server.serve
    if not secret:
        yield
        return

    def gated_serve(*args: Any, **options: Any) -> Any:
        options["process_request"] = _asking(secret, options.get("process_request"))
        return serve(*args, **options)

    websockets_server.serve = gated_serve  # type: ignore[assignment,misc]
    try:
        yield
    finally:
        websockets_server.serve = serve  # type: ignore[misc]


def _asking(secret: str, process: _Process | None) -> _Process:
    def process_request(connection: ServerConnection, request: Request) -> Any:
        brought = request.headers.get_all(HEADER)
        known = [hmac.compare_digest(b.encode(), secret.encode()) for b in brought]
        if known != [True]:
            status = HTTPStatus.FORBIDDEN
            return Response(status.value, status.phrase, Headers(), b"")
        return None if process is None else process(connection, request)

    return process_request
