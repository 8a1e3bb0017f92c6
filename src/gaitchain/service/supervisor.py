"""Start the parts of the service, monitor them, and restart those that die or hang.

The robot stays safe when a part dies: without commands the loop stops walking; without
packets the servos stop by their watchdog; and a restarted loop begins with the torque
off, or with a simulated robot standing.
"""

import errno
import os
import secrets
import signal
import socket
import subprocess
import sys
import threading
import time
import webbrowser
from collections import deque
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from types import FrameType
from urllib.parse import quote

import msgspec

from gaitchain.errors import ServiceError, file_errors
from gaitchain.live.messages import Note, Shutdown
from gaitchain.service.channel import Asker, Listener
from gaitchain.service.ends import known_ends
from gaitchain.service.kept_files import KeptFiles, keep_files
from gaitchain.service.own_port import own_port
from gaitchain.service.part import REFUSED, SERVED
from gaitchain.service.pulse import (
    COMPILING,
    WAITS_FOR_DISK,
    WAITS_TO_RUN,
    Pulse,
    Vitals,
    part_pulse,
    turn_of,
)
from gaitchain.service.robots import kind_of
from gaitchain.service.service_folder import service_folder
from gaitchain.service.settings import Settings, are_saved, save_settings

_START_S = 120.0  # a loop that starts may do so long without a word of what it does
_SAY_S, _SAY_AGAIN_S = 3.0, 10.0  # when a start that takes long is said
_SILENT_S = 3.0  # a loop that could have ticked for so long is started again
_LOOK_S = 0.1
_STARTING = "starting"
_MAY_HOLD = ": motors may still have torque; hold the robot, and SWITCH THE SUPPLY OFF"
_API, _VIEWER, _LOG = "api", "viewer", "log"
# [s]; where nothing is known of a process's state, a slow disk looks like a stuck log.
_PARTS_SILENT_S = {_API: 10.0, _VIEWER: 10.0, _LOG: 20.0}
_PARTS_START_S = 300.0  # meshes may be large, and a computer small
# Ctrl-C reaches the supervisor alone: by a session of its own, or a group on Windows.
_GROUP = getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0)
_NO_OPENGL = {"MUJOCO_GL": "disable"}  # which MuJoCo loads; the page draws
_END_S = 8.0  # a part may take so long to end
# (starts, time [s]): a part that dies so often within one of these stays dead.
_TOO_OFTEN = (5, 60.0), (20, 3600.0)
Say = Callable[[str], None]


class Part:
    """One process of the service."""

    def __init__(self, name: str, folder: Path) -> None:
        """Start it."""
        self.name, self._folder = name, folder
        self._pulse = part_pulse(folder, name)
        # A kill does not end a wait for the disk, so that time is none of its own.
        patient = partial(turn_of, waiting=WAITS_TO_RUN + WAITS_FOR_DISK)
        self._vitals = Vitals(self._pulse, turn=patient)
        self._starts: deque[float] = deque(maxlen=max(n for n, _ in _TOO_OFTEN))
        self.start()

    def start(self) -> None:
        """Start the process, a first time or again."""
        self._starts.append(time.monotonic())
        self._pulse.put_back()
        self._pulse.say(_STARTING)
        command = [sys.executable, "-m", "gaitchain.service.part"]
        self.process = subprocess.Popen(
            [*command, self.name, str(self._folder)],
            stdin=subprocess.PIPE,
            env=os.environ | _NO_OPENGL,
            start_new_session=True,
            creationflags=_GROUP,
        )

    @property
    def code(self) -> int | None:
        """Exit code, negative for a signal; None while it runs."""
        return self.process.poll()

    @property
    def hopeless(self) -> bool:
        """Whether it has died too often to be started once more."""
        now_s, known = time.monotonic(), len(self._starts)
        return any(
            known >= starts and now_s - self._starts[-starts] < within_s
            for starts, within_s in _TOO_OFTEN
        )

    def is_stuck(self) -> bool:
        """Look once, several times a second; a part without a pulse never is."""
        if self.name not in _PARTS_SILENT_S:
            return False
        most_s = _PARTS_START_S if self._pulse.doing else _PARTS_SILENT_S[self.name]
        return self._vitals.look(self.process.pid) > most_s

    def kill(self) -> None:
        """End it, without waiting: who hangs may be slow in that, too."""
        self._pulse.say(_STARTING)  # so that it is not found stuck at once again
        self.process.kill()

    def end(self) -> None:
        """Ask it to end by closing its input."""
        if self.process.stdin is not None:
            self.process.stdin.close()

    def wait(self, until_s: float) -> None:
        """Wait for its end, and kill it if that does not come in time."""
        try:
            self.process.wait(max(0.1, until_s - time.monotonic()))
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()


class Supervisor:
    """The parts of one service."""

    def __init__(self, kept: KeptFiles, folder: Path, say: Say) -> None:
        """Plan the parts; `run` starts them."""
        settings = kept.settings
        self._kept, self._settings, self._folder, self._say = (
            kept,
            settings,
            folder,
            say,
        )
        self._driver = "player" if settings.replay else "loop"
        self._first = [self._driver]
        if settings.log and not settings.replay:
            self._first.append(_LOG)  # nothing shall be missing in it
        self._others = [_VIEWER, _API]
        if settings.ros:
            self._others.append("ros")
        self._parts: dict[str, Part] = {}
        self._asker, self._listener = Asker(folder), Listener(folder, latest=True)
        self._pulse = Pulse(folder)
        self._vitals = Vitals(self._pulse)
        self._unreported: list[str] = []  # while no loop listens
        self._ending = False

    def run(self, *, open_browser: bool, shows_token: bool = False) -> int:
        """Start the parts, watch them, and end them; see `serve`."""
        for number in _ends():
            signal.signal(number, self._end)
        try:
            if not self._begin():
                return 0 if self._ending else REFUSED
            while not self._ending and not self._serves():
                self._watch()
            if not self._ending:
                # Terminals and journals are kept, and a list of processes shows what a
                # browser was started with.
                address = self.address if shows_token else self._page
                self._say(f"gaitchain: {address} (Ctrl-C ends it)")
                if open_browser:
                    _open_browser(address)
            while not self._ending:
                self._watch()
        finally:
            self._finish()
        return 0

    @property
    def address(self) -> str:
        """Where the page is, with the token if there is one."""
        token = self._settings.token
        return f"{self._page}?token={quote(token)}" if token else self._page

    @property
    def _page(self) -> str:
        """The same without the token, for which the page has a form."""
        host = self._settings.host
        shown = socket.gethostname() if host in ("0.0.0.0", "::") else host
        if ":" in shown:
            shown = f"[{shown}]"
        return f"http://{shown}:{self._settings.port}/"

    def _serves(self) -> bool:
        """Whether the page can be opened by now.

        The API says so itself: whoever answers at its address may be another program.
        """
        return (self._folder / SERVED).exists()

    def _end(self, _signal: int, _frame: FrameType | None) -> None:
        self._ending = True

    def _begin(self) -> bool:
        """Start loop and log, and the rest once the loop speaks."""
        self._pulse.say(_STARTING)
        for name in self._first:
            self._parts[name] = Part(name, self._folder)
        if not self._await_loop(self._parts[self._driver]):
            return False
        # A loop that is started again may find the servos' supply off.
        self._settings = msgspec.structs.replace(self._settings, waits=True)
        save_settings(self._settings, self._folder)
        for name in self._others:
            self._parts[name] = Part(name, self._folder)
        return True

    def _await_loop(self, loop: Part) -> bool:
        """Wait for the first telemetry, as long as the loop says what it does.

        False at the end of the service or of the loop.
        """
        began_s = time.monotonic()
        say_s = began_s + _SAY_S
        while self._listener.next(_LOOK_S) is None:
            if self._ending or loop.code is not None:
                return False
            now_s, doing = time.monotonic(), self._pulse.doing
            if self._is_stuck(loop):
                raise ServiceError(f"the loop did nothing for {_START_S:g} s")
            if doing and now_s > say_s:
                say_s = now_s + _SAY_AGAIN_S
                first = "; the first start on a computer takes longest"
                self._say(
                    f"gaitchain: the {loop.name} is {doing}, for "
                    f"{now_s - began_s:.0f} s so far"
                    + ("" if self._settings.replay else first)
                )
        return True

    def _is_stuck(self, loop: Part) -> bool:
        """Look once whether the loop has stopped; a busy computer makes it slow."""
        silent_s, doing = self._vitals.look(loop.process.pid), self._pulse.doing
        if doing.startswith(COMPILING):
            return False
        return silent_s > (_START_S if doing else _SILENT_S)

    def _watch(self) -> None:
        """Look once at every part, and wait for 0.1 s."""
        loop = self._parts[self._driver]
        if loop.code is None and self._is_stuck(loop):
            self._report(f"the {loop.name} part is stuck, and is ended")
            loop.process.kill()
            loop.process.wait()
        for part in tuple(self._parts.values()):
            if part.code is not None and not self._ending:
                self._start_again(part)
            elif part.is_stuck():
                self._report(f"the {part.name} part is stuck, and is ended")
                part.kill()
        if self._unreported and self._asker.ask(Note("part", self._unreported[0])):
            self._unreported.pop(0)
        time.sleep(_LOOK_S)

    def _start_again(self, part: Part) -> None:
        part.end()  # nobody reads its input any more
        code = part.code or 0
        how = f"signal {-code}" if code < 0 else f"exit code {code}"
        if part.hopeless or (code == REFUSED and part.name != self._driver):
            self._give_up(part, how)
            return
        self._put_back()
        if part.name == self._driver:
            self._pulse.say(_STARTING)
        part.start()
        self._report(f"the {part.name} part ended with {how} and was started again")

    def _put_back(self) -> None:
        """Make anew what a part needs to start, and somebody may have removed.

        Programs that clean the folder of temporary files take what looks old.

        Raises:
            ServiceError: the whole folder is gone.
        """
        with file_errors(self._folder, "written", ServiceError):
            if not are_saved(self._folder):
                save_settings(self._settings, self._folder)
            self._kept.put_back()
            self._pulse.put_back()

    def _give_up(self, part: Part, how: str) -> None:
        """Go on without a part, unless nobody could drive without it."""
        if part.name == self._driver:
            holds = _MAY_HOLD if kind_of(self._settings) == "real" else ""
            raise ServiceError(
                f"the {part.name} part ended with {how}, for good{holds}"
            )
        if part.name == _API and part.code == REFUSED:
            host, port = self._settings.host, self._settings.port
            raise ServiceError(
                f"the {part.name} part ended with {how}: it cannot serve on {host} "
                f"port {port}, which may be taken by now; --port 0 takes a free one"
            )
        if part.name == _API and not self._settings.ros:  # whose services stop it, too
            raise ServiceError(
                f"the {part.name} part ended with {how}, for good: nobody could stop "
                "the robot"
            )
        what = f"the {part.name} part ended with {how}, and stays away"
        del self._parts[part.name]
        self._report(what)

    def _report(self, what: str) -> None:
        self._say(f"gaitchain: {what}")
        self._unreported.append(what)

    def _finish(self) -> None:
        """End the loop, which stands still first, then the rest; leave none behind."""
        asked = self._asker.ask(Shutdown())
        until_s = time.monotonic() + _END_S
        driver = self._parts.get(self._driver)
        if driver is not None:
            if not asked and driver.code is None:  # it starts, and hears this way alone
                self._say(
                    f"gaitchain: the {driver.name} still starts, and ends first; it is "
                    f"killed after {_END_S:g} s"
                )
                driver.end()
            driver.wait(until_s)
        for part in self._parts.values():
            part.end()
        for part in self._parts.values():
            part.wait(until_s + _END_S)
        self._asker.close()
        self._listener.close()
        self._pulse.close()


def serve(
    settings: Settings,
    *,
    open_browser: bool = False,
    shows_token: bool = False,
    say: Say = print,
) -> int:
    """Run the service until Ctrl-C or SIGTERM.

    Args:
        settings: what to serve.
        open_browser: whether to open the page.
        shows_token: whether the address is said, and opened, with the token, as where
            a list of processes shows it already; otherwise the page asks for it.
        say: where the address and reports of parts go.

    Returns:
        Exit code: 0 ended as asked, 2 bad input.

    Raises:
        ServiceError: the port is taken, also later, or a part cannot be kept alive.
    """
    settings = msgspec.structs.replace(
        settings,
        port=free_port(settings.host, settings.port),
        viewer_port=free_port("127.0.0.1", 0),
        viewer_secret=secrets.token_urlsafe(),
    )
    with service_folder() as folder:
        kept = keep_files(settings, folder)
        save_settings(kept.settings, folder)
        supervisor = Supervisor(kept, folder, say)
        return supervisor.run(open_browser=open_browser, shows_token=shows_token)


def _ends() -> Iterator[int]:
    """Yield the signals that end a service.

    What was to be ignored, as a closed terminal under nohup, stays so. But a shell that
    runs it in the background ignores SIGINT, which whoever sends it does not mean.
    """
    for number in known_ends():
        ignored = signal.getsignal(number) is signal.SIG_IGN
        if number == signal.SIGINT or not ignored:
            yield number


def _open_browser(address: str) -> None:
    """Open a page in a thread: in a console, a browser runs until it is closed."""
    threading.Thread(
        target=webbrowser.open, args=[address], name="browser", daemon=True
    ).start()


def free_port(host: str, port: int) -> int:
    """Return a port that can be served on; 0 finds one.

    Raises:
        ServiceError: the address cannot be had.
    """
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family, socket.SOCK_STREAM) as probe:
        own_port(probe)
        try:
            probe.bind((host, port))
        except OSError as error:
            raise ServiceError(
                f"cannot serve on {host} port {port}: {error.strerror}; "
                f"{_advice(error)}"
            ) from error
        return int(probe.getsockname()[1])


def _advice(error: OSError) -> str:
    """Say what would have worked: another port, or another host."""
    if error.errno in (errno.EADDRINUSE, errno.EACCES):
        return "--port 0 takes a free one"
    return "--host takes an address of this computer, such as 127.0.0.1"
