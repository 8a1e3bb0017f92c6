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


class _End:
    """Sockets of one process on the channels of a folder."""

    def __init__(self, folder: Path, linger_ms: int = 0) -> None:
        self._folder, self._linger_ms = folder, linger_ms
        self._context = zmq.Context()

    def _open(
        self, kind: int, name: str, options: dict[int, int] | None = None
    ) -> zmq.Socket[bytes]:
        """Bind what publishes or takes requests, connect what reads or asks."""
        socket = self._context.socket(kind)
        socket.set_hwm(_BACKLOG)
        for option, value in {zmq.LINGER: self._linger_ms, **(options or {})}.items():
            socket.setsockopt(option, value)
        binds = kind in (zmq.PUB, zmq.PULL)
        (socket.bind if binds else socket.connect)(address(self._folder, name))
        return socket

    def close(self) -> None:
        """Close the channels, after what was sent has gone."""
        self._context.destroy(linger=self._linger_ms)


class LoopEnd(_End):
    """The loop's end: it publishes telemetry and takes requests, and never waits."""

    def __init__(self, folder: Path) -> None:
        """Bind the channels in a folder."""
        super().__init__(folder)
        self._telemetry = self._open(zmq.PUB, _TELEMETRY)
        self._requests = self._open(zmq.PULL, _REQUESTS)
        self._emergency = self._open(zmq.PULL, _EMERGENCY)

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


def _waiting(socket: zmq.Socket[bytes], most: int) -> Iterator[Request]:
    for _ in range(most):
        try:
            yield decode_request(socket.recv(zmq.DONTWAIT))
        except zmq.Again:
            return
        except msgspec.DecodeError:
            continue


class Listener(_End):
    """Reads telemetry: every message, or only the latest one."""

    def __init__(self, folder: Path, *, latest: bool = False) -> None:
        """Connect.

        Args:
            folder: of the channels.
            latest: keep the newest message alone.
        """
        super().__init__(folder)
        self._socket = self._open(zmq.SUB, _TELEMETRY, {zmq.CONFLATE: int(latest)})
        self._socket.subscribe(b"")

    def next(self, timeout_s: float) -> Telemetry | None:
        """Wait for the next telemetry; None if none came in time."""
        if not self._socket.poll(round(1000 * timeout_s)):
            return None
        return decode_telemetry(self._socket.recv())


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


class ProgressListener(_End):
    """Reads what the loop reports before its first telemetry."""

    def __init__(self, folder: Path) -> None:
        """Connect."""
        super().__init__(folder)
        self._socket = self._open(zmq.SUB, _PROGRESS, {zmq.CONFLATE: 1})
        self._socket.subscribe(b"")

    def latest(self) -> str:
        """Return what was reported since the last call, empty for nothing."""
        try:
            return self._socket.recv_string(zmq.DONTWAIT)
        except zmq.Again:
            return ""


class Asker(_End):
    """Sends requests to the loop; never waits."""

    def __init__(self, folder: Path) -> None:
        """Connect to the channels of a folder."""
        super().__init__(folder, linger_ms=200)
        # What nobody takes now must not reach a loop that is started later.
        self._requests = self._open(zmq.PUSH, _REQUESTS, {zmq.IMMEDIATE: 1})
        self._emergency = self._open(zmq.PUSH, _EMERGENCY)

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
