"""ROS 2 through a rosbridge_server: JSON over a WebSocket, as a client."""

import logging
import socket
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any

from websockets.exceptions import ConnectionClosed, InvalidURI, WebSocketException
from websockets.sync.client import connect
from websockets.sync.connection import Connection
from websockets.uri import parse_uri

from gaitchain.backends.base import LinkHealth
from gaitchain.backends.ros import rosbridge_json
from gaitchain.backends.ros.link import (
    OUTBOX,
    Answer,
    Letter,
    Mailbox,
    Subscription,
    answered,
    check_topic,
)
from gaitchain.backends.ros.messages import M, Message, TriggerResponse
from gaitchain.errors import BackendError, CommandError

_log = logging.getLogger(__name__)
_RETRY_S = 1.0
_OPEN_S = 5.0
_PING_S = 5.0
_STALL_S = 2.0
"""A server that accepts no data for this long is given up, and connected anew [s]."""
_DRAIN_S = 0.5
_MESSAGE_BYTES = 1 << 24  # of what is received; a dense path of 50 m takes 1 MB


def check_url(url: str) -> None:
    """Refuse what is no URL of a server.

    Raises:
        CommandError: the URL is invalid.
    """
    try:
        parse_uri(url).host.encode("idna")  # as the socket will
    except (InvalidURI, ValueError) as error:
        raise CommandError(
            f"rosbridge is {url!r}; a URL such as ws://localhost:9090 works"
        ) from error


class RosbridgeLink:
    """A client of a rosbridge_server; reconnects automatically."""

    mixes_types = False

    def __init__(self, url: str, *, stall_s: float = _STALL_S) -> None:
        """Start to connect; the server may start later.

        Args:
            url: URL of the server, such as ws://localhost:9090.
            stall_s: time after which a server that accepts no data is given up [s].

        Raises:
            CommandError: the URL is invalid.
        """
        check_url(url)
        self._url, self._stall_s = url, stall_s
        self._lock = threading.Lock()
        self._greeting: dict[str, None] = {}  # sent first on a new connection
        self._advertised: dict[str, type[Message]] = {}
        self._subscriptions: list[Subscription[Any]] = []
        self._note, self._broken = f"not connected to {url} yet", ""
        self._connection: Connection | None = None
        self._greeted: tuple[Connection | None, int] = (None, 0)
        self._sending_since: float | None = None
        self._stop, self._tried = threading.Event(), threading.Event()
        self._services: dict[str, Mailbox[rosbridge_json.Said]] = {}
        self._latching: set[str] = set()
        self._latched: dict[str, str] = {}  # last texts, for a new connection
        self._outbox = Mailbox(self._send, "ros-rosbridge-send", OUTBOX)
        self._thread = threading.Thread(
            target=self._run, name="ros-rosbridge", daemon=True
        )
        self._thread.start()
        self._tried.wait(_RETRY_S)  # so that a running server gets the first message

    def advertise(
        self, topic: str, kind: type[Message], *, latched: bool = False
    ) -> None:
        """Announce that the topic will be published; see `RosLink`."""
        check_topic(topic)
        with self._lock:
            if self._advertised.setdefault(topic, kind) is not kind:
                raise _two_types(topic, self._advertised[topic], kind)
            said = rosbridge_json.advertise(topic, kind, latched=latched)
            self._greeting[said] = None
            if latched:
                self._latching.add(topic)
        self._outbox.wake()

    def publish(self, topic: str, message: Message) -> None:
        """Queue a message to be sent; see `RosLink`."""
        if self._advertised.get(topic) is not type(message):
            self.advertise(topic, type(message))
        if topic in self._latching:
            with self._lock:
                self._latched[topic] = rosbridge_json.publish(topic, message)
        self._outbox.put((topic, message))

    def serve(self, service: str, answer: Answer) -> None:
        """Answer calls of a service; see `RosLink`."""
        check_topic(service)
        # Each has a thread of its own: a stop must not wait for another call.
        calls = Mailbox(partial(self._answer, answer), f"ros-rosbridge {service}")
        with self._lock:
            self._services[service] = calls
            self._greeting[rosbridge_json.advertise_service(service)] = None
        self._outbox.wake()

    def subscribe(
        self, topic: str, kind: type[M], callback: Callable[[M], None]
    ) -> None:
        """Call the callback with each message of the topic; see `RosLink`."""
        check_topic(topic)
        with self._lock:
            for other in self._subscriptions:
                if other.topic == topic and other.kind is not kind:
                    raise _two_types(topic, other.kind, kind)
            self._subscriptions.append(Subscription(topic, kind, callback))
            self._greeting[rosbridge_json.subscribe(topic, kind)] = None
        self._outbox.wake()

    def health(self) -> LinkHealth:
        """Return the numbers of published and lost messages, and present problems."""
        outbox = self._outbox
        return LinkHealth(outbox.put_in, outbox.lost, self._note or self._broken)

    def close(self) -> None:
        """Send the queued messages and disconnect."""
        for calls in tuple(self._services.values()):
            calls.close(_DRAIN_S)
        self._outbox.close(_DRAIN_S)
        self._stop.set()
        self._hang_up()
        self._thread.join(_OPEN_S)

    def _run(self) -> None:
        """Connect and receive, and reconnect when the connection ends."""
        while not self._stop.is_set():
            try:
                with connect(
                    self._url,
                    proxy=None,  # the robot's network is local
                    compression=None,
                    open_timeout=_OPEN_S,
                    ping_interval=_PING_S,
                    ping_timeout=_PING_S,
                    close_timeout=_DRAIN_S,
                    max_size=_MESSAGE_BYTES,
                ) as connection:
                    self._connection, self._note, self._broken = connection, "", ""
                    self._outbox.wake()
                    self._tried.set()
                    self._listen(connection)
            except (OSError, WebSocketException) as error:
                self._note = (
                    f"no rosbridge at {self._url} ({error}): `ros2 launch "
                    "rosbridge_server rosbridge_websocket_launch.xml` starts one"
                )
            except Exception as error:  # a link whose thread ended would say nothing
                _log.exception("rosbridge at %s: connecting anew", self._url)
                self._note = f"rosbridge at {self._url}: {error!r}; connecting anew"
            self._connection = None
            self._tried.set()
            self._stop.wait(_RETRY_S)
        self._note = "closed"

    def _listen(self, connection: Connection) -> None:
        """Receive messages until the connection ends or the server stalls."""
        while not self._stop.is_set():
            try:
                text = connection.recv(timeout=self._stall_s / 2.0)
            except TimeoutError:
                since = self._sending_since
                if since is not None and time.monotonic() - since > self._stall_s:
                    self._hang_up()
                continue
            self._take(text)

    def _take(self, text: str | bytes) -> None:
        try:
            said = rosbridge_json.read(text)
            if said.op == "call_service":
                self._called(said)
                return
            for subscription in self._subscriptions:
                if subscription.topic == said.topic:
                    message = rosbridge_json.message(subscription.kind, said)
                    self._broken = ""
                    subscription.deliver(message)
        except BackendError as error:
            self._broken = str(error)

    def _called(self, call: rosbridge_json.Said) -> None:
        """Pass a call on to its service, and refuse one for which there is no room."""
        calls = self._services.get(call.service)
        dropped = None if calls is None else calls.put(call)
        if dropped is not None:
            said = "too many calls at once; call again"
            self._respond(dropped, TriggerResponse(False, said))

    def _answer(self, answer: Answer, call: rosbridge_json.Said | None) -> bool:
        """Answer a call, which may take seconds."""
        return call is None or self._respond(call, answered(call.service, answer))

    def _respond(self, call: rosbridge_json.Said, answer: TriggerResponse) -> bool:
        connection = self._connection
        if connection is None:
            return False
        try:
            connection.send(rosbridge_json.service_response(call, answer))
        except (OSError, ConnectionClosed):
            return False
        return True

    def _send(self, letter: Letter | None) -> bool:
        connection = self._connection
        if connection is None:
            return False
        self._sending_since = time.monotonic()
        try:
            self._greet(connection)
            if letter is not None:
                connection.send(rosbridge_json.publish(*letter))
        except (OSError, ConnectionClosed):
            return False
        finally:
            self._sending_since = None
        return True

    def _greet(self, connection: Connection) -> None:
        """Send the advertisements and subscriptions that this connection lacks."""
        to, sent = self._greeted
        if to is not connection:
            sent = 0
        with self._lock:
            unsent = list(self._greeting)[sent:]
            again = [] if to is connection else list(self._latched.values())
        for text in (*unsent, *again):
            connection.send(text)
        self._greeted = (connection, sent + len(unsent))

    def _hang_up(self) -> None:
        """End the connection even if a `send` is blocked."""
        connection = self._connection
        if connection is not None:
            # `close` would wait for the blocked `send`.
            with suppress(OSError):
                connection.socket.shutdown(socket.SHUT_RDWR)


def _two_types(topic: str, one: type[Message], other: type[Message]) -> CommandError:
    return CommandError(
        f"{topic} is {one.type_name}, asked for {other.type_name} too; a rosbridge "
        "carries one type per topic, zenoh both"
    )
