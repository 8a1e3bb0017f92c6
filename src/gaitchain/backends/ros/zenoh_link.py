"""ROS 2 over Zenoh, compatible with nodes that use rmw_zenoh. No ROS needed."""

import atexit
import json
import re
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial

import zenoh
from zenoh.ext import (
    AdvancedPublisher,
    CacheConfig,
    Int64,
    declare_advanced_publisher,
    z_serialize,
)

from gaitchain.backends.base import LinkHealth
from gaitchain.backends.ros import cdr
from gaitchain.backends.ros.link import (
    OUTBOX,
    Answer,
    Letter,
    Mailbox,
    Subscription,
    answered,
    check_topic,
)
from gaitchain.backends.ros.messages import M, Message
from gaitchain.backends.ros.zenoh_names import TRIGGER_HASH, Node, Topic, gid_of
from gaitchain.errors import BackendError, CommandError

ROUTER = "tcp/localhost:7447"
"""Default endpoint of rmw_zenoh's router."""
_ENDPOINT = re.compile(r"[a-z]+/(\[[0-9a-fA-F:.]+\]|[^:/\[\]]+):([0-9]{1,5})")
_NODE = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_LOCAL = ("localhost", "127.0.0.1", "[::1]")
_ALWAYS = {
    "scouting/multicast/enabled": False,
    "timestamping/enabled": True,  # a cache of the last message needs it
    # Also the longest wait of `close` for a router that does not answer [ms].
    "transport/unicast/open_timeout": 2000,
    "connect/retry": {
        "period_init_ms": 250,
        "period_max_ms": 1000,
        "period_increase_factor": 2,
    },
}
# Settings of rmw_zenoh's nodes: besides their router they connect to each other.
_BESIDE = _ALWAYS | {
    "mode": "peer",
    "listen/endpoints": ["tcp/localhost:0"],
    "scouting/gossip/target": {"router": ["router", "peer"], "peer": ["router"]},
}
# Nodes on another computer listen on their own loopback only, so only their router can
# be reached. It forwards messages of a client, but not between peers.
_AWAY = _ALWAYS | {"mode": "client", "connect/timeout_ms": 2000}
_DRAIN_S = 0.5


@dataclass
class _Publisher:
    zenoh: zenoh.Publisher | AdvancedPublisher
    gid: bytes
    sequence: int = 0


class ZenohLink:
    """A peer of nodes that run with rmw_zenoh, or a client of their router."""

    mixes_types = True

    def __init__(
        self, endpoint: str = ROUTER, *, domain: int = 0, node: str = "gaitchain"
    ) -> None:
        """Join the network.

        A router on this computer may start later; one on another computer must be
        running. Either may disconnect and return.

        Args:
            endpoint: Zenoh endpoint of the router.
            domain: ROS_DOMAIN_ID, 0 to 232.
            node: name of the node, as shown by `ros2 node list`.

        Raises:
            CommandError: the endpoint, the domain or the name is invalid.
            BackendError: no router answers on the other computer.
        """
        config = _configure(endpoint, domain)
        if not _NODE.fullmatch(node):
            raise CommandError(f"node is {node!r}; a name such as gaitchain_1 works")
        try:
            self._session = zenoh.open(config)
        except zenoh.ZError as error:
            why = str(error).partition(" at /")[0]  # without the source location
            raise BackendError(f"{_no_router(endpoint)} ({why})") from None
        self._endpoint = endpoint
        self._node = Node(domain, str(self._session.zid()), node)
        self._lock = threading.Lock()
        self._entities = 0
        self._publishers: dict[tuple[str, str], _Publisher] = {}
        self._held: list[object] = []  # Zenoh undeclares unreferenced objects
        self._inboxes: list[Mailbox[bytes]] = []
        self._broken: dict[str, str] = {}  # latest error of each topic
        self._hold_token(self._node.token)
        self._latched: set[str] = set()  # topics
        self._calls: list[Mailbox[zenoh.Query]] = []
        self._outbox = Mailbox(self._send, "ros-zenoh", OUTBOX)
        # Zenoh must not call into Python after its shutdown.
        atexit.register(self.close)

    def advertise(
        self, topic: str, kind: type[Message], *, latched: bool = False
    ) -> None:
        """Announce that the topic will be published; see `RosLink`."""
        check_topic(topic)
        with self._lock:
            if latched:
                self._latched.add(topic)
            self._publisher(topic, kind)

    def publish(self, topic: str, message: Message) -> None:
        """Queue a message to be sent; see `RosLink`."""
        check_topic(topic)
        self._outbox.put((topic, message))

    def subscribe(
        self, topic: str, kind: type[M], callback: Callable[[M], None]
    ) -> None:
        """Call the callback with each message of the topic; see `RosLink`."""
        check_topic(topic)
        subscription, named = Subscription(topic, kind, callback), _named(topic, kind)
        inbox = Mailbox(partial(self._take, subscription), f"ros-zenoh {topic}")

        def keep(sample: zenoh.Sample) -> None:
            inbox.put(sample.payload.to_bytes())

        # Not on Zenoh's own thread, which would keep the process from ending.
        handler = zenoh.handlers.Callback(keep, indirect=False)
        with self._lock:
            key = self._node.key(named)
            self._held.append(self._session.declare_subscriber(key, handler))
            self._inboxes.append(inbox)
            self._hold_token(self._next_token("MS", named))

    def serve(self, service: str, answer: Answer) -> None:
        """Answer calls of a service; see `RosLink`."""
        check_topic(service)
        named = Topic(service, "std_srvs/srv/Trigger", TRIGGER_HASH)
        key = self._node.key(named)
        calls = Mailbox(partial(_reply, key, answer), f"ros-zenoh {service}")
        handler = zenoh.handlers.Callback(calls.put, indirect=False)
        with self._lock:
            self._held.append(
                self._session.declare_queryable(key, handler, complete=True)
            )
            self._calls.append(calls)
            self._hold_token(self._next_token("SS", named))

    def health(self) -> LinkHealth:
        """Return the numbers of published and lost messages, and present problems."""
        return LinkHealth(self._outbox.put_in, self._outbox.lost, self._note())

    def close(self) -> None:
        """Send the queued messages and leave the network."""
        atexit.unregister(self.close)
        for calls in self._calls:
            calls.close(_DRAIN_S)
        self._outbox.close(_DRAIN_S)
        if not self._session.is_closed():
            leave: Callable[[], None] = self._session.close  # its stub is untyped
            with suppress(zenoh.ZError):
                leave()
        for inbox in self._inboxes:
            inbox.close(_DRAIN_S)

    def _note(self) -> str:
        if self._session.is_closed():
            return "closed"
        info = self._session.info
        if not info.routers_zid() and not info.peers_zid():
            return _no_router(self._endpoint)
        return next(iter(tuple(self._broken.values())), "")

    def _send(self, letter: Letter | None) -> bool:
        if letter is None:
            return True
        topic, message = letter
        try:
            with self._lock:
                publisher = self._publisher(topic, type(message))
            publisher.sequence += 1
            # A subscriber of rmw_zenoh drops a message without these 33 bytes.
            sent = Int64(publisher.sequence), Int64(time.time_ns()), publisher.gid
            publisher.zenoh.put(cdr.encode(message), attachment=z_serialize(sent))
        except zenoh.ZError as error:
            self._broken[topic] = f"{topic} cannot be published: {error}"
            return False
        self._broken.pop(topic, None)
        return True

    def _take(self, subscription: Subscription[M], payload: bytes | None) -> bool:
        if payload is None:
            return True
        try:
            message = cdr.decode(subscription.kind, payload)
        except BackendError as error:
            self._broken[subscription.topic] = f"{subscription.topic}: {error}"
            return False
        self._broken.pop(subscription.topic, None)
        subscription.deliver(message)
        return True

    def _publisher(self, topic: str, kind: type[Message]) -> _Publisher:
        """Return the topic's publisher, declared at the first call."""
        found = self._publishers.get((topic, kind.type_name))
        if found is None:
            named = replace(_named(topic, kind), latched=topic in self._latched)
            token = self._next_token("MP", named)
            found = _Publisher(self._declared(named), gid_of(token))
            self._hold_token(token)
            self._publishers[topic, kind.type_name] = found
        return found

    def _declared(self, topic: Topic) -> zenoh.Publisher | AdvancedPublisher:
        key = self._node.key(topic)
        if topic.latched:
            return declare_advanced_publisher(
                self._session, key, cache=CacheConfig(1), publisher_detection=True
            )
        # As in rmw_zenoh: a router never waits for a slow subscriber.
        return self._session.declare_publisher(
            key,
            congestion_control=zenoh.CongestionControl.DROP,
            reliability=zenoh.Reliability.RELIABLE,
        )

    def _next_token(self, what: str, topic: Topic) -> str:
        self._entities += 1
        return self._node.end_token(self._entities, what, topic)

    def _hold_token(self, token: str) -> None:
        self._held.append(self._session.liveliness().declare_token(token))


def _no_router(endpoint: str) -> str:
    return (
        f"no Zenoh router at {endpoint}: `ros2 run rmw_zenoh_cpp rmw_zenohd` starts one"
    )


def _reply(key: str, answer: Answer, query: zenoh.Query | None) -> bool:
    """Answer a call; a client of rmw_zenoh finds its own by the attachment."""
    if query is None:
        return True
    payload = cdr.encode(answered(key, answer))
    with suppress(zenoh.ZError), query:  # maybe nobody waits for it any more
        query.reply(key, payload, attachment=query.attachment)
    return True


def _named(topic: str, kind: type[Message]) -> Topic:
    return Topic(topic, kind.type_name, cdr.type_hash(kind.type_name))


def check_endpoint(endpoint: str, domain: int) -> str:
    """Return the host of a router's endpoint.

    Args:
        endpoint: Zenoh endpoint of the router.
        domain: ROS_DOMAIN_ID.

    Raises:
        CommandError: the endpoint or the domain is invalid.
    """
    found = _ENDPOINT.fullmatch(endpoint)
    if not found or not 0 < int(found[2]) < 65536:
        raise CommandError(
            f"Zenoh endpoint is {endpoint!r}; one such as {ROUTER} works"
        )
    if not 0 <= domain <= 232:
        raise CommandError(f"ROS_DOMAIN_ID is {domain}, must be 0 to 232")
    return str(found[1])


def _configure(endpoint: str, domain: int) -> zenoh.Config:
    """Return the settings of a session, equal to those of rmw_zenoh's nodes."""
    host = check_endpoint(endpoint, domain)
    config = zenoh.Config()
    for key, value in (_BESIDE if host in _LOCAL else _AWAY).items():
        config.insert_json5(key, json.dumps(value))
    config.insert_json5("connect/endpoints", json.dumps([endpoint]))
    return config
