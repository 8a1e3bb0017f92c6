"""The interface of a link that transports ROS 2 messages, and common parts of links."""

import logging
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, Protocol

from gaitchain.backends.base import LinkHealth
from gaitchain.backends.ros.messages import M, Message
from gaitchain.errors import CommandError

Letter = tuple[str, Message]
"""A message to send, with its topic."""
_log = logging.getLogger(__name__)
_TOPIC = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)+")


class RosLink(Protocol):
    """A link to a ROS 2 network. Its peer may connect and disconnect at any time."""

    mixes_types: bool
    """Whether one topic may carry messages of two types."""

    def advertise(self, topic: str, kind: type[Message]) -> None:
        """Announce that the topic will be published.

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


def check_topic(topic: str) -> None:
    """Check that a topic's name is absolute and valid.

    Raises:
        CommandError: the name is invalid.
    """
    if not _TOPIC.fullmatch(topic):
        raise CommandError(
            f"topic is {topic!r}; a name such as /cmd_vel or /robot1/joint_states works"
        )
