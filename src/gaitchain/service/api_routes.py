"""The routes of the HTTP API: REST, the telemetry stream, the page and the 3-D view."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import msgspec
from fastapi import Depends, FastAPI, Header, Query
from starlette.requests import HTTPConnection, Request
from starlette.responses import FileResponse, Response
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket

from gaitchain.service.api_feed import Feed
from gaitchain.service.api_schema import answers
from gaitchain.service.auth import API, VIEWER, forget, problem, remember, same_secret
from gaitchain.service.command_gateway import CommandGateway
from gaitchain.service.proxy import Viewer
from gaitchain.service.schemas import (
    DRIVER_PATTERN,
    Asked,
    DisturbanceRequest,
    Events,
    Fall,
    FootstepsRequest,
    GoalRequest,
    Health,
    LibraryInfo,
    LinkState,
    Login,
    LoopHealth,
    Motion,
    PushRequest,
    ReplayRequest,
    Steering,
    TelemetryFrame,
)
from gaitchain.service.stream import Hub

_PAGE = Path(__file__).parent / "page"
_LAST_NUMBER = 2**53


@dataclass(frozen=True)
class Service:
    """One service's way to its loop, its clients, and its 3-D view."""

    feed: Feed
    gateway: CommandGateway
    hub: Hub
    viewer: Viewer
    library: bytes
    """`LibraryInfo` as JSON."""
    token: str


async def service_of(connection: HTTPConnection) -> Service:
    """Return the service that a request or a socket is for."""
    found: Service = connection.app.state.service
    return found


Here = Annotated[Service, Depends(service_of)]
Driver = Annotated[
    str,
    Header(
        alias="X-Driver",
        pattern=DRIVER_PATTERN,
        description="Who asks, of your choice.",
    ),
]


async def _named(
    driver: Annotated[
        str,
        Header(
            alias="X-Driver",
            description="Who asks; what is no name of a driver counts as rest.",
        ),
    ] = "rest",
) -> str:
    """Return who asks, for what a bad name must not keep back."""
    return driver if re.fullmatch(DRIVER_PATTERN, driver) else "rest"


Anyone = Annotated[str, Depends(_named)]
Number = Annotated[
    int,
    Query(
        ge=0,
        le=_LAST_NUMBER,
        description="Only events with higher numbers; all events where it is above the "
        "newest one, as of a server before this one: each counts anew.",
    ),
]


async def state(here: Here) -> Response:
    """Robot and loop now, as one frame of the stream."""
    frame = here.hub.frame()
    if frame is None:
        return problem(503, here.hub.feed.why_silent)
    return _json_bytes(frame)


async def library(here: Here) -> Response:
    """Robot, limits and Markov chain of the gait library."""
    return _json_bytes(here.library)


async def command(motion: Motion, here: Here, driver: Driver = "rest") -> Response:
    """Ask for a motion. It counts for 0.5 s, so repeat it at 10 Hz.

    The first driver to ask has the wheel until it lets go or is silent for 3 s.
    Together the three share the range: what is carried out, and why, is in the frame.
    """
    here.gateway.drive(driver, motion)
    return _json(Asked("drive", driver), 202)


async def steering(steering: Steering, here: Here, driver: Driver = "rest") -> Response:
    """Ask for parts of the library's range, as a stick is pulled; else like a command.

    What command they make is in the frame, as `asked`.
    """
    here.gateway.steer(driver, steering)
    return _json(Asked("steer", driver), 202)


async def go_to(goal: GoalRequest, here: Here, driver: Driver = "rest") -> Response:
    """Walk to a place and stand there, as far as the robot's own steps tell.

    Repeat it within 3 s: who is silent is lost, and the robot stops. A command, a stop,
    or another driver ends it, too. How far it is, is in the frame as `going`.
    """
    here.gateway.go_to(driver, goal)
    return _json(Asked("go_to", driver), 202)


async def follow_steps(
    footsteps: FootstepsRequest, here: Here, driver: Driver = "rest"
) -> Response:
    """Make footsteps from a stand, then stand. Repeat it as a goal is repeated.

    A step that the chain cannot make after the one before is refused by its number,
    with what could be made, and the robot stays where it is.
    """
    here.gateway.follow_steps(driver, footsteps)
    return _json(Asked("follow_steps", driver), 202)


async def push(push: PushRequest, here: Here, driver: Driver = "rest") -> Response:
    """Push a body of a simulated robot for 0.1 s."""
    here.gateway.push(driver, push)
    return _json(Asked("push", driver), 202)


async def disturb(
    wanted: DisturbanceRequest, here: Here, driver: Driver = "rest"
) -> Response:
    """Change what disturbs a simulated robot, until changed again; a reset keeps it.

    What is left out stays as it is, and null takes it away. Every frame has the state.
    """
    here.gateway.disturb(driver, wanted)
    return _json(Asked("disturb", driver), 202)


async def replay(
    wanted: ReplayRequest, here: Here, driver: Driver = "rest"
) -> Response:
    """Pause a log that is played, go on, elsewhere, or at another speed."""
    here.gateway.play(driver, wanted)
    return _json(Asked("replay", driver), 202)


def _act(what: str, text: str) -> Callable[..., Any]:
    """Return the route that asks for what needs no numbers."""

    async def act(here: Here, driver: Driver = "rest") -> Response:
        here.gateway.act(driver, what)
        return _json(Asked(what, driver), 202)

    act.__name__, act.__doc__ = what, text
    return act


def _stop(what: str, text: str) -> Callable[..., Any]:
    """Return the route that stops the robot, whatever the driver calls itself."""

    async def stop(here: Here, driver: Anyone) -> Response:
        here.gateway.act(driver, what)
        return _json(Asked(what, driver), 202)

    stop.__name__, stop.__doc__ = what, text
    return stop


start = _act("start", "Torque on, and slowly up to the standing pose.")
stop = _stop(
    "stop", "Stop walking and stand; while it gets up, torque off. Anybody may."
)
rest = _act("rest", "Torque off, from standing.")
reset = _act(
    "reset", "Leave safe or stopped; a simulated robot is put back on its feet."
)
get_up = _act(
    "get_up",
    "Get up after a fall, where the frame says `can_get_up`; it takes some seconds.",
)
emergency_stop = _stop(
    "emergency_stop",
    "Torque off at once. Anybody may; it overtakes everything else.",
)
let_go = _act("let_go", "Let another one drive; the robot stops walking.")


async def events(here: Here, after: Number = 0) -> Response:
    """Return the latest events, 200 at most, oldest first."""
    return _json(Events(here.feed.events_after(after)))


async def fall(here: Here) -> Response:
    """Why the robot fell last."""
    found = here.feed.fall
    if found is None:
        return problem(404, "the robot has not fallen since this server began")
    return _json(found)


async def health(here: Here) -> Response:
    """How loop, link and stream do; 503 with the same content if the loop is silent."""
    now = here.feed.latest
    loop = link = None
    if now is not None:
        loop = LoopHealth(now.mode.value, now.reason, now.pace)
        link = LinkState.of(now)
    clients, dropped = here.hub.clients, here.hub.dropped
    found = Health(loop, link, clients, here.viewer.clients, dropped)
    return _json(found, 503 if now is None else 200)


async def sign_in(request: Request, login: Login, here: Here) -> Response:
    """Put the token into a cookie, so that a browser may come in."""
    if here.token and not same_secret(login.token, here.token):
        return problem(401, "a wrong token", {"www-authenticate": "Bearer"})
    answer = Response(status_code=204)
    if here.token:
        remember(answer, request, login.token)
    return answer


async def sign_out(request: Request) -> Response:
    """Take the cookie back."""
    answer = Response(status_code=204)
    forget(answer, request)
    return answer


async def page() -> Response:
    """The page."""
    return FileResponse(_PAGE / "index.html")


async def viewer_page(request: Request, here: Here) -> Response:
    """A file of the 3-D view."""
    return await here.viewer.page(request)


async def viewer_socket(socket: WebSocket) -> None:
    """The 3-D view's own socket."""
    await (await service_of(socket)).viewer.socket(socket)


async def stream(socket: WebSocket) -> None:
    """Frames of telemetry out, requests of a driver in."""
    await (await service_of(socket)).hub.serve(socket)


def _json(content: msgspec.Struct, status: int = 200) -> Response:
    return _json_bytes(msgspec.json.encode(content), status)


def _json_bytes(content: bytes, status: int = 200) -> Response:
    return Response(content, status, media_type="application/json")


class _Route(NamedTuple):
    """A route of the REST API."""

    method: str
    path: str
    work: Callable[..., Any]
    answer: tuple[int, type[msgspec.Struct] | None]
    """Status when all goes well, and what is sent."""
    refusals: tuple[int, ...]
    same: tuple[int, ...] = ()
    """Other statuses with that answer."""


_READ, _WRITE = (401, 403, 429), (401, 403, 413, 429)
_ASK = (*_WRITE, 409, 422, 503)
_ROUTES = (
    _Route("GET", "/state", state, (200, TelemetryFrame), (*_READ, 503)),
    _Route("GET", "/library", library, (200, LibraryInfo), _READ),
    _Route("GET", "/events", events, (200, Events), (*_READ, 422)),
    _Route("GET", "/fall", fall, (200, Fall), (*_READ, 404)),
    _Route("GET", "/health", health, (200, Health), _READ, (503,)),
    _Route("PUT", "/command", command, (202, Asked), _ASK),
    _Route("PUT", "/steering", steering, (202, Asked), _ASK),
    _Route("PUT", "/goal", go_to, (202, Asked), _ASK),
    _Route("PUT", "/footsteps", follow_steps, (202, Asked), _ASK),
    _Route("POST", "/start", start, (202, Asked), _ASK),
    _Route("POST", "/stop", stop, (202, Asked), (*_READ, 422, 503)),
    _Route("POST", "/rest", rest, (202, Asked), _ASK),
    _Route("POST", "/reset", reset, (202, Asked), _ASK),
    _Route("POST", "/get-up", get_up, (202, Asked), _ASK),
    _Route("POST", "/emergency-stop", emergency_stop, (202, Asked), (*_READ, 422, 503)),
    _Route("POST", "/push", push, (202, Asked), _ASK),
    _Route("PATCH", "/disturbances", disturb, (202, Asked), _ASK),
    _Route("PATCH", "/replay", replay, (202, Asked), _ASK),
    _Route("DELETE", "/driver", let_go, (202, Asked), (*_WRITE, 422, 503)),
    _Route("POST", "/session", sign_in, (204, None), (*_WRITE, 422)),
    _Route("DELETE", "/session", sign_out, (204, None), _WRITE),
)


def add_routes(app: FastAPI) -> None:
    """Put every route and socket into an app.

    Args:
        app: whose `state.service` is a `Service` once it serves.
    """
    for route in _ROUTES:
        status, content = route.answer
        app.add_api_route(
            API + route.path,
            route.work,
            methods=[route.method],
            status_code=status,
            response_class=Response,
            responses=answers((status, *route.same), content, route.refusals),
            operation_id=route.work.__name__,
        )
    app.add_api_websocket_route(f"{API}/stream", stream)
    app.add_api_route("/", page, methods=["GET", "HEAD"], include_in_schema=False)
    app.mount("/page", StaticFiles(directory=_PAGE))
    for path in (VIEWER, VIEWER + "/{path:path}"):
        app.add_api_route(path, viewer_page, include_in_schema=False)
        app.add_api_websocket_route(path, viewer_socket)
