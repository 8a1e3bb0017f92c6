"""What rmw_zenoh calls things on the wire: keys, liveliness tokens, ids of publishers.

After the design document of rmw_zenoh. No I/O.
"""

import hashlib
from dataclasses import dataclass

_GID = 16
# Reliable, volatile, keep the last 10: what differs from rmw_zenoh's defaults.
_QOS = "::,10:,:,:,,"


@dataclass(frozen=True)
class Topic:
    """A topic with messages of one type."""

    name: str
    """Absolute."""
    type_name: str
    """Such as "geometry_msgs/msg/Twist"."""
    type_hash: str
    """Such as "RIHS01_9c45...", which ROS has since Iron."""


@dataclass(frozen=True)
class Node:
    """A node of ROS in a session of Zenoh: what it and its ends are called."""

    domain: int
    """ROS_DOMAIN_ID"""
    session: str
    """Zenoh's id of the session, hexadecimal."""
    name: str

    @property
    def token(self) -> str:
        """The token by which the node is seen."""
        return f"@ros2_lv/{self.domain}/{self.session}/0/0/NN/%/%/{self.name}"

    def key(self, topic: Topic) -> str:
        """Return the key that a topic's messages are published on."""
        return (
            f"{self.domain}/{topic.name.strip('/')}/{dds_name(topic.type_name)}/"
            f"{topic.type_hash}"
        )

    def end_token(self, entity: int, kind: str, topic: Topic) -> str:
        """Return the token by which a publisher or a subscriber is seen.

        Args:
            entity: its number in the node, from 1.
            kind: "MP" for a publisher, "MS" for a subscriber.
            topic: of the messages.
        """
        return (
            f"@ros2_lv/{self.domain}/{self.session}/0/{entity}/{kind}/%/%/{self.name}/"
            f"{topic.name.replace('/', '%')}/{dds_name(topic.type_name)}/"
            f"{topic.type_hash}/{_QOS}"
        )


def dds_name(type_name: str) -> str:
    """Return a type's name as in DDS.

    >>> dds_name("geometry_msgs/msg/Twist")
    'geometry_msgs::msg::dds_::Twist_'
    """
    package, kind, name = type_name.split("/")
    return f"{package}::{kind}::dds_::{name}_"


def gid_of(token: str) -> bytes:
    """Return a publisher's 16 bytes.

    rmw_zenoh has XXH3 of the token there. Subscribers only tell publishers apart by
    it, so any hash of the token does.
    """
    return hashlib.blake2b(token.encode(), digest_size=_GID).digest()
