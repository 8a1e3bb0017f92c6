"""Proxy of the 3-D view on the same port, and so with the same access control."""

import asyncio
from contextlib import suppress
from http.cookiejar import CookieJar, DefaultCookiePolicy
from typing import TYPE_CHECKING
from urllib.parse import quote

from starlette.requests import Request
from starlette.responses import Response
from starlette.websockets import WebSocket, WebSocketDisconnect, WebSocketState

from gaitchain.service.api_limits import ApiLimits
from gaitchain.service.auth import problem
from gaitchain.service.viewer_gate import HEADER

if TYPE_CHECKING:
    import httpx
    from websockets.asyncio.client import ClientConnection

_ASKED = ("accept", "accept-encoding", "accept-language", "if-none-match")
_ANSWERED = ("content-type", "content-encoding", "etag", "last-modified", "vary")
_PATH_CHARACTERS = 2048  # as it goes to the view; its files have short ones
_FILE_BYTES = 1 << 25  # of an answer
_MESSAGE_BYTES = 1 << 26  # of the view to its client: a scene's meshes
_QUEUED = 4  # messages read ahead from the view
_CONNECT_S, _CLOSE_S = 5.0, 1.0
_PROTOCOLS = 8
_AWAY = 1012
_REFUSALS = 1002, 1003, 1007, 1008, 1009  # of the view: what it does not take
_AGAIN_S = "2"
_DOWN = "the 3-D view is not there: it is being restarted"


class Viewer:
    """Passes requests and sockets on to the 3-D view's own server."""

    def __init__(self, port: int, limits: ApiLimits, secret: str = "") -> None:
        """Take the view's server.

        Args:
            port: on loopback; 0 where there is no view.
            limits: of its clients.
            secret: that it asks for.
        """
        self._port, self._limits = port, limits
        self._known = {HEADER: secret}
        self._client: httpx.AsyncClient | None = None
        self.clients = 0
        """How many sockets are open."""

    async def close(self) -> None:
        """Close what was kept open for later requests."""
        if self._client is not None:
            await self._client.aclose()

    async def page(self, request: Request) -> Response:
        """Answer a request for a file of the view.

        Neither cookies nor tokens go there, and no header that is not needed.
        """
        import httpx  # noqa: PLC0415

        path = quote(request.path_params.get("path", ""))
        if len(path) > _PATH_CHARACTERS:
            return problem(414, f"a path of more than {_PATH_CHARACTERS} characters")
        url = f"http://127.0.0.1:{self._port}/{path}"
        # Where the client says nothing of it, httpx would ask for a packed answer.
        asked = {"accept-encoding": "identity"}
        asked |= {n: request.headers[n] for n in _ASKED if n in request.headers}
        # As bytes: of a str, httpx takes ASCII only, and clients may send more.
        headers = {
            name.encode(): value.encode("latin-1")
            for name, value in (asked | self._known).items()
        }
        try:
            async with self._http().stream("GET", url, headers=headers) as answer:
                body = await _whole(answer)
        except httpx.TransportError:
            gone = problem(503, _DOWN)
            gone.headers["Refresh"] = _AGAIN_S  # the page's frame asks again
            return gone
        if body is None:
            return problem(503, f"a file of the 3-D view exceeds {_FILE_BYTES} bytes")
        kept = {n: answer.headers[n] for n in _ANSWERED if n in answer.headers}
        return Response(body, answer.status_code, kept)

    async def socket(self, socket: WebSocket) -> None:
        """Pass a socket's messages on in both directions until one side leaves."""
        from websockets.exceptions import (  # noqa: PLC0415
            ConnectionClosed,
            WebSocketException,
        )

        if self.clients >= self._limits.viewers:
            full = f"{self._limits.viewers} clients have the 3-D view open: close one"
            await socket.send_denial_response(problem(503, full))
            return
        self.clients += 1
        why = _AWAY, _DOWN
        try:
            view = await self._connected(socket.scope["subprotocols"])
            async with view:
                await socket.accept(view.subprotocol)
                await self._pass_on(socket, view)
        except ConnectionClosed as closed:
            if closed.rcvd is not None and closed.rcvd.code in _REFUSALS:
                why = closed.rcvd.code, closed.rcvd.reason
            await _give_up(socket, *why)
        except (OSError, WebSocketException, WebSocketDisconnect):
            await _give_up(socket, *why)
        finally:
            self.clients -= 1

    def _http(self) -> "httpx.AsyncClient":
        import httpx  # noqa: PLC0415

        if self._client is None:
            self._client = httpx.AsyncClient(
                timeout=_CONNECT_S,
                limits=httpx.Limits(max_connections=self._limits.viewers),
                # What the view gives one browser, no other one may bring back.
                cookies=CookieJar(DefaultCookiePolicy(allowed_domains=())),
                trust_env=False,
            )
        return self._client

    async def _connected(self, protocols: list[str]) -> "ClientConnection":
        from websockets.asyncio.client import connect  # noqa: PLC0415
        from websockets.typing import Subprotocol  # noqa: PLC0415

        return await connect(
            f"ws://127.0.0.1:{self._port}/",
            subprotocols=[Subprotocol(name) for name in protocols[:_PROTOCOLS]] or None,
            additional_headers=self._known,
            compression=None,
            proxy=None,
            open_timeout=_CONNECT_S,
            close_timeout=_CLOSE_S,
            max_size=_MESSAGE_BYTES,
            max_queue=_QUEUED,
        )

    async def _pass_on(self, socket: WebSocket, view: "ClientConnection") -> None:
        tasks = [
            asyncio.create_task(self._from_client(socket, view)),
            asyncio.create_task(self._from_view(socket, view)),
        ]
        try:
            ended, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
        for task in ended:
            task.result()

    async def _from_client(self, socket: WebSocket, view: "ClientConnection") -> None:
        while True:
            message = await socket.receive()
            if message["type"] == "websocket.disconnect":
                return
            text = message.get("text")
            await view.send(message.get("bytes", b"") if text is None else text)

    async def _from_view(self, socket: WebSocket, view: "ClientConnection") -> None:
        async for message in view:
            async with asyncio.timeout(self._limits.stalled_s):
                if isinstance(message, str):
                    await socket.send_text(message)
                else:
                    await socket.send_bytes(message)
        await socket.close(_AWAY, _DOWN)


async def _whole(answer: "httpx.Response") -> bytes | None:
    """Return the body as it was sent, None if it is too large."""
    body = b""
    async for part in answer.aiter_raw():
        body += part
        if len(body) > _FILE_BYTES:
            return None
    return body


async def _give_up(socket: WebSocket, code: int, why: str) -> None:
    """Refuse a socket that was not accepted yet, close one that was."""
    with suppress(WebSocketDisconnect, RuntimeError, OSError):
        async with asyncio.timeout(_CLOSE_S):
            if socket.application_state is WebSocketState.CONNECTING:
                await socket.send_denial_response(problem(503, _DOWN))
            else:
                await socket.close(code, why)
