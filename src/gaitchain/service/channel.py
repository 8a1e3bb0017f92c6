"""Sockets between the parts of the service, in a folder that only this user can access.

ZeroMQ over Unix sockets: publishing never blocks, a slow reader misses messages, and
parts may connect and disconnect at any time.
"""

import threading
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import msgspec
import zmq

from gaitchain.live.messages import (
    EmergencyStop,
    Request,
    Telemetry,
    decode_request,
    decode_telemetry,
    encode,
)

_BACKLOG = 1000  # messages; more are dropped
_TELEMETRY, _REQUESTS, _EMERGENCY = "telemetry", "requests", "emergency"
_PROGRESS, _BEAT_S = "progress", 0.5


def address(folder: Path, name: str) -> str:
    """Return the address of a channel."""
    return f"ipc://{folder / name}"


class LoopEnd:
    """The loop's end: it publishes telemetry and takes requests, and never waits."""

    def __init__(self, folder: Path) -> None:
        """Bind the channels in a folder."""
        self._context = zmq.Context()
        self._telemetry = self._context.socket(zmq.PUB)
        self._requests = self._context.socket(zmq.PULL)
        self._emergency = self._context.socket(zmq.PULL)
        for socket, name in (
            (self._telemetry, _TELEMETRY),
            (self._requests, _REQUESTS),
            (self._emergency, _EMERGENCY),
        ):
            socket.setsockopt(zmq.LINGER, 0)
            socket.set_hwm(_BACKLOG)
            socket.bind(address(folder, name))

    def publish(self, telemetry: Telemetry) -> None:
        """Send telemetry to whoever listens."""
        self._telemetry.send(encode(telemetry), zmq.DONTWAIT)

    def requests(self, most: int = 50) -> list[Request]:
        """Return the requests that have come: emergency stops, then the oldest first.

        Damaged ones are dropped.

        Args:
            most: of each of the two kinds.
        """
        return [*_waiting(self._emergency, most), *_waiting(self._requests, most)]

    def close(self) -> None:
        """Close the channels."""
        self._context.destroy(linger=0)


def _waiting(socket: zmq.Socket[bytes], most: int) -> Iterator[Request]:
    for _ in range(most):
        try:
            yield decode_request(socket.recv(zmq.DONTWAIT))
        except zmq.Again:
            return
        except msgspec.DecodeError:
            continue


class Listener:
    """Reads telemetry: every message, or only the latest one."""

    def __init__(self, folder: Path, *, latest: bool = False) -> None:
        """Connect.

        Args:
            folder: of the channels.
            latest: keep the newest message alone.
        """
        self._context = zmq.Context()
        self._socket = self._context.socket(zmq.SUB)
        self._socket.setsockopt(zmq.LINGER, 0)
        if latest:
            self._socket.setsockopt(zmq.CONFLATE, 1)
        else:
            self._socket.set_hwm(_BACKLOG)
        self._socket.subscribe(b"")
        self._socket.connect(address(folder, _TELEMETRY))

    def next(self, timeout_s: float) -> Telemetry | None:
        """Wait for the next telemetry; None if none came in time."""
        if not self._socket.poll(round(1000 * timeout_s)):
            return None
        return decode_telemetry(self._socket.recv())

    def close(self) -> None:
        """Disconnect."""
        self._context.destroy(linger=0)


@contextmanager
def progress(folder: Path) -> Iterator[Callable[[str], None]]:
    """Report twice a second what the loop does before it publishes telemetry.

    From a thread: to compile the control step may take minutes on a slow computer.

    Args:
        folder: of the channels.

    Yields:
        What sets the text that is reported, "starting" at first.
    """
    doing, ended = deque(["starting"], maxlen=1), threading.Event()

    def report() -> None:
        with zmq.Context() as context, context.socket(zmq.PUB) as socket:
            socket.setsockopt(zmq.LINGER, 0)
            socket.bind(address(folder, _PROGRESS))
            while not ended.wait(_BEAT_S):
                socket.send_string(doing[0])

    thread = threading.Thread(target=report, name="progress")
    thread.start()
    try:
        yield doing.append
    finally:
        ended.set()
        thread.join()


class ProgressListener:
    """Reads what the loop reports before its first telemetry."""

    def __init__(self, folder: Path) -> None:
        """Connect."""
        self._context = zmq.Context()
        self._socket = self._context.socket(zmq.SUB)
        self._socket.setsockopt(zmq.LINGER, 0)
        self._socket.setsockopt(zmq.CONFLATE, 1)
        self._socket.subscribe(b"")
        self._socket.connect(address(folder, _PROGRESS))

    def latest(self) -> str:
        """Return what was reported since the last call, empty for nothing."""
        try:
            return self._socket.recv_string(zmq.DONTWAIT)
        except zmq.Again:
            return ""

    def close(self) -> None:
        """Disconnect."""
        self._context.destroy(linger=0)


class Asker:
    """Sends requests to the loop; never waits."""

    def __init__(self, folder: Path) -> None:
        """Connect to the channels of a folder."""
        self._context = zmq.Context()
        # What nobody takes now must not reach a loop that is started later.
        self._requests = self._connect(folder, _REQUESTS, at_once=True)
        self._emergency = self._connect(folder, _EMERGENCY, at_once=False)

    def _connect(self, folder: Path, name: str, *, at_once: bool) -> zmq.Socket[bytes]:
        socket = self._context.socket(zmq.PUSH)
        socket.setsockopt(zmq.IMMEDIATE, int(at_once))
        socket.setsockopt(zmq.LINGER, 200)
        socket.set_hwm(_BACKLOG)
        socket.connect(address(folder, name))
        return socket

    def ask(self, request: Request) -> bool:
        """Send a request; an emergency stop overtakes all others.

        Returns:
            False if the loop takes no more.
        """
        stops = isinstance(request, EmergencyStop)
        socket = self._emergency if stops else self._requests
        try:
            socket.send(encode(request), zmq.DONTWAIT)
        except zmq.Again:
            return False
        return True

    def close(self) -> None:
        """Disconnect, after what was sent has gone."""
        self._context.destroy(linger=200)
