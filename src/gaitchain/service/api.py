"""The part that serves page, REST, telemetry stream and 3-D view on one port."""

import asyncio
import threading
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, closing
from importlib.metadata import version
from pathlib import Path

import msgspec
from fastapi import FastAPI
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from uvicorn import Server

from gaitchain.errors import ServiceError
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.library_file import load_library
from gaitchain.service.api_feed import Feed
from gaitchain.service.api_limits import ApiLimits
from gaitchain.service.api_routes import Service, add_routes
from gaitchain.service.api_schema import complete
from gaitchain.service.api_transport import listen, server_of
from gaitchain.service.auth import Gate, problem
from gaitchain.service.channel import Asker
from gaitchain.service.command_gateway import CommandGateway, RefusedError
from gaitchain.service.disturbance_limits import disturbance_limits
from gaitchain.service.fall_watch import FallWatch
from gaitchain.service.frame import Framer
from gaitchain.service.library_json import library_info
from gaitchain.service.part import SERVED
from gaitchain.service.proxy import Viewer
from gaitchain.service.pulse import Pulse, part_pulse
from gaitchain.service.robots import kind_of
from gaitchain.service.schemas import fault_text, unread_text
from gaitchain.service.settings import Settings, is_loopback, load_settings
from gaitchain.service.sight import Sight
from gaitchain.service.stream import Hub

_BEAT_S = 0.2


def run(folder: Path, ended: threading.Event) -> None:
    """Serve.

    Args:
        folder: of the service: its settings and channels.
        ended: ends it when it is set.

    Raises:
        GaitchainError: the address cannot be served on, or the library cannot be read.
    """
    settings, limits = load_settings(folder), ApiLimits()
    check_guarded(settings)
    with listen(settings.host, settings.port) as listening:
        (folder / SERVED).touch()
        app = make_app(settings, folder, limits=limits)
        server = server_of(app, limits)
        threading.Thread(target=_end, args=[server, ended], daemon=True).start()
        server.run(sockets=[listening])


def _end(server: Server, ended: threading.Event) -> None:
    ended.wait()
    server.should_exit = True


def check_guarded(settings: Settings) -> None:
    """Refuse to let other machines in without a token.

    Raises:
        ServiceError: there is none.
    """
    if settings.token or is_loopback(settings.host):
        return
    raise ServiceError(
        f"--host {settings.host} lets other machines in: give a --token-file, or "
        "serve on 127.0.0.1"
    )


def make_app(
    settings: Settings,
    folder: Path,
    library: GaitLibrary | None = None,
    limits: ApiLimits | None = None,
) -> FastAPI:
    """Make the app of one service; it talks to the loop while it is served.

    Args:
        settings: of the service.
        folder: of its channels.
        library: the gait library; that of the settings by default.
        limits: how much it takes from its clients.

    Raises:
        LibraryError: the library cannot be read.
    """
    limits = limits or ApiLimits()
    library = library or load_library(settings.library)

    @asynccontextmanager
    async def serving(app: FastAPI) -> AsyncIterator[None]:
        asker = Asker(folder)
        service = make_service(settings, library, limits, folder, asker)
        app.state.service = service
        service.feed.start()
        try:
            async with _beating(folder):
                yield
        finally:
            service.feed.close()
            await service.viewer.close()
            asker.close()

    app = bare_app(serving)
    complete(app, library.command_range, disturbance_limits(settings, library))
    app.add_middleware(Gate, settings=settings, limits=limits)
    return app


@asynccontextmanager
async def _beating(folder: Path) -> AsyncIterator[None]:
    """Show that the loop which answers requests goes round."""
    with closing(part_pulse(folder, "api")) as pulse:
        beating = asyncio.create_task(_beat(pulse))
        try:
            yield
        finally:
            beating.cancel()


async def _beat(pulse: Pulse) -> None:
    while True:
        pulse.beat()
        await asyncio.sleep(_BEAT_S)


def bare_app(lifespan: object = None) -> FastAPI:
    """Return the app without what it works on: routes and errors.

    Args:
        lifespan: what begins and ends with it, as FastAPI takes it.
    """
    app = FastAPI(
        title="gaitchain",
        version=version("gaitchain"),
        summary="Drive and watch a walking humanoid.",
        docs_url=None,  # their pages load scripts from elsewhere
        redoc_url=None,
        redirect_slashes=False,
        lifespan=lifespan,  # type: ignore[arg-type]
    )
    add_routes(app)
    for error in (RefusedError, RequestValidationError, HTTPException):
        app.add_exception_handler(error, _failed)
    return app


def make_service(
    settings: Settings,
    library: GaitLibrary,
    limits: ApiLimits,
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
    span, disturbs = library.command_range, disturbance_limits(settings, library)
    feed = Feed(folder, FallWatch(library), limits.silent_s)
    replays = settings.replay is not None
    gateway = CommandGateway(feed, asker, library, disturbs, limits, replays=replays)
    framer = Framer(library.robot, span, kind_of(settings))
    return Service(
        feed=feed,
        gateway=gateway,
        hub=Hub(feed, gateway, framer, limits, Sight(folder)),
        viewer=Viewer(settings.viewer_port, limits, settings.viewer_secret),
        library=msgspec.json.encode(library_info(library, disturbs)),
        token=settings.token,
    )


async def _failed(_: Request, error: Exception) -> Response:
    """Say why a request failed."""
    match error:
        case RefusedError():
            return problem(error.status, str(error))
        case RequestValidationError():
            return problem(422, fault_text(error.errors()))
        case HTTPException(status_code=400):
            # FastAPI answers so where Python's JSON reader gives up.
            return problem(422, unread_text(error.__cause__))
        case HTTPException():
            return problem(error.status_code, error.detail, dict(error.headers or {}))
    raise error
