"""What the routes of the HTTP API work on."""

from dataclasses import dataclass
from pathlib import Path

import msgspec
from starlette.requests import HTTPConnection

from gaitchain.gait.library import GaitLibrary
from gaitchain.robot.box_robot import anatomy_of
from gaitchain.service.api_feed import Feed
from gaitchain.service.api_limits import Limits
from gaitchain.service.channel import Asker
from gaitchain.service.command_gateway import PUSH_MOST, Desk
from gaitchain.service.fall_watch import FallWatch
from gaitchain.service.frame import Framer
from gaitchain.service.library_json import library_info
from gaitchain.service.proxy import Viewer
from gaitchain.service.settings import Settings
from gaitchain.service.stream import Hub


@dataclass(frozen=True)
class Service:
    """One service's way to its loop, its clients, and its 3-D view."""

    feed: Feed
    desk: Desk
    hub: Hub
    viewer: Viewer
    library: bytes
    """`LibraryInfo` as JSON."""
    token: str


def make_service(
    settings: Settings,
    library: GaitLibrary,
    limits: Limits,
    folder: Path,
    asker: Asker,
) -> Service:
    """Put a service together; its feed is not started yet.

    Args:
        settings: of the service.
        library: that the loop walks.
        limits: how much it takes from its clients.
        folder: of the channels.
        asker: the way to the loop.
    """
    biped, most_ns = library.biped, push_most_ns(settings, library)
    feed = Feed(folder, FallWatch(biped, library.timing), limits.silent_s)
    desk = Desk(feed, asker, library.command_range, most_ns)
    return Service(
        feed=feed,
        desk=desk,
        hub=Hub(feed, desk, Framer(biped, simulated=most_ns is not None), limits),
        viewer=Viewer(settings.viewer_port, limits),
        library=msgspec.json.encode(library_info(library)),
        token=settings.token,
    )


def push_most_ns(settings: Settings, library: GaitLibrary) -> float | None:
    """Return the hardest push; None where the robot is none to be pushed [N s]."""
    simulated = settings.backend == "mujoco" and settings.replay is None
    return PUSH_MOST * anatomy_of(library.biped).mass if simulated else None


async def service_of(connection: HTTPConnection) -> Service:
    """Return the service that a request or a socket is for."""
    found: Service = connection.app.state.service
    return found
