"""ROS 2 without a ROS install: drive robots by it, and take commands from it."""

# ruff: noqa: PLC0415 - rosbags, Zenoh and WebSockets load only where a link needs them.

import os
from collections.abc import Callable
from functools import partial

from gaitchain.backends.ros.backend import (
    RobotTopics,
    RosBackend,
    RosEffortBackend,
)
from gaitchain.backends.ros.link import RosLink
from gaitchain.backends.ros.pilot import PilotTopics, RosPilot
from gaitchain.errors import CommandError, needed_by

__all__ = [
    "PilotTopics",
    "RobotTopics",
    "RosBackend",
    "RosEffortBackend",
    "RosLink",
    "RosPilot",
    "check_link",
    "open_link",
]


def open_link(spec: str, *, node: str = "gaitchain") -> RosLink:
    """Open a link to a ROS 2 network.

    Nodes and servers may start later, except a Zenoh router on another computer.
    The domain is that of the environment variable ROS_DOMAIN_ID, 0 by default.

    Args:
        spec: "zenoh" (nodes with rmw_zenoh, their router on this computer),
            "zenoh:tcp/HOST:7447" (their router elsewhere), or "ws://HOST:9090" (a
            rosbridge_server).
        node: name under which other nodes see this one; not through a rosbridge.

    Raises:
        CommandError: `spec` is not one of these links.
        MissingExtraError: a package for it is not installed.
        BackendError: there is no Zenoh router on the other computer.
    """
    return _opener(spec, node)()


def check_link(spec: str) -> None:
    """Refuse a link that `open_link` does not know; nothing is opened.

    Args:
        spec: as `open_link` takes it.

    Raises:
        CommandError: `spec` is not one of its links.
        MissingExtraError: a package for it is not installed.
    """
    _opener(spec, "gaitchain")


def _opener(spec: str, node: str) -> Callable[[], RosLink]:
    """Return what opens a link, once its name is checked."""
    kind, _, endpoint = spec.partition(":") if isinstance(spec, str) else [""] * 3
    if kind == "zenoh" and (endpoint or spec == "zenoh"):
        with needed_by("ROS 2 over Zenoh"):
            from gaitchain.backends.ros.zenoh_link import (
                ROUTER,
                ZenohLink,
                check_endpoint,
            )
        router, domain = endpoint or ROUTER, _domain()
        check_endpoint(router, domain)
        return partial(ZenohLink, router, domain=domain, node=node)
    if kind in ("ws", "wss"):
        with needed_by("ROS 2 over a rosbridge"):
            from gaitchain.backends.ros.rosbridge_link import RosbridgeLink, check_url

        check_url(spec)
        return partial(RosbridgeLink, spec)
    raise CommandError(
        f"no link to ROS is {spec!r:.80}; zenoh, zenoh:tcp/HOST:7447 and "
        "ws://HOST:9090 are"
    )


def _domain() -> int:
    """Return the ROS domain id from the environment."""
    text = os.environ.get("ROS_DOMAIN_ID") or "0"
    if not text.isdecimal():
        raise CommandError(f"ROS_DOMAIN_ID is {text!r}, must be a number, 0 to 232")
    return int(text)
