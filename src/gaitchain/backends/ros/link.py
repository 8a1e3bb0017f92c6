"""The interface of a link that transports ROS 2 messages, and common parts of links."""

import logging
import re
import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

from gaitchain.backends.base import LinkHealth
from gaitchain.backends.ros.messages import M, Message, TriggerResponse
from gaitchain.errors import CommandError

T = TypeVar("T")
Letter = tuple[str, Message]
"""A message to send, with its topic."""
_log = logging.getLogger(__name__)
Answer = Callable[[], TriggerResponse]
"""What a service does when it is called."""
INBOX = 8
"""Capacity for one topic: at 100 Hz no message older than 80 ms is handled."""
OUTBOX = 48
"""Capacity for all that is published: six topics at 100 Hz for 80 ms."""
_TOPIC = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)+")


class RosLink(Protocol):
    """A link to a ROS 2 network. Its peer may connect and disconnect at any time."""

    mixes_types: bool
    """Whether one topic may carry messages of two types."""

    def advertise(
        self, topic: str, kind: type[Message], *, latched: bool = False
    ) -> None:
        """Announce that the topic will be published.

        Args:
            topic: its name.
            kind: of its messages.
            latched: whether a later subscriber gets the last message, too; ROS 2 calls
                that transient local.

        Raises:
            CommandError: the topic's name is invalid.
        """

    def publish(self, topic: str, message: Message) -> None:
        """Queue a message to be sent; never blocks.

        If the queue is full, the oldest message is dropped and counted as lost.

        Raises:
            CommandError: the topic's name is invalid.
        """

    def subscribe(
        self, topic: str, kind: type[M], callback: Callable[[M], None]
    ) -> None:
        """Call the callback with each message of the topic, on a thread of the link.

        Raises:
            CommandError: the topic's name is invalid, or it has another type.
        """

    def serve(self, service: str, answer: Answer) -> None:
        """Answer calls of a std_srvs/srv/Trigger service, on a thread of the link.

        Raises:
            CommandError: the service's name is invalid.
        """

    def health(self) -> LinkHealth:
        """Return the numbers of published and lost messages, and present problems."""

    def close(self) -> None:
        """Leave the network; never raises."""


@dataclass(frozen=True)
class Subscription(Generic[M]):
    """A callback for the messages of a topic."""

    topic: str
    kind: type[M]
    callback: Callable[[M], None]

    def deliver(self, message: M) -> None:
        """Call the callback with a message; its exceptions are logged."""
        try:
            self.callback(message)
        except Exception:
            # An error in one subscriber must not end the link for the others.
            _log.exception("the subscriber of %s failed", self.topic)


def answered(service: str, answer: Answer) -> TriggerResponse:
    """Return what a service answers; its exceptions are logged and become a failure."""
    try:
        return answer()
    except Exception as error:
        _log.exception("the service %s failed", service)
        return TriggerResponse(False, str(error))


def check_topic(topic: str) -> None:
    """Check that a topic's name is absolute and valid.

    Raises:
        CommandError: the name is invalid.
    """
    if not _TOPIC.fullmatch(topic):
        raise CommandError(
            f"topic is {topic!r}; a name such as /cmd_vel or /robot1/joint_states works"
        )


class Mailbox(Generic[T]):
    """A queue of items that a thread passes, in order, to a function that may block."""

    def __init__(
        self, handle: Callable[[T | None], bool], name: str, depth: int = INBOX
    ) -> None:
        """Start the thread.

        Args:
            handle: called on the thread with an item, or with None after `wake`;
                returns whether it succeeded.
            name: name of the thread.
            depth: capacity.
        """
        self._handle, self._depth = handle, depth
        self._items: deque[T] = deque()
        self._change = threading.Condition()
        self._woken = self._closed = False
        self.put_in = 0
        """Number of items put in."""
        self.lost = 0
        """Number of these items that were dropped or not handled successfully."""
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def put(self, item: T) -> T | None:
        """Append an item; if the queue is full, drop the oldest and return it."""
        with self._change:
            self.put_in += 1
            if self._closed:
                self.lost += 1
                return item
            dropped = None
            if len(self._items) == self._depth:
                dropped = self._items.popleft()
                self.lost += 1
            self._items.append(item)
            self._change.notify()
            return dropped

    def wake(self) -> None:
        """Call `handle` even if the queue is empty."""
        with self._change:
            self._woken = True
            self._change.notify()

    def close(self, timeout_s: float) -> None:
        """Accept no more items, and wait until the queued ones are handled.

        Args:
            timeout_s: longest time to wait [s].
        """
        with self._change:
            self._closed = True
            self._change.notify()
        self._thread.join(timeout_s)

    def _run(self) -> None:
        while True:
            with self._change:
                self._change.wait_for(
                    lambda: self._items or self._woken or self._closed
                )
                item = self._items.popleft() if self._items else None
                woken, self._woken = self._woken, False
            if item is None and not woken:
                return
            if not self._succeeded(item) and item is not None:
                with self._change:
                    self.lost += 1

    def _succeeded(self, item: T | None) -> bool:
        try:
            return self._handle(item)
        except Exception:
            # An item that cannot be handled must not end the thread.
            _log.exception("%s: lost %s", self._thread.name, item)
            return False
