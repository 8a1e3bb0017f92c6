"""A small real server under the page: its files, and frames that a test writes."""

import asyncio
import json
import queue
import socket
import threading
from contextlib import contextmanager
from pathlib import Path

import msgspec
import uvicorn
from patience import PATIENCE_S
from starlette.applications import Starlette
from starlette.responses import FileResponse, HTMLResponse, JSONResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocketDisconnect
from telemetry_factory import told

import gaitchain
from gaitchain.live.messages import Choice
from gaitchain.service.disturbance_limits import disturbance_limits
from gaitchain.service.frame import Framer
from gaitchain.service.library_json import library_info
from gaitchain.service.settings import Settings

PAGE = Path(gaitchain.__file__).parent / "service" / "page"
PERIOD_S = 0.04
VIEWER = "<!doctype html><title>view</title><button>Reset view</button>"
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; "
    "connect-src 'self'; frame-src 'self'; base-uri 'none'; form-action 'self'"
)
CHOICE = Choice(
    key_moment="kp_4",
    layer=3,
    pose=2,
    target=2,
    cost=0.25,
    runners_up=((3, 0.5), (5, 0.75)),
    left_support=True,
    primitives={"length": 0.1, "outward": 0.0, "turn": 0.0},
    sizes=((0.5, 0.02), (0.75, 0.021), (1.0, 0.035)),
)


class PageServer:
    """What a page sees of a robot; a test sets `frame` and reads `messages`."""

    def __init__(self, library):
        self.library = library
        self._framer = Framer(library.robot, library.command_range, "simulation")
        self.messages = queue.Queue()  # (driver, message) of the sockets
        self.posts = queue.Queue()  # (path, driver) of the REST requests
        self.refuses = False
        self.silent = False  # whether no frames are sent
        self.hangs = False  # whether handshakes of sockets are not answered
        self.events = []
        self._sockets = {}
        self._raw = queue.Queue()
        self.set()
        self.app = Starlette(
            routes=[
                Route("/", self._file),
                Route("/viewer/", lambda _: HTMLResponse(VIEWER)),
                Mount("/page", StaticFiles(directory=PAGE)),
                Route("/api/v1/library", self._library),
                Route("/api/v1/events", self._events),
                Route("/api/v1/health", self._events),
                Route("/api/v1/{act}", self._post, methods=["POST"]),
                WebSocketRoute("/api/v1/stream", self._stream),
            ]
        )

    def set(
        self, *, scene=None, simulated=True, kind="simulation", fall=None, events=(),
        view=1, **changes,
    ):  # fmt: skip
        """Send this from now on: changes of a telemetry, its scene, its frame."""
        telemetry = told(self.library.robot, 1.0, **changes)
        raw = self._framer.json(telemetry, (), None)
        frame = json.loads(raw)
        frame["scene"].update(scene or {})
        frame.update(simulated=simulated, kind=kind, fall=fall, view=view)
        frame["events"] = list(events)
        self.frame = frame

    def send_raw(self, text):
        """Send a text to all sockets, once, between two frames."""
        self._raw.put(text)

    def drop(self):
        """Close all sockets, as a server does that ends."""
        for loop, socket_ in list(self._sockets.values()):
            asyncio.run_coroutine_threadsafe(socket_.close(1012), loop)

    def next_message(self, *kinds):
        """Return the next message of some kinds; those of others are passed over."""
        while True:
            driver, message = self.messages.get(timeout=PATIENCE_S)
            if message["type"] in kinds:
                return driver, message

    async def _file(self, _):
        return FileResponse(
            PAGE / "index.html", headers={"content-security-policy": POLICY}
        )

    async def _library(self, _):
        limits = disturbance_limits(Settings(library=""), self.library)
        body = msgspec.json.encode(library_info(self.library, limits))
        return self._checked(Response(body, media_type="application/json"))

    async def _events(self, request):
        after = int(request.query_params.get("after", 0))
        events = [event for event in self.events if event["number"] > after]
        return self._checked(JSONResponse({"events": events}))

    async def _post(self, request):
        self.posts.put((request.path_params["act"], request.headers.get("x-driver")))
        return self._checked(JSONResponse({}, 202))

    def _checked(self, answer):
        return JSONResponse({"detail": "token"}, 401) if self.refuses else answer

    async def _stream(self, stream):
        if self.refuses:
            await stream.close(1008)
            return
        if self.hangs:
            await stream.receive()  # that it wants to connect
            await stream.receive()  # that it has given up
            return
        await stream.accept()
        self._sockets[id(stream)] = asyncio.get_running_loop(), stream
        sending = asyncio.ensure_future(self._send(stream))
        try:
            while True:
                message = await stream.receive_json()
                self.messages.put((stream.query_params["driver"], message))
        except (WebSocketDisconnect, RuntimeError):
            pass
        finally:
            sending.cancel()
            del self._sockets[id(stream)]

    async def _send(self, stream):
        while True:
            while not self._raw.empty():
                await stream.send_text(self._raw.get())
            frame = self.frame
            frame["time_s"] += PERIOD_S
            if not self.silent:
                await stream.send_text(json.dumps(frame))
            await asyncio.sleep(PERIOD_S)


@contextmanager
def served(app):
    """Serve an ASGI app on a free loopback port from a thread; yield its address."""
    with socket.create_server(("127.0.0.1", 0)) as listening:
        config = uvicorn.Config(
            app,
            ws="websockets-sansio",
            log_level="error",
            timeout_graceful_shutdown=1,
        )
        server = uvicorn.Server(config)
        thread = threading.Thread(target=server.run, args=([listening],))
        thread.start()
        try:
            yield f"http://127.0.0.1:{listening.getsockname()[1]}"
        finally:
            server.should_exit = True
            thread.join()
