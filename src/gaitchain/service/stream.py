"""The telemetry stream: clients receive the newest frame and may send commands."""

import asyncio
import itertools
import math
import re
from contextlib import suppress

import msgspec
from pydantic import ValidationError
from starlette.websockets import WebSocket, WebSocketDisconnect

from gaitchain.service.api_feed import Feed
from gaitchain.service.api_limits import Allowance, ApiLimits
from gaitchain.service.auth import problem
from gaitchain.service.command_gateway import (
    ALWAYS_SENT,
    ANYBODY,
    CommandGateway,
    RefusedError,
)
from gaitchain.service.frame import Framer
from gaitchain.service.schemas import (
    DRIVER_PATTERN,
    MESSAGES,
    STOPS,
    Complaint,
    DisturbMessage,
    DriveMessage,
    FollowStepsMessage,
    GoToMessage,
    PushMessage,
    ReplayMessage,
    SteerMessage,
    fault_text,
)
from gaitchain.service.sight import Sight

_LEAST_HZ, _MOST_HZ, _HZ = 1.0, 100.0, 25.0
_SILENCE_TOLD_S = 1.0
_POLICY_VIOLATION = 1008
# What a socket raises when its client has gone, or takes nothing (TimeoutError).
_GONE = (WebSocketDisconnect, RuntimeError, OSError)


class Hub:
    """All clients of the telemetry stream."""

    def __init__(
        self,
        feed: Feed,
        gateway: CommandGateway,
        framer: Framer,
        limits: ApiLimits,
        sight: Sight,
    ) -> None:
        """Open for clients."""
        self.feed, self.gateway, self.limits = feed, gateway, limits
        self._sight = sight
        self._framer = framer
        self._clients: set[Client] = set()
        self._dropped = 0
        self._numbers = itertools.count(1)

    async def serve(self, socket: WebSocket) -> None:
        """Serve a client until it leaves, or is refused or closed."""
        try:
            hz, driver = self._asked(socket)
        except RefusedError as refused:
            await socket.send_denial_response(problem(refused.status, str(refused)))
            return
        client = Client(self, socket, hz, driver)
        self._clients.add(client)
        try:
            await client.serve()
        finally:
            self._clients.discard(client)
            self._dropped += client.dropped
            self._let_go(client)

    @property
    def clients(self) -> int:
        """How many there are."""
        return len(self._clients)

    @property
    def dropped(self) -> int:
        """Frames that slow clients did not get."""
        return self._dropped + sum(client.dropped for client in self._clients)

    def frame(self) -> bytes | None:
        """Return the newest frame as JSON, None if the loop is silent."""
        telemetry = self.feed.latest
        if telemetry is None:
            return None
        feed, view = self.feed, self._sight.drawn_by
        return self._framer.json(telemetry, feed.events, feed.fall, view)

    def _asked(self, socket: WebSocket) -> tuple[float, str]:
        """Return the rate and the driver that a new client asks for, or refuse it."""
        most = self.limits.sockets
        if len(self._clients) >= most:
            raise RefusedError(503, f"{most} clients watch already: close one")
        query = socket.query_params
        hz = _rate(query.get("hz", str(_HZ)))
        driver = query.get("driver") or f"socket-{next(self._numbers)}"
        if not re.fullmatch(DRIVER_PATTERN, driver):
            raise RefusedError(
                422, f"driver {driver[:80]!r}: 1 to 64 of A-Z a-z 0-9 . _ -"
            )
        return hz, driver

    def _let_go(self, client: "Client") -> None:
        others = any(other.driver == client.driver for other in self._clients)
        if client.took and not others:
            with suppress(RefusedError):
                self.gateway.act(client.driver, "let_go")


class Client:
    """One client of the telemetry stream."""

    def __init__(self, hub: Hub, socket: WebSocket, hz: float, driver: str) -> None:
        """Take a socket that is not accepted yet.

        Args:
            hub: of all clients.
            socket: its connection.
            hz: frames per second.
            driver: what it is called when it drives.
        """
        self._hub, self._socket, self.driver = hub, socket, driver
        self._period_s = 1.0 / hz
        limits = hub.limits
        self._messages = Allowance(limits.messages_per_s)
        self._bad = Allowance(1.0, limits.bad_messages)
        self._news = asyncio.Event()  # a complaint, or why it is closed
        self._complaint = self._closed_for = ""
        self.dropped = 0
        """Frames that it did not get because it was slow."""
        self.took = False
        """Whether it ever asked for what takes the wheel."""

    async def serve(self) -> None:
        """Send frames and take messages until the client leaves or is closed."""
        await self._socket.accept()
        tasks = [
            asyncio.create_task(self._send_frames()),
            asyncio.create_task(self._send_answers()),
            asyncio.create_task(self._take_messages()),
        ]
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in tasks:
                task.cancel()
            for ended in await asyncio.gather(*tasks, return_exceptions=True):
                if isinstance(ended, Exception) and not isinstance(ended, _GONE):
                    raise ended

    async def _send_frames(self) -> None:
        """Send the newest frame each period; one that is not taken delays no other."""
        loop, last = asyncio.get_running_loop(), b""
        told_s = loop.time()
        while True:
            # On a common grid, so that clients of one rate share the work on a frame.
            await asyncio.sleep(self._period_s - loop.time() % self._period_s)
            began_s, frame = loop.time(), self._hub.frame()
            try:
                if frame is not None and frame is not last:
                    await self._send(frame)
                    last, told_s = frame, loop.time()
                elif frame is None and began_s - told_s > _SILENCE_TOLD_S:
                    await self._complain(self._hub.feed.why_silent)
                    told_s = loop.time()
            finally:
                self.dropped += int((loop.time() - began_s) / self._period_s)

    async def _send_answers(self) -> None:
        """Send the latest complaint, each time there is one, until it is closed."""
        while not self._closed_for:
            await self._news.wait()
            self._news.clear()
            complaint, self._complaint = self._complaint, ""
            if complaint:
                await self._complain(complaint)
        await self._close(self._closed_for)

    async def _take_messages(self) -> None:
        """Take messages until the client leaves.

        Nothing is sent from here: a client that reads nothing may still stop the robot.
        """
        while True:
            message = await self._socket.receive()
            if message["type"] == "websocket.disconnect":
                return
            if not self._messages.take():
                most = f"{self._hub.limits.messages_per_s:g} messages a second"
                self._close_for(f"more than {most}")
            text = message.get("text")
            complaint = self.take(
                message.get("bytes", b"") if text is None else text,
                only_stops=bool(self._closed_for),
            )
            if complaint is not None:
                self._refuse(complaint)

    def _refuse(self, complaint: str) -> None:
        """Leave a complaint to be sent; it replaces one that is not sent yet."""
        if self._bad.take():
            self._complaint = complaint
            self._news.set()
        else:
            self._close_for("too many messages that cannot be read")

    def _close_for(self, why: str) -> None:
        self._closed_for = self._closed_for or why
        self._news.set()

    def take(self, text: str | bytes, *, only_stops: bool = False) -> str | None:
        """Take one message.

        Args:
            text: JSON.
            only_stops: whether all that does not stop the robot is ignored.

        Returns:
            What is wrong with it, None if nothing.
        """
        limit = self._hub.limits.message_bytes
        if len(text) > limit:
            return f"a message of {len(text)} bytes: at most {limit}"
        try:
            message = MESSAGES.validate_json(text)
        except ValidationError as error:
            refusal = self._stop_anyway(text)
            return refusal or fault_text(error.errors(include_url=False))
        if only_stops and message.type not in ALWAYS_SENT:
            return None
        gateway = self._hub.gateway
        try:
            if isinstance(message, DriveMessage):
                gateway.drive(self.driver, message)
            elif isinstance(message, SteerMessage):
                gateway.steer(self.driver, message)
            elif isinstance(message, GoToMessage):
                gateway.go_to(self.driver, message)
            elif isinstance(message, FollowStepsMessage):
                gateway.follow_steps(self.driver, message)
            elif isinstance(message, PushMessage):
                gateway.push(self.driver, message)
            elif isinstance(message, DisturbMessage):
                gateway.disturb(self.driver, message)
            elif isinstance(message, ReplayMessage):
                gateway.play(self.driver, message)
            else:
                gateway.act(self.driver, message.type)
        except RefusedError as refused:
            return str(refused)
        self.took = self.took or message.type not in ANYBODY
        return None

    def _stop_anyway(self, text: str | bytes) -> str:
        """Do a stop whatever else its message says; return why not, if it cannot be."""
        try:
            self._hub.gateway.act(self.driver, STOPS.validate_json(text).type)
        except ValidationError:
            return ""
        except RefusedError as refused:
            return str(refused)
        return ""

    async def _complain(self, detail: str) -> None:
        await self._send(msgspec.json.encode(Complaint(detail)))

    async def _send(self, text: bytes) -> None:
        async with asyncio.timeout(self._hub.limits.stalled_s):
            await self._socket.send_text(text.decode())

    async def _close(self, why: str) -> None:
        async with asyncio.timeout(self._hub.limits.stalled_s):
            await self._socket.close(_POLICY_VIOLATION, why)


def _rate(text: str) -> float:
    try:
        hz = float(text)
    except ValueError:
        hz = math.nan
    if not _LEAST_HZ <= hz <= _MOST_HZ:
        raise RefusedError(
            422, f"hz {text[:40]!r}: {_LEAST_HZ:g} to {_MOST_HZ:g} frames a second"
        )
    return hz
