"""The HTTP API as it is served, on a free port of this computer, and a loop for it."""

import queue
import threading
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

import httpx
import numpy as np
from patience import PATIENCE_S, Deadline
from telemetry_factory import told
from verdicts import PASSED
from websockets.sync.client import connect

from gaitchain.chain.layered_chain import LayeredChain
from gaitchain.gait.build_config import BuildConfig
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.stride.shape import StrideShape
from gaitchain.gait.stride.strides import StridePoses
from gaitchain.live.driver_lease import DriverLease
from gaitchain.live.messages import Disturb, Drive, LetGo, PushRobot, Reset, Rest, Start
from gaitchain.robot.box_robot import load_box_robot
from gaitchain.service.api import make_app
from gaitchain.service.api_limits import ApiLimits
from gaitchain.service.api_transport import listen, server_of
from gaitchain.service.channel import LoopEnd
from gaitchain.service.settings import Settings

TOKEN = "a secret+token/of=the tests"
API = "/api/v1"
_PERIOD_S = 0.004
_TAKES = Disturb, PushRobot, Reset, Rest, Start


@cache
def small_library():
    """Five strides in every direction, that nobody has walked."""
    robot, shape = load_box_robot("res"), StrideShape()
    leg = robot.reduced.leg_length
    ways = np.array([[1, 0, 0], [-1, 0, 0], [0, 0, 0], [0, 1, 0], [0, 0, 1]]) * 0.3
    strides = np.vstack([np.zeros(3), ways])
    shapes = np.array([[0.5, 1.4, shape.lift * leg]]), np.array([[0.08, 0.1]])
    poses = StridePoses(robot, shape.hip_height * leg, (strides, *shapes, strides))
    costs = tuple(np.full(sizes, 0.5) for sizes in pairwise(poses.counts))
    costs[0][1, 0] = np.inf
    pairs = np.ones((len(strides), len(strides)), dtype=np.int64)
    return GaitLibrary(
        poses=poses,
        timing=shape.timing(robot),
        chain=LayeredChain(tuple(np.full(c.shape, 1.0 / c.shape[1]) for c in costs)),
        edge_costs=costs,
        path_costs=costs,
        pair_advance=pairs * 0.1,
        pair_error=pairs * 0.01,
        pair_slip=pairs * 0.1,
        pair_runs=pairs,
        pair_passes=pairs,
        config=BuildConfig(robot="res", preset="brisk"),
        qualification=PASSED,
    )


class FakeLoop:
    """Tells that the robot stands, 250 times a second, and takes requests."""

    def __init__(self, folder, *, shared=False, silent=False):
        """Begin.

        Args:
            folder: of the channels.
            shared: whether anybody may drive.
            silent: whether it tells nothing.
        """
        self.asked = queue.Queue()
        self.changes = {}
        self.silent, self.deaf = threading.Event(), threading.Event()
        if silent:
            self.silent.set()
        self.time_s, self._ticks = 0.0, 0
        self._lease = None if shared else DriverLease()
        self._end, self._told = LoopEnd(folder), queue.Queue()
        self._happened = queue.Queue()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="fake loop")
        self._thread.start()

    def tell(self, *telemetries):
        """Publish these next, as they are."""
        for telemetry in telemetries:
            self._told.put(telemetry)

    def happen(self, *events):
        """Put events into the next telemetry."""
        self._happened.put(events)

    def begin_anew(self):
        """Go on with the time of a loop that has just begun."""
        self._ticks = 0

    def grow_old(self):
        """Go on with the time of a loop that has run for an hour."""
        self._ticks = round(3600.0 / _PERIOD_S)

    def until_asked(self, *kinds):
        """Return the next request of these kinds."""
        while not isinstance(request := self.asked.get(timeout=PATIENCE_S), kinds):
            pass
        return request

    def until(self, expected):
        """Wait for this very request; earlier ones may still be on the way."""
        while self.asked.get(timeout=PATIENCE_S) != expected:
            pass

    def pause(self):
        """Wait a moment; less if the loop ends."""
        self._ended.wait(2 * _PERIOD_S)

    def close(self):
        self._ended.set()
        self._thread.join()
        self._end.close()

    def _run(self):
        robot = small_library().robot
        while True:
            if self._ended.wait(_PERIOD_S):
                return
            if not self.deaf.is_set():
                self._listen()
            while not self._told.empty():
                told_next = self._told.get()
                if isinstance(told_next, bytes):  # damaged
                    self._end._telemetry.send(told_next)
                else:
                    self._end.publish(told_next)
            if self.silent.is_set():
                continue
            self.time_s, self._ticks = self._ticks * _PERIOD_S, self._ticks + 1
            driver = "" if self._lease is None else self._lease.driver
            values = {"driver": driver, "events": self._news(), **self.changes}
            self._end.publish(told(robot, self.time_s, **values))

    def _news(self):
        try:
            return self._happened.get_nowait()
        except queue.Empty:
            return ()

    def _listen(self):
        for request in self._end.requests():
            if self._lease is not None and isinstance(request, Drive):
                self._lease.drive(request, self.time_s)
            elif self._lease is not None and isinstance(request, LetGo):
                self._lease.let_go(request.driver)
            elif self._lease is not None and isinstance(request, _TAKES):
                self._lease.acquire(request.driver, self.time_s)
            self.asked.put(request)


@dataclass
class Served:
    """A server that answers."""

    port: int
    loop: FakeLoop
    app: object
    client: httpx.Client

    def stream(self, query="hz=100", **options):
        """Open a socket of the telemetry stream."""
        return self.socket(f"{API}/stream?{query}", **options)

    def socket(self, path, token=TOKEN, headers=(), **options):
        """Open a socket anywhere."""
        known = [("Authorization", f"Bearer {token}")] if token else []
        return connect(
            f"ws://127.0.0.1:{self.port}{path}",
            additional_headers=[*known, *headers],
            proxy=None,
            **{"open_timeout": PATIENCE_S, "close_timeout": PATIENCE_S, **options},
        )

    def until(self, happens):
        """Ask again and again until something is so; return what it gave."""
        deadline = Deadline()
        while not (found := happens()):
            assert not deadline.passed(), "it never was"
            self.loop.pause()
        return found

    def until_driver(self, name):
        """Wait until somebody drives, or nobody."""
        self.until(lambda: self.client.get(f"{API}/state").json()["driver"] == name)

    def drive(self, driver, **motion):
        """Ask for a motion; return the answer."""
        return self.client.put(
            f"{API}/command", json=motion, headers={"X-Driver": driver}
        )


@contextmanager
def served(limits=None, *, shared=False, live=True, **settings):
    """Serve as `gaitchain serve` does, from here until the end of the block.

    Args:
        limits: of the server.
        shared: whether anybody may drive.
        live: whether the loop tells anything, and has been heard.
        settings: other than the usual.
    """
    limits = limits or ApiLimits(requests_per_s=1e6)
    told_settings = Settings(**{"library": "", "token": TOKEN, **settings})
    with TemporaryDirectory(prefix="api-") as name:
        folder = Path(name)
        loop = FakeLoop(folder, shared=shared, silent=not live)
        app = make_app(told_settings, folder, small_library(), limits)
        with listen("127.0.0.1", 0) as listening:
            port = listening.getsockname()[1]
            server = server_of(app, limits)
            thread = threading.Thread(target=server.run, args=([listening],))
            thread.start()
            try:
                with _client(port) as client:
                    here = Served(port, loop, app, client)
                    if live:
                        await_telemetry(here)
                    yield here
            finally:
                server.should_exit = True
                thread.join()
                loop.close()


async def nothing_asked(scope, receive, send):
    """An app that begins and ends; nothing is asked of it."""
    while scope["type"] == "lifespan":
        message = await receive()
        await send({"type": f"{message['type']}.complete"})
        if message["type"] == "lifespan.shutdown":
            return


def await_telemetry(here):
    """Wait for the first frame."""
    with here.stream() as socket:
        assert '"type":"frame"' in socket.recv(timeout=PATIENCE_S)


def _client(port):
    return httpx.Client(
        base_url=f"http://127.0.0.1:{port}",
        headers={"Authorization": f"Bearer {TOKEN}"},
        timeout=PATIENCE_S,
        trust_env=False,
    )
