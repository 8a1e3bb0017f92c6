"""The server's TCP connections, with limits on number, time, buffers and work.

One loop serves all of them, so what one connection can make it do at once delays an
emergency stop of another one. What a client sends is read in small pieces, by turns
with all others, and all that costs time is counted, also what no app ever sees: lines
of a head, chunks, fragments, pings. Who exceeds a limit is read no more, and hung up on
a while later: at once, and it would connect again as fast.
"""

import asyncio
import socket
from typing import Any

import h11
import msgspec
import uvicorn
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.utils import ClientDisconnected
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

from gaitchain.errors import ServiceError
from gaitchain.service.api_limits import Allowance, ApiLimits
from gaitchain.service.own_port import own_port
from gaitchain.service.schemas import Problem

_SOCKET_BYTES = 1 << 16  # of the system's buffers
_TURN_BYTES = 1 << 10  # of a connection that are read and handled in one turn
_MESSAGE_BYTES = 1 << 16  # a message of the 3-D view; more and its socket is closed
# Connections that asyncio accepts in one turn of its loop, in which nothing else is
# answered, no emergency stop either.
_ACCEPTED = 16
# Connections that may wait for that. Where no more fit, the system drops what comes,
# and a client tries again after a second.
_WAITING = 512
_POLICY_VIOLATION, _INVALID_DATA = 1008, 1007
DAMAGED = "damaged"
"""Key of a request's state, there if its body was no HTTP and so ended early."""


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
        listening.listen(_ACCEPTED)
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
        h11_max_incomplete_event_size=limits.head_bytes,
        ws_max_size=_MESSAGE_BYTES,
        ws_per_message_deflate=False,
        backlog=_ACCEPTED,  # of its own uvicorn would take 2048
        lifespan="on",
        log_config=None,
        log_level="error",
        access_log=False,
        proxy_headers=False,
        server_header=False,
        timeout_graceful_shutdown=2,
    )
    return _Server(config)


class _Server(uvicorn.Server):
    """Lets more connections wait than asyncio accepts in one turn."""

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Begin to accept, by asyncio's one number for both."""
        await super().startup(sockets)
        for listening in sockets or ():
            listening.listen(_WAITING)


class _BoundedHttp(H11Protocol):
    """Hangs up on a connection that is one too many, slow over a request, or floods."""

    limits = ApiLimits()
    _deadline: asyncio.TimerHandle | None = None
    _lines = 0  # since the last answer
    floods = False
    """Whether it is read no more."""
    since_s = 0.0
    """When it connected, or got its last answer."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Begin to count the time; one too many takes the place of the oldest."""
        super().connection_made(transport)
        transport.max_size = _TURN_BYTES  # type: ignore[attr-defined]  # of asyncio's
        self.since_s = self.loop.time()
        if len(self.connections) > self.limits.connections:
            self._make_room()
        self._set_deadline(self.limits.request_s)

    def data_received(self, data: bytes) -> None:
        """Count the lines that have to be read one by one, before they are."""
        self._lines += self._lines_in(data)
        if self._lines > self.limits.lines:
            self._hang_up()
        else:
            super().data_received(data)

    def send_400_response(self, msg: str) -> None:
        """Answer what is no HTTP, unless the app has the request and answers itself.

        It learns from `scope["state"]` that the body, which is at its end then, is
        damaged. Where the answer was sent already, there is nothing left to say.
        """
        if self.cycle is not None and not self.cycle.response_complete:
            self.scope["state"][DAMAGED] = True
            self.cycle.keep_alive = self.cycle.more_body = False
            self.cycle.message_event.set()
            return
        if self.conn.our_state in (h11.IDLE, h11.SEND_RESPONSE):
            self._refuse(msg)
        self._hang_up()

    def _refuse(self, why: str) -> None:
        body = msgspec.json.encode(Problem(why))
        kind = ("content-type", "application/json"), ("connection", "close")
        headers = [*kind, ("content-length", str(len(body)))]
        answer = h11.Response(status_code=400, headers=headers, reason=b"Bad Request")
        for event in (answer, h11.Data(data=body), h11.EndOfMessage()):
            self.transport.write(self.conn.send(event) or b"")

    def _lines_in(self, data: bytes) -> int:
        """Return how many lines of a head or of chunks there are; a body has none."""
        if self.conn.their_state is not h11.SEND_BODY:
            data = data.partition(b"\r\n\r\n")[0]
        elif not any(name == b"transfer-encoding" for name, _ in self.headers):
            return 0
        return data.count(b"\n")

    def _make_room(self) -> None:
        """Hang up on whose last answer was longest ago.

        Who opens connections can so shut nobody out, whatever it asks on them: a new
        request, such as an emergency stop, comes with its connection, and is answered
        before so many others are newer. Open sockets stay; they have limits of their
        own.
        """
        others = [
            other
            for other in self.connections
            if isinstance(other, _BoundedHttp)
            or (isinstance(other, _BoundedSocket) and not other.is_open)
        ]
        left = [other for other in others if not other.transport.is_closing()]
        min(left, key=lambda other: other.since_s, default=self).transport.abort()

    def _hang_up(self) -> None:
        """Read no more, and end the connection a while later."""
        self.floods = True
        self.transport.pause_reading()
        self._set_deadline(self.limits.stalled_s)

    def on_response_complete(self) -> None:
        """Begin to count anew."""
        super().on_response_complete()
        self.since_s, self._lines = self.loop.time(), 0
        if not self.floods:
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
    """Hangs up on a client that floods, or does not take the end of what it is sent."""

    limits = ApiLimits()
    floods = False
    """Whether it is read no more."""
    since_s = 0.0
    """When it was asked for."""

    def connection_made(self, transport: Any) -> None:
        """Begin to count frames."""
        super().connection_made(transport)
        self.since_s = self.loop.time()
        self._frames = Allowance(self.limits.frames_per_s)
        self._drop: asyncio.TimerHandle | None = None
        self._lost = False

    def connection_lost(self, exc: Exception | None) -> None:
        """Drop nothing more: a transport that is gone cannot be aborted."""
        self._lost = True
        if self._drop is not None:
            self._drop.cancel()
        super().connection_lost(exc)

    @property
    def is_open(self) -> bool:
        """Whether it has been let in, and is read."""
        return self.handshake_complete and not self.floods

    def data_received(self, data: bytes) -> None:
        """Hang up on a head that HTTP allows and WebSocket does not: a long one."""
        super().data_received(data)
        if not self.handshake_initiated and self.conn.handshake_exc is not None:
            self.transport.abort()

    def handle_events(self) -> None:
        """Count frames, also those that are no messages; what has come is handled."""
        allowed = self._frames.take(len(self.conn.events))
        super().handle_events()
        if not (allowed or self.floods):
            self._hang_up()

    def send_receive_event_to_app(self) -> None:
        """End a socket whose text is not UTF-8; uvicorn would log each one."""
        if self.curr_msg_data_type == "text" and not _is_text(b"".join(self.frames)):
            self.frames = []
            self.conn.fail(_INVALID_DATA, "text that is not UTF-8")
            self.handle_parser_exception()
        else:
            super().send_receive_event_to_app()

    def handle_parser_exception(self) -> None:
        """End a socket that sent what is none; at once where it is not open."""
        if self.close_sent or self.conn.close_sent is None:
            self.transport.abort()
        else:
            super().handle_parser_exception()

    def _hang_up(self) -> None:
        """Say why, read no more, and end the connection a while later."""
        self.floods = True
        if self.handshake_complete and not self.close_sent:
            most = f"more than {self.limits.frames_per_s:g} frames a second"
            self.conn.send_close(_POLICY_VIOLATION, most)
            self.transport.write(b"".join(self.conn.data_to_send()))
        self.close_sent, self.read_paused = True, False  # so that nobody reads on
        self.transport.pause_reading()
        if self.close_timer is not None:
            self.close_timer.cancel()
        self.close_timer = self.loop.call_later(
            self.limits.stalled_s, self.transport.abort
        )

    async def send(self, message: Any) -> None:
        """Count a socket that was refused with an answer as answered."""
        if self.floods:
            raise ClientDisconnected
        await super().send(message)
        if message["type"] == "websocket.http.response.body":
            self.handshake_complete = True  # else an error is logged

    def on_task_complete(self, task: asyncio.Task[None]) -> None:
        """Drop what is still unsent a while after the app has done with the client."""
        super().on_task_complete(task)
        if not self._lost:
            wait_s, abort = self.limits.stalled_s, self.transport.abort
            self._drop = self.loop.call_later(wait_s, abort)


def _is_text(data: bytes) -> bool:
    try:
        data.decode()
    except UnicodeDecodeError:
        return False
    return True
