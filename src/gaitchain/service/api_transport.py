"""The server's TCP connections, with limits on number, idle time and buffers."""

import asyncio
import socket
from typing import Any

import h11
import uvicorn
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

from gaitchain.errors import ServiceError
from gaitchain.service.api_limits import ApiLimits
from gaitchain.service.own_port import own_port

_SOCKET_BYTES = 1 << 16  # of the system's buffers; what is read at once is no more
_MESSAGE_BYTES = 1 << 16  # a message of the 3-D view; more and its socket is closed
# Connections that wait to be accepted. asyncio accepts all of them in one turn of its
# loop, in which nothing else is answered, no emergency stop either.
_BACKLOG = 16


def listen(host: str, port: int) -> socket.socket:
    """Return a listening socket.

    Args:
        host: name or address of this machine.
        port: 0 for any.

    Raises:
        ServiceError: there is no such address, or it is taken.
    """
    try:
        found = socket.getaddrinfo(
            host or None, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )
        family, kind, protocol, _, address = found[0]
        listening = socket.socket(family, kind, protocol)
    except OSError as error:
        raise ServiceError(f"--host {host}: {error.strerror}") from None
    try:
        own_port(listening)
        # Connections inherit these; a client that does not read is noticed soon.
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _SOCKET_BYTES)
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SOCKET_BYTES)
        listening.bind(address)
        listening.listen(_BACKLOG)
    except OSError as error:
        listening.close()
        raise ServiceError(
            f"--host {host} --port {port}: {error.strerror}; choose another port"
        ) from None
    return listening


def server_of(app: Any, limits: ApiLimits) -> uvicorn.Server:
    """Return a server for an ASGI app; `run(sockets=[listen(...)])` serves it.

    Nothing but errors is logged, and no address of a request, for it may hold a token.

    Args:
        app: what to serve.
        limits: of its connections.
    """
    bounds = {"limits": limits}  # uvicorn makes these itself, without arguments of ours
    config = uvicorn.Config(
        app,
        loop="asyncio",
        http=type("Http", (_BoundedHttp,), bounds),
        ws=type("Sockets", (_BoundedSocket,), bounds),
        ws_max_size=_MESSAGE_BYTES,
        ws_per_message_deflate=False,
        backlog=_BACKLOG,  # of its own uvicorn would take 2048
        lifespan="on",
        log_config=None,
        log_level="error",
        access_log=False,
        proxy_headers=False,
        server_header=False,
        timeout_graceful_shutdown=2,
    )
    return uvicorn.Server(config)


class _BoundedHttp(H11Protocol):
    """Hangs up on a connection that is one too many, or slow over a request."""

    limits = ApiLimits()
    _deadline: asyncio.TimerHandle | None = None
    _since_s = 0.0

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Begin to count the time; one too many takes the place of an idle one."""
        super().connection_made(transport)
        self._since_s = self.loop.time()
        if len(self.connections) > self.limits.connections:
            self._make_room()
        self._set_deadline(self.limits.request_s)

    @property
    def idle(self) -> bool:
        """Whether it could be hung up on: no request is complete and unanswered."""
        if self.transport.is_closing():
            return False  # it goes already
        answered = self.cycle is None or self.cycle.response_complete
        return answered or self.conn.their_state is h11.SEND_BODY

    def _make_room(self) -> None:
        """Hang up on who has been idle for longest; on the new one if nobody is.

        Who opens connections and asks nothing can so shut nobody out: a new request,
        such as an emergency stop, comes with its connection.
        """
        others = [
            other
            for other in self.connections
            if isinstance(other, _BoundedHttp) and other is not self and other.idle
        ]
        oldest = min(others, key=lambda other: other._since_s, default=self)
        oldest.transport.abort()

    def on_response_complete(self) -> None:
        """Begin to count anew."""
        super().on_response_complete()
        self._since_s = self.loop.time()
        self._set_deadline(self.limits.request_s)

    def handle_websocket_upgrade(self, event: Any) -> None:
        """Count no more: sockets stay."""
        self._cancel_deadline()
        super().handle_websocket_upgrade(event)

    def connection_lost(self, exc: Exception | None) -> None:
        """Count no more."""
        self._cancel_deadline()
        super().connection_lost(exc)

    def _set_deadline(self, after_s: float) -> None:
        self._cancel_deadline()
        self._deadline = self.loop.call_later(after_s, self.transport.abort)

    def _cancel_deadline(self) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None


class _BoundedSocket(WebSocketsSansIOProtocol):
    """Hangs up on a client that does not take the end of what it is sent."""

    limits = ApiLimits()

    async def send(self, message: Any) -> None:
        """Count a socket that was refused with an answer as answered."""
        await super().send(message)
        if message["type"] == "websocket.http.response.body":
            self.handshake_complete = True  # else an error is logged

    def on_task_complete(self, task: asyncio.Task[None]) -> None:
        """Drop what is still unsent a while after the app has done with the client."""
        super().on_task_complete(task)
        self.loop.call_later(self.limits.stalled_s, self.transport.abort)
