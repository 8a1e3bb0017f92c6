"""The HTTP API as one ASGI app: routes behind the gate, and what they work on."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from importlib.metadata import version
from pathlib import Path

from fastapi import FastAPI
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response

from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.library_file import load_library
from gaitchain.service.api_limits import Limits
from gaitchain.service.api_routes import add_routes
from gaitchain.service.api_schema import complete
from gaitchain.service.api_service import make_service, push_most_ns
from gaitchain.service.auth import Gate, problem
from gaitchain.service.channel import Asker
from gaitchain.service.command_gateway import RefusedError
from gaitchain.service.schemas import fault_text
from gaitchain.service.settings import Settings


def make_app(
    settings: Settings,
    folder: Path,
    library: GaitLibrary | None = None,
    limits: Limits | None = None,
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
    limits = limits or Limits()
    library = library or load_library(settings.library)

    @asynccontextmanager
    async def serving(app: FastAPI) -> AsyncIterator[None]:
        asker = Asker(folder)
        service = make_service(settings, library, limits, folder, asker)
        app.state.service = service
        service.feed.start()
        try:
            yield
        finally:
            service.feed.close()
            await service.viewer.close()
            asker.close()

    app = bare_app(serving)
    complete(app, library.command_range, push_most_ns(settings, library))
    app.add_middleware(Gate, settings=settings, limits=limits)
    return app


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
    app.add_exception_handler(RefusedError, _refused)
    app.add_exception_handler(RequestValidationError, _unreadable)
    app.add_exception_handler(HTTPException, _http_error)
    return app


async def _refused(_: Request, error: Exception) -> Response:
    if not isinstance(error, RefusedError):
        raise error
    return problem(error.status, str(error))


async def _unreadable(_: Request, error: Exception) -> Response:
    if not isinstance(error, RequestValidationError):
        raise error
    return problem(422, fault_text(error.errors()))


async def _http_error(_: Request, error: Exception) -> Response:
    if not isinstance(error, HTTPException):
        raise error
    # FastAPI answers 400 where Python's JSON reader gives up.
    status = 422 if error.status_code == 400 else error.status_code
    return problem(status, error.detail, dict(error.headers or {}))
