"""Names in the protocol of rmw_zenoh: keys, liveliness tokens, ids of publishers.

Source: the design document of rmw_zenoh. No I/O.
"""

import hashlib
from dataclasses import dataclass

_GID = 16
# Differences from rmw_zenoh's default QoS: reliable, volatile, keep the last 10.
_QOS = "::,10:,:,:,,"
_LATCHED = ":1:,1:,:,:,,"  # transient local, keep the last one
TRIGGER_HASH = "RIHS01_eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f"
"""Hash of std_srvs/srv/Trigger: of the service, not of its two messages."""


@dataclass(frozen=True)
class Topic:
    """A topic with messages of one type."""

    name: str
    """Absolute name of the topic."""
    type_name: str
    """Message type, such as "geometry_msgs/msg/Twist"."""
    type_hash: str
    """Hash of the type, such as "RIHS01_9c45...", in ROS since Iron."""
    latched: bool = False
    """Whether it is transient local."""


@dataclass(frozen=True)
class Node:
    """The names of a ROS node in a Zenoh session, and of its publishers."""

    domain: int
    """ROS_DOMAIN_ID"""
    session: str
    """Id of the Zenoh session, hexadecimal."""
    name: str

    @property
    def token(self) -> str:
        """Liveliness token of the node."""
        return f"@ros2_lv/{self.domain}/{self.session}/0/0/NN/%/%/{self.name}"

    def key(self, topic: Topic) -> str:
        """Return the Zenoh key of a topic."""
        return (
            f"{self.domain}/{topic.name.strip('/')}/{dds_name(topic.type_name)}/"
            f"{topic.type_hash}"
        )

    def end_token(self, entity: int, kind: str, topic: Topic) -> str:
        """Return the liveliness token of a publisher or a subscriber.

        Args:
            entity: number of the publisher or subscriber in the node, from 1.
            kind: "MP" for a publisher, "MS" for a subscriber, "SS" for a service.
            topic: topic of the messages, or the service.
        """
        qos = _LATCHED if topic.latched else _QOS
        return (
            f"@ros2_lv/{self.domain}/{self.session}/0/{entity}/{kind}/%/%/{self.name}/"
            f"{topic.name.replace('/', '%')}/{dds_name(topic.type_name)}/"
            f"{topic.type_hash}/{qos}"
        )


def dds_name(type_name: str) -> str:
    """Return the DDS name of a message type.

    >>> dds_name("geometry_msgs/msg/Twist")
    'geometry_msgs::msg::dds_::Twist_'
    """
    package, kind, name = type_name.split("/")
    return f"{package}::{kind}::dds_::{name}_"


def gid_of(token: str) -> bytes:
    """Return a publisher's id of 16 bytes.

    rmw_zenoh uses XXH3 of the token. Subscribers only distinguish publishers by the
    id, so any hash of the token is valid.
    """
    return hashlib.blake2b(token.encode(), digest_size=_GID).digest()
