"""The core without what only POSIX has, in real processes; on one system, not three."""

import os
import re
import signal
import subprocess
import sys
from contextlib import contextmanager, suppress
from pathlib import Path

import httpx
import pytest
import zmq
from patience import PATIENCE_S, Deadline

from gaitchain.live.messages import Stop
from gaitchain.service.channel import Asker, LoopEnd

WITHOUT = Path(__file__).parent / "without_posix"
IMPORTS = """
import signal
assert not hasattr(signal, "SIGHUP")
import gaitchain, gaitchain.bench, gaitchain.cli.prompt, gaitchain.cli.replay
import gaitchain.cli.serve, gaitchain.service.loop_part, gaitchain.service.log_part
import gaitchain.service.api, gaitchain.service.player_part
import gaitchain.service.viewer_part, gaitchain.backends.servos
assert gaitchain.bench._peak() == {}
"""
ASKS = """
import sys
from gaitchain.cli.prompt import Answers
answers, ticks = Answers(sys.stdin), []
print(answers.ask("name?", lambda: ticks.append(1)), answers.ask("age?"), bool(ticks))
"""


def environment():
    """Of a process without POSIX."""
    found = {**os.environ, "PYTHONUNBUFFERED": "1"}
    paths = [str(WITHOUT), found.get("PYTHONPATH", "")]
    return {**found, "PYTHONPATH": os.pathsep.join(filter(None, paths))}


def python(program, told=""):
    done = subprocess.run(
        [sys.executable, "-c", program],
        env=environment(),
        input=told,
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_everything_that_serves_can_be_imported():
    python(IMPORTS)


def test_a_person_is_asked_without_select():
    assert python(ASKS, "Ada\n36\n").splitlines()[-1] == "Ada 36 True"


@pytest.fixture
def over_tcp(monkeypatch):
    has = zmq.has
    monkeypatch.setattr(zmq, "has", lambda what: what != "ipc" and has(what))


@pytest.fixture
def long_folder(tmp_path):
    """A folder whose path is too long for a Unix socket."""
    folder = tmp_path / ("x" * 100)
    folder.mkdir()
    return folder


@pytest.mark.parametrize("where", ["over_tcp", "long_folder"])
def test_parts_hear_each_other_over_loopback(request, tmp_path, where):
    folder = request.getfixturevalue(where) or tmp_path
    loop, asker = LoopEnd(folder), Asker(folder)
    deadline, asked = Deadline(), []
    while not asked:
        asker.ask(Stop("me"))
        asked = loop.requests()
        assert not deadline.passed()
    assert asked[0] == Stop("me")
    asker.close()
    loop.close()


def test_who_cannot_read_the_folder_is_not_heard_over_loopback(over_tcp, tmp_path):
    loop, other = LoopEnd(tmp_path), tmp_path / "other"
    other.mkdir()
    for name in ("requests", "emergency"):
        (other / f"{name}.port").write_bytes((tmp_path / f"{name}.port").read_bytes())
    stranger, known = Asker(other), Asker(tmp_path)
    deadline, asked = Deadline(), []
    while Stop("me") not in asked:
        stranger.ask(Stop("stranger"))
        known.ask(Stop("me"))
        asked += loop.requests()
        assert not deadline.passed()
    assert Stop("stranger") not in asked
    for end in (stranger, known, loop):
        end.close()


@contextmanager
def page(folder, *words):
    """A verb's page until SIGTERM, after which it has to end well."""
    with subprocess.Popen(
        [sys.executable, "-m", "gaitchain", *words, "--port", "0"],
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        cwd=folder,
    ) as process:
        said = ""
        try:
            for line in process.stdout:
                said += line
                if found := re.search(r"(http://\S+) \(Ctrl-C", line):
                    break
            assert found, said
            with httpx.Client(base_url=found[1], timeout=PATIENCE_S) as client:
                yield client
        finally:
            process.send_signal(signal.SIGTERM)
            said += process.communicate(timeout=PATIENCE_S)[0]
        assert process.returncode == 0
        assert "started again" not in said, said  # of a part that ended on the way


def state_of(client):
    """The first state that it tells; a connection that was lost is tried anew."""
    deadline, seen = Deadline(), None
    while seen is None or seen.status_code != 200:
        assert not deadline.passed(), seen and seen.text
        with suppress(httpx.TransportError):
            seen = client.get("api/v1/state")
    return seen.json()


@pytest.mark.slow
def test_it_serves_and_what_it_logged_is_replayed(tmp_path):
    with page(tmp_path, "serve", "--backend", "mock") as client:
        assert state_of(client)["mode"]
    (log,) = tmp_path.rglob("*.mcap")
    with page(tmp_path, "replay", str(log), "--no-browser") as client:
        assert state_of(client)["mode"]
