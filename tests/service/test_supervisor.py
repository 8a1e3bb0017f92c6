"""How long the supervisor waits for a loop that starts, and what it says meanwhile."""

import subprocess
import sys
import threading
from contextlib import contextmanager

import pytest
from api_server import small_library
from telemetry_factory import told

from gaitchain.errors import ServiceError
from gaitchain.service import supervisor
from gaitchain.service.channel import LoopEnd, progress
from gaitchain.service.settings import Settings


@contextmanager
def idle_part():
    """A process that stands for a loop which has nothing to say by itself."""
    part = supervisor.Part.__new__(supervisor.Part)
    part.name = "loop"
    part.process = subprocess.Popen(
        [sys.executable, "-c", "input()"], stdin=subprocess.PIPE
    )
    try:
        yield part
    finally:
        part.process.kill()
        part.process.communicate()


@pytest.fixture
def watcher(tmp_path):
    """A supervisor, and what it said."""
    said = []
    heard = threading.Semaphore(0)

    def say(text):
        said.append(text)
        heard.release()

    watch = supervisor.Supervisor(Settings(library=""), tmp_path, say)
    yield watch, said, heard
    watch._finish()


@pytest.mark.slow
def test_a_loop_that_compiles_is_waited_for_as_long_as_it_says_so(
    watcher, tmp_path, monkeypatch
):
    watch, said, heard = watcher
    monkeypatch.setattr(supervisor, "_START_S", 5.0)
    monkeypatch.setattr(supervisor, "_SAY_S", 0.1)
    monkeypatch.setattr(supervisor, "_SAY_AGAIN_S", 6.0)
    ended = threading.Event()

    def compile_then_run():
        with progress(tmp_path) as report:
            report("compiling the control step")
            heard.acquire()
            heard.acquire()  # more than the 5 s without telemetry have passed
        loop = LoopEnd(tmp_path)
        while not ended.wait(0.02):
            loop.publish(told(small_library().robot))
        loop.close()

    thread = threading.Thread(target=compile_then_run)
    with idle_part() as part:
        thread.start()
        assert watch._await_loop(part)
        ended.set()
        thread.join()
    assert len(said) == 2
    assert all("the loop is compiling the control step, for " in text for text in said)


def test_a_loop_that_says_nothing_is_given_up(watcher, monkeypatch):
    watch, said, _ = watcher
    monkeypatch.setattr(supervisor, "_START_S", 0.2)
    refused = pytest.raises(ServiceError, match=r"said nothing for 0\.2 s")
    with idle_part() as part, refused:
        watch._await_loop(part)
    assert said == []


def test_a_loop_that_ends_is_not_waited_for(watcher):
    watch, _, _ = watcher
    with idle_part() as part:
        part.process.kill()
        assert not watch._await_loop(part)
