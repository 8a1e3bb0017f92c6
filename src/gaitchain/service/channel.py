"""Sockets between the parts of the service, in a folder that only this user can access.

ZeroMQ over Unix sockets, or where there are none, or the folder's path is too long for
one, over loopback, encrypted with keys that are in the folder: publishing never blocks,
a slow reader misses messages, and parts may connect and disconnect at any time.
"""

import os
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import msgspec
import zmq

from gaitchain.live.messages import (
    EmergencyStop,
    LetGo,
    Mode,
    Note,
    Play,
    Recall,
    Request,
    Shutdown,
    Stop,
    Telemetry,
    TroubleKind,
    decode_request,
    decode_telemetry,
    encode,
)
from gaitchain.service.pulse import Pulse

_BACKLOG = 1000  # messages; more are dropped
# What neither moves a robot nor turns its torque on.
_HARMLESS = EmergencyStop | Stop | LetGo | Note | Recall | Play | Shutdown
_TELEMETRY, _REQUESTS, _EMERGENCY = "telemetry", "requests", "emergency"
_LOG = b"the log"  # what it subscribes to beside all telemetry, so that it is known


def address(folder: Path, name: str) -> str:
    """Return the address of a channel."""
    if _has_sockets(folder):
        return f"ipc://{folder / name}"
    return f"tcp://127.0.0.1:{int(_kept(folder / f'{name}.port', _free_port))}"


def _has_sockets(folder: Path) -> bool:
    """Whether there are Unix sockets, and the folder's path leaves room for theirs."""
    longest = len(os.fsencode(folder / _TELEMETRY))  # no name is longer
    return bool(zmq.has("ipc")) and longest <= (zmq.IPC_PATH_MAX_LEN or longest)


def _free_port() -> bytes:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return str(probe.getsockname()[1]).encode()


def _keys() -> bytes:
    return b"\n".join(zmq.curve_keypair())


def _kept(path: Path, make: Callable[[], bytes]) -> bytes:
    """Return what is in a file; who comes first makes it, as a whole."""
    if not path.exists():
        own = path.with_name(f"{path.name}.{os.getpid()}.{threading.get_ident()}")
        own.touch(mode=0o600)
        own.write_bytes(make())
        with suppress(FileExistsError):
            os.link(own, path)
        own.unlink()
    return path.read_bytes()


def _secure(socket: zmq.Socket[bytes], folder: Path, *, binds: bool) -> None:
    """Let only those connect who can read the folder, which has the server's key."""
    public, secret = _kept(folder / "keys", _keys).split(b"\n")
    if binds:
        socket.curve_server = True
        socket.curve_publickey, socket.curve_secretkey = public, secret
    else:
        socket.curve_serverkey = public
        socket.curve_publickey, socket.curve_secretkey = zmq.curve_keypair()


class _End:
    """Sockets of one process on the channels of a folder."""

    def __init__(self, folder: Path, linger_ms: int = 0) -> None:
        self._folder, self._linger_ms = folder, linger_ms
        self._context = zmq.Context()

    def _open(
        self, kind: int, name: str, options: dict[int, int] | None = None
    ) -> zmq.Socket[bytes]:
        """Bind what publishes or takes requests, connect what reads or asks."""
        opened = self._context.socket(kind)
        opened.set_hwm(_BACKLOG)
        for option, value in {zmq.LINGER: self._linger_ms, **(options or {})}.items():
            opened.setsockopt(option, value)
        binds = kind in (zmq.XPUB, zmq.PULL)
        if not _has_sockets(self._folder):
            _secure(opened, self._folder, binds=binds)
        (opened.bind if binds else opened.connect)(address(self._folder, name))
        return opened

    def close(self) -> None:
        """Close the channels, after what was sent has gone."""
        self._context.destroy(linger=self._linger_ms)


class LoopEnd(_End):
    """The loop's end: it publishes telemetry and takes requests, and never waits."""

    def __init__(self, folder: Path) -> None:
        """Bind the channels in a folder."""
        super().__init__(folder)
        self._telemetry = self._open(zmq.XPUB, _TELEMETRY)
        self._requests = self._open(zmq.PULL, _REQUESTS)
        self._emergency = self._open(zmq.PULL, _EMERGENCY)
        self._pulse = Pulse(folder)
        self._held = self._pulse.kept  # why the robot must not move before a reset

    def await_log(self, most_s: float) -> bool:
        """Wait until the log listens, before the first telemetry, and only then.

        Args:
            most_s: at most so long [s].

        Returns:
            Whether it does.
        """
        until_s = time.monotonic() + most_s
        while (left_s := until_s - time.monotonic()) > 0.0:
            heard = self._telemetry.poll(round(1000 * left_s))
            if heard and self._telemetry.recv() == b"\x01" + _LOG:
                return True
        return False

    def publish(self, telemetry: Telemetry) -> None:
        """Send telemetry to whoever listens; remember what only a reset may end."""
        self._hold(telemetry)
        self._telemetry.send(encode(telemetry), zmq.DONTWAIT)

    def _hold(self, telemetry: Telemetry) -> None:
        mode, trouble = telemetry.mode, telemetry.trouble
        if mode is Mode.STOPPED and trouble is TroubleKind.LINK:
            return  # whatever was held before still is
        held = mode in (Mode.STOPPED, Mode.SAFE) and trouble is not None
        why = f"{trouble}: {telemetry.reason}" if held else ""
        if why != self._held:
            self._held = why
            self._pulse.keep(why)  # for a loop after this one

    def requests(self, most: int = 50) -> list[Request]:
        """Return the requests that have come: emergency stops, then the oldest first.

        Damaged ones are dropped, and so is what waited when an emergency stop came but
        could undo it: a reset and a start that somebody sent before it. As this is
        asked for once in each control period, it is the heartbeat of the process, too.

        Args:
            most: of each of the two kinds.
        """
        self._pulse.beat()
        stops = [*_waiting(self._emergency, most)]
        if not stops:
            return [*_waiting(self._requests, most)]
        before = _waiting(self._requests, _BACKLOG)  # none is left for the next period
        return [*stops, *(each for each in before if isinstance(each, _HARMLESS))]

    def close(self) -> None:
        """Close the channels."""
        super().close()
        self._pulse.close()


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

    def __init__(
        self,
        folder: Path,
        *,
        latest: bool = False,
        logs: bool = False,
        backlog: int = _BACKLOG,
    ) -> None:
        """Connect.

        Args:
            folder: of the channels.
            latest: keep the newest message alone.
            logs: be the one for whom a loop waits that begins (`LoopEnd.await_log`).
            backlog: messages that wait for a reader that is held up; more are dropped.
        """
        super().__init__(folder)
        options: dict[int, int] = {zmq.CONFLATE: int(latest), zmq.RCVHWM: backlog}
        self._socket = self._open(zmq.SUB, _TELEMETRY, options)
        self._socket.subscribe(b"")
        if logs:
            self._socket.subscribe(_LOG)

    def next(self, timeout_s: float) -> Telemetry | None:
        """Wait for the next telemetry; None if none came in time."""
        if not self._socket.poll(round(1000 * timeout_s)):
            return None
        return decode_telemetry(self._socket.recv())


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
