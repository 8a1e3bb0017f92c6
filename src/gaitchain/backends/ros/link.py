"""What carries ROS 2 messages: the protocol of a link, and what links share."""

import logging
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

from gaitchain.backends.base import LinkHealth
from gaitchain.backends.ros.messages import Message
from gaitchain.errors import CommandError

M = TypeVar("M", bound=Message)
Letter = tuple[str, Message]
"""What is to be sent: topic and message."""
_log = logging.getLogger(__name__)
_TOPIC = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)+")


class RosLink(Protocol):
    """A way into a ROS 2 network. Its peer may come, go and come back."""

    mixes_types: bool
    """Whether one topic may carry messages of two types."""

    def advertise(self, topic: str, kind: type[Message]) -> None:
        """Let others see that the topic will be published.

        Raises:
            CommandError: the topic's name cannot be.
        """

    def publish(self, topic: str, message: Message) -> None:
        """Send a message some time soon; never waits, whoever does not listen.

        Of what cannot be sent in time the oldest is dropped, and counted as lost.

        Raises:
            CommandError: the topic's name cannot be.
        """

    def subscribe(
        self, topic: str, kind: type[M], callback: Callable[[M], None]
    ) -> None:
        """Hand each message of the topic to the callback, on a thread of the link.

        Raises:
            CommandError: the topic's name cannot be, or it carries another type.
        """

    def health(self) -> LinkHealth:
        """Return how many messages were given to `publish`, and what became of them."""

    def close(self) -> None:
        """Leave the network; never raises."""


@dataclass(frozen=True)
class Subscription(Generic[M]):
    """Who wants which messages of a topic."""

    topic: str
    kind: type[M]
    callback: Callable[[M], None]

    def deliver(self, message: M) -> None:
        """Hand over a message; what the callback raises is logged."""
        try:
            self.callback(message)
        except Exception:
            # A subscriber's fault must not end the link for the others.
            _log.exception("the subscriber of %s failed", self.topic)


def check_topic(topic: str) -> None:
    """Check an absolute name of a topic.

    Raises:
        CommandError: it is none.
    """
    if not _TOPIC.fullmatch(topic):
        raise CommandError(
            f"topic is {topic!r}; a name such as /cmd_vel or /robot1/joint_states works"
        )
