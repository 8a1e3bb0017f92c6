"""How the supervisor tells a loop that is slow from one that is dead."""

import os
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
import webbrowser
from contextlib import closing, contextmanager
from pathlib import Path

import pytest
from api_server import small_library
from patience import PATIENCE_S, Deadline
from telemetry_factory import told

from gaitchain.cli.libraries import shipped_library
from gaitchain.errors import ServiceError
from gaitchain.live.messages import Mode, TroubleKind
from gaitchain.service import supervisor
from gaitchain.service.channel import LoopEnd
from gaitchain.service.kept_files import KeptFiles
from gaitchain.service.pulse import Pulse, Turn, Vitals, turn_of
from gaitchain.service.settings import Settings, load_settings, save_settings

ENDS = signal.SIGHUP, signal.SIGINT
BEATS = """
import sys, threading
from pathlib import Path
from gaitchain.service.pulse import Pulse
pulse, ended = Pulse(Path(sys.argv[1])), threading.Event()
threading.Thread(target=lambda: (sys.stdin.read(), ended.set()), daemon=True).start()
while not ended.wait(0.005):
    pulse.beat()
"""


@contextmanager
def part_of(program, *words):
    """A process that stands for a loop."""
    part = supervisor.Part.__new__(supervisor.Part)
    part.name, part.starts = "loop", 0
    part.process = subprocess.Popen(
        [sys.executable, "-c", program, *words], stdin=subprocess.PIPE
    )
    try:
        yield part
    finally:
        part.process.kill()
        part.process.communicate()


def idle_part():
    return part_of("input()")


@pytest.fixture
def watcher(tmp_path):
    """A supervisor, and what it said."""
    said = []
    heard = threading.Semaphore(0)

    def say(text):
        said.append(text)
        heard.release()

    watch = supervisor.Supervisor(KeptFiles(Settings(library=""), {}), tmp_path, say)
    watch._pulse.say("starting")
    yield watch, said, heard
    watch._finish()


def test_a_loop_that_compiles_is_waited_for_without_a_limit(
    watcher, tmp_path, monkeypatch
):
    watch, said, heard = watcher
    monkeypatch.setattr(supervisor, "_START_S", 0.0)  # any silence would be too long
    monkeypatch.setattr(supervisor, "_SAY_S", 0.0)
    monkeypatch.setattr(supervisor, "_SAY_AGAIN_S", 0.3)
    ended = threading.Event()
    watch._pulse.say("compiling the control step, 7 functions so far")

    def compile_then_run():
        heard.acquire()
        heard.acquire()  # it has looked several times without a beat
        loop = LoopEnd(tmp_path)
        while not ended.wait(0.02):
            loop.requests()
            loop.publish(told(small_library().robot))
        loop.close()

    thread = threading.Thread(target=compile_then_run)
    with idle_part() as part:
        thread.start()
        assert watch._await_loop(part)
        ended.set()
        thread.join()
    assert len(said) >= 2
    words = "the loop is compiling the control step, 7 functions so far, for "
    assert all(words in text for text in said)


def test_a_loop_that_does_nothing_is_given_up(watcher, monkeypatch):
    watch, said, _ = watcher
    monkeypatch.setattr(supervisor, "_START_S", 0.2)
    refused = pytest.raises(ServiceError, match=r"did nothing for 0\.2 s")
    with idle_part() as part, refused:
        watch._await_loop(part)
    assert said == []


def test_a_loop_that_ends_is_not_waited_for(watcher):
    watch, _, _ = watcher
    with idle_part() as part:
        part.process.kill()
        assert not watch._await_loop(part)


def test_a_loop_that_starts_is_asked_to_end_and_not_just_killed(tmp_path):
    """It has no channel yet that could take a request."""
    said = []
    watch = supervisor.Supervisor(
        KeptFiles(Settings(library=""), {}), tmp_path, said.append
    )
    with part_of("import sys; sys.stdin.read()") as part:
        watch._parts["loop"] = part
        watch._finish()
        assert part.code == 0
    assert said == [
        "gaitchain: the loop still starts, and ends first; it is killed after 8 s"
    ]


def test_a_loop_that_ticks_is_kept_though_no_telemetry_comes(
    watcher, tmp_path, monkeypatch
):
    """As when its ZeroMQ thread gets no processor; that carries no word then."""
    watch, said, _ = watcher
    monkeypatch.setattr(supervisor, "_SILENT_S", 0.25)
    with part_of(BEATS, str(tmp_path)) as part:
        watch._parts["loop"] = part
        until(lambda: not watch._pulse.doing)
        for _ in range(8):  # looks, 0.1 s apart
            watch._watch()
        assert part.code is None
        assert said == []
        part.process.send_signal(signal.SIGSTOP)
        monkeypatch.setattr(watch, "_start_again", lambda part: None)
        until(lambda: watch._watch() or part.code == -signal.SIGKILL)
        assert said == ["gaitchain: the loop part is stuck, and is ended"]
        watch._parts.clear()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["api", "viewer", "log"])
def test_a_part_that_hangs_is_replaced_and_one_that_starts_is_not(
    watcher, tmp_path, monkeypatch, name
):
    watch, said, _ = watcher
    monkeypatch.setattr(supervisor, "_PARTS_SILENT_S", {name: 3.0})
    monkeypatch.setattr(watch, "_is_stuck", lambda loop: False)
    settings = Settings(
        library=str(shipped_library()),
        port=0,
        viewer_port=supervisor.free_port("127.0.0.1", 0),
        log=str(tmp_path / "walk.mcap"),
    )
    save_settings(settings, tmp_path)
    with idle_part() as loop:
        watch._parts["loop"] = loop
        watch._parts[name] = part = supervisor.Part(name, tmp_path)
        until(lambda: watch._watch() or not part._pulse.doing)
        assert said == []
        stuck = part.process
        stuck.send_signal(signal.SIGSTOP)
        until(lambda: watch._watch() or part.process is not stuck)
        until(lambda: watch._watch() or not part._pulse.doing)
        assert part.code is None
        assert loop.code is None
        del watch._parts["loop"]
    assert said == [
        f"gaitchain: the {name} part is stuck, and is ended",
        f"gaitchain: the {name} part ended with signal 9 and was started again",
    ]


def until(happens):
    deadline = Deadline()
    while not happens():
        assert not deadline.passed()


@pytest.mark.skipif(not Path("/proc/self/schedstat").exists(), reason="Linux says it")
def test_linux_tells_who_waits_for_a_processor():
    before = turn_of(os.getpid())
    assert before.waits  # it runs, as it asks
    until(lambda: turn_of(os.getpid()).ran_s > before.ran_s + 0.01)
    with idle_part() as part:
        until(lambda: not turn_of(part.process.pid).waits)
        until(lambda: turn_of(part.process.pid, "S").waits)
    assert turn_of(part.process.pid) is None


class Watched:
    """A pulse, and a process as the test has it."""

    def __init__(self, folder):
        self.pulse, self.now_s, self.turn = Pulse(folder), 0.0, Turn(False, 0.0)
        self.vitals = Vitals(self.pulse, lambda: self.now_s, lambda _: self.turn)

    def look(self, seconds, turn=None, every_s=0.1):
        for _ in range(round(seconds / every_s)):
            self.now_s += every_s
            self.turn = turn or self.turn
            found = self.vitals.look(1)
        return found


def test_a_process_that_sleeps_is_silent_for_as_long_as_it_does(tmp_path):
    watched = Watched(tmp_path)
    assert watched.look(2.0) == pytest.approx(2.0)
    watched.pulse.beat()
    assert watched.look(0.1) == 0.0


def test_a_process_that_waits_for_a_processor_is_not_silent(tmp_path):
    watched = Watched(tmp_path)
    assert watched.look(60.0, Turn(True, 0.0)) == 0.0
    assert watched.look(0.1, Turn(True, 0.05)) == pytest.approx(0.05)  # and ran
    assert watched.look(1.0, Turn(False, 0.05)) == pytest.approx(1.05)


def test_a_watcher_that_was_held_up_blames_nobody(tmp_path):
    watched = Watched(tmp_path)
    assert watched.look(100.0, every_s=100.0) <= 0.5


def test_where_nothing_is_known_of_processors_time_counts(tmp_path):
    watched = Watched(tmp_path)
    watched.vitals = Vitals(watched.pulse, lambda: watched.now_s, lambda _: None)
    assert watched.look(3.0) == pytest.approx(3.0)


def test_a_stop_is_remembered_until_the_robot_may_move_again(tmp_path):
    robot, loop, pulse = small_library().robot, LoopEnd(tmp_path), Pulse(tmp_path)
    stop = {"mode": Mode.STOPPED, "reason": "by me"}
    loop.publish(told(robot, trouble=TroubleKind.EMERGENCY_STOP, **stop))
    assert pulse.kept == "emergency_stop: by me"
    loop.publish(told(robot, trouble=TroubleKind.LINK, **stop))
    assert pulse.kept == "emergency_stop: by me"
    loop.publish(told(robot, mode=Mode.RISING))
    assert pulse.kept == ""
    loop.close()
    pulse.close()


def test_a_stop_is_remembered_though_the_files_are_removed(watcher, tmp_path):
    watch, _, _ = watcher
    with closing(Pulse(tmp_path)) as loop:
        for file in tmp_path.iterdir():
            file.unlink()
        loop.keep("emergency_stop: by somebody")
    watch._put_back()
    assert load_settings(tmp_path) == watch._settings
    with closing(Pulse(tmp_path)) as again:
        assert again.kept == "emergency_stop: by somebody"
        before = watch._pulse.beats
        again.beat()
        assert watch._pulse.beats == before + 1


@pytest.mark.parametrize(
    ("backend", "holds"), [("dynamixel:/dev/ttyUSB0", True), ("mujoco", False)]
)
def test_who_gives_a_loop_up_says_whether_motors_may_hold(tmp_path, backend, holds):
    settings = Settings(library="", backend=backend)
    watch = supervisor.Supervisor(KeptFiles(settings, {}), tmp_path, lambda text: None)
    with part_of("pass") as part, pytest.raises(ServiceError) as ended:
        part.name = "loop"
        watch._give_up(part, "exit code 1")
    assert ("SWITCH THE SUPPLY OFF" in str(ended.value)) == holds
    watch._finish()


def test_a_service_without_its_folder_ends_in_one_line(watcher, tmp_path):
    watch, _, _ = watcher
    shutil.rmtree(tmp_path)
    with pytest.raises(ServiceError, match="cannot be written"):
        watch._put_back()


def test_a_loop_that_is_started_again_says_so_to_the_next_watch(watcher):
    """The beats of the one before are no sign of life of this one."""
    watch, _, _ = watcher
    with idle_part() as part:
        part.start = lambda: None
        part._starts, part.process.returncode = [time.monotonic()], None
        watch._pulse.beat()
        part.process.kill()
        part.process.wait()
        watch._start_again(part)
        assert watch._pulse.doing == "starting"


@pytest.mark.parametrize(
    ("token", "shows", "opened"),
    [
        ("a secret", False, "http://[::1]:8700/"),
        ("a secret", True, "http://[::1]:8700/?token=a%20secret"),
        ("", False, "http://[::1]:8700/"),
    ],
)
def test_a_token_is_shown_only_where_it_is_shown_already(
    tmp_path, monkeypatch, token, shows, opened
):
    """Journals keep what is said; lists of processes show how a browser was begun."""
    said, tabs, opening = [], [], threading.Event()
    settings = Settings(library="", host="::1", token=token)
    watch = supervisor.Supervisor(KeptFiles(settings, {}), tmp_path, said.append)

    def open_tab(address):
        tabs.append(address)
        watch._ending = True
        opening.set()

    monkeypatch.setattr(supervisor.webbrowser, "open", open_tab)
    monkeypatch.setattr(watch, "_begin", lambda: True)
    monkeypatch.setattr(watch, "_serves", lambda: True)
    monkeypatch.setattr(watch, "_watch", lambda: opening.wait(PATIENCE_S))
    monkeypatch.setattr(signal, "signal", lambda number, handler: None)
    watch.run(open_browser=True, shows_token=shows)
    assert tabs == [opened]
    assert said == [f"gaitchain: {opened} (Ctrl-C ends it)"]


BROWSER = """#!/bin/sh
touch {folder}/opened
until [ -e {folder}/closed ]; do sleep 0.05; done
"""


def test_the_parts_are_watched_while_a_browser_runs_in_the_console(
    tmp_path, monkeypatch
):
    browser, opened = tmp_path / "browser", tmp_path / "opened"
    browser.write_text(BROWSER.format(folder=tmp_path))
    browser.chmod(0o755)
    monkeypatch.setenv("BROWSER", str(browser))
    monkeypatch.setattr(webbrowser, "_tryorder", None)  # so that it is looked for anew
    monkeypatch.setattr(webbrowser, "_browsers", {})
    monkeypatch.setattr(signal, "signal", lambda number, handler: None)
    watch = supervisor.Supervisor(
        KeptFiles(Settings(library=""), {}), tmp_path, lambda text: None
    )
    monkeypatch.setattr(watch, "_begin", lambda: True)
    monkeypatch.setattr(watch, "_serves", lambda: True)
    watched = threading.Event()
    monkeypatch.setattr(watch, "_watch", lambda: opened.exists() and watched.set())
    running = threading.Thread(target=watch.run, kwargs={"open_browser": True})
    running.start()
    try:
        assert watched.wait(PATIENCE_S)
    finally:
        (tmp_path / "closed").touch()
        watch._ending = True
        running.join()
        until(lambda: all(t.name != "browser" for t in threading.enumerate()))


@pytest.fixture
def nothing_heard():
    """Let the signals that end a service be ignored."""
    before = {number: signal.getsignal(number) for number in ENDS}
    for number in ENDS:
        signal.signal(number, signal.SIG_IGN)
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.parametrize(("number", "code"), [(ENDS[0], 2), (ENDS[1], 0)])
def test_a_closed_terminal_ends_nothing_under_nohup(
    tmp_path, monkeypatch, nothing_heard, number, code
):
    """But a service in the background is ended by SIGINT, which its shell ignores."""
    watch = supervisor.Supervisor(
        KeptFiles(Settings(library=""), {}), tmp_path, lambda text: None
    )
    monkeypatch.setattr(watch, "_begin", lambda: os.kill(os.getpid(), number))
    assert watch.run(open_browser=False) == code


@pytest.fixture
def stranger():
    """A server of somebody else; its port."""
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        yield other.getsockname()[1]


def test_a_stranger_at_our_port_is_not_our_page(watcher, tmp_path, stranger):
    watch, _, _ = watcher
    watch._settings = Settings(library="", port=stranger)
    save_settings(watch._settings, tmp_path)
    lost = pytest.raises(ServiceError, match=f"127.0.0.1 port {stranger}.*--port 0")
    with idle_part() as loop, lost:
        watch._parts["loop"] = loop
        watch._parts["api"] = supervisor.Part("api", tmp_path)
        until(lambda: watch._watch() or watch._serves())
    del watch._parts["loop"]


@pytest.mark.parametrize(
    ("every_s", "starts", "is_hopeless"),
    [
        (5.0, 5, True),
        (5.0, 4, False),
        (20.0, 19, False),
        (20.0, 20, True),
        (200.0, 20, False),
    ],
)
def test_a_part_that_dies_too_often_stays_dead(every_s, starts, is_hopeless):
    """In a minute, or every few seconds for long."""
    now_s = time.monotonic()
    with idle_part() as part:
        part._starts = [now_s - every_s * n for n in range(starts, 0, -1)]
        assert part.hopeless == is_hopeless


def test_no_robot_stands_where_nobody_can_stop_it(watcher, tmp_path, monkeypatch):
    watch, said, _ = watcher
    monkeypatch.setattr(supervisor, "_TOO_OFTEN", ((2, 60.0),))
    (tmp_path / "settings.json").write_text("{")  # the part ends as it starts
    with idle_part() as loop:
        watch._parts["loop"] = loop
        watch._parts["api"] = api = supervisor.Part("api", tmp_path)
        with pytest.raises(ServiceError, match=r"api part .* nobody could stop"):
            until(watch._watch)
        watch._settings = Settings(library="", ros="zenoh")  # its services stop it
        watch._give_up(api, "exit code 1")
        assert said[-1].endswith("stays away")
    del watch._parts["loop"]


def test_the_page_is_told_of_once_the_api_has_its_address(watcher, tmp_path):
    watch, _, _ = watcher
    save_settings(Settings(library=str(shipped_library()), port=0), tmp_path)
    assert not watch._serves()
    watch._parts["api"] = supervisor.Part("api", tmp_path)
    until(watch._serves)
    assert watch._parts["api"].code is None


@pytest.mark.slow
def test_who_loses_the_port_in_its_start_ends_and_tells_of_no_page(
    stranger, monkeypatch
):
    free_port = supervisor.free_port
    taken_since = lambda host, port: port or free_port(host, port)  # noqa: E731
    monkeypatch.setattr(supervisor, "free_port", taken_since)
    monkeypatch.setattr(signal, "signal", lambda number, handler: None)

    def say(text):
        assert "http://" not in text

    library = str(shipped_library())
    settings = Settings(library=library, backend="mock", port=stranger)
    with pytest.raises(ServiceError, match=f"cannot serve on .* port {stranger}"):
        supervisor.serve(settings, say=say)


@pytest.mark.parametrize("host", ["999.1.1.1", "192.0.2.1"])
def test_a_host_that_is_none_of_ours_is_not_blamed_on_the_port(host):
    with pytest.raises(ServiceError, match=f"{host} port 8700.*--host") as refused:
        supervisor.free_port(host, 8700)
    assert "--port" not in str(refused.value)


def test_a_taken_port_is_said(stranger):
    with pytest.raises(ServiceError, match=f"port {stranger}.*--port 0"):
        supervisor.free_port("127.0.0.1", stranger)
