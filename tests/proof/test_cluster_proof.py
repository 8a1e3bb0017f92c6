"""A proof on dask and Ray, both real: the same verdict, whatever is killed."""

import os
import signal
import socket
import subprocess
import sys
from contextlib import closing, contextmanager
from importlib.util import find_spec

import pytest
from joblib import parallel_config
from patience import PATIENCE_S, Deadline

from gaitchain.build.workers import Crew
from gaitchain.cli.cluster import dask_client, start_ray
from gaitchain.cli.libraries import shipped_library
from gaitchain.gait.library_file import library_bytes, load_library
from gaitchain.proof.fall_rate import Criterion, prove

pytestmark = pytest.mark.slow
# Not imported here: Ray looks at its settings when it is imported.
needs_ray = pytest.mark.skipif(find_spec("ray") is None, reason="no Ray")
LIBRARY = load_library(shipped_library())
BRIEF = Criterion(bound=0.03, seconds=4.0)
WORDS = ["qualify", "res", "--bound", "0.03", "--seconds", "4"]


def proven(tell=lambda *news: None):
    return library_bytes(prove(LIBRARY, BRIEF, Crew(2, tell)))


@pytest.fixture(scope="module")
def here():
    """What one process finds."""
    return library_bytes(prove(LIBRARY, BRIEF, Crew(1, lambda *news: None)))


@needs_ray
def test_ray_finds_the_same(here):
    start_ray(None, 2)
    try:
        with parallel_config(backend="ray"):
            assert proven() == here
    finally:
        import ray

        ray.shutdown()


def test_a_killed_dask_worker_changes_nothing(here):
    pytest.importorskip("distributed")
    client = dask_client(None, 2)
    with client, parallel_config(backend="dask", client=client):
        before = client.run(os.getpid)
        os.kill(next(iter(before.values())), signal.SIGKILL)
        assert proven() == here
        client.wait_for_workers(2, timeout=PATIENCE_S)
        assert set(client.run(os.getpid).values()) != set(before.values())


@contextmanager
def running(*words, **pipes):
    """A Python process of our own, ended by its id."""
    child = subprocess.Popen([sys.executable, "-m", *words], **pipes)
    try:
        yield child
    finally:
        child.kill()
        child.wait(PATIENCE_S)


def free_port():
    with closing(socket.socket()) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def count_kept(journal):
    return journal.read_bytes().count(b"\n") - 1 if journal.exists() else 0


def test_a_killed_dask_scheduler_loses_nothing_that_is_finished(here, tmp_path):
    """What was finished is in the journal, from which the same command goes on."""
    pytest.importorskip("distributed")
    port, out = free_port(), tmp_path / "P.gait"
    address, journal = f"tcp://127.0.0.1:{port}", tmp_path / "P.gait.proof.jsonl"
    place = "--host", "127.0.0.1", "--no-dashboard"
    job = "gaitchain", *WORDS, "-o", str(out), "--quiet"
    with (
        running("distributed.cli.dask_scheduler", *place, "--port", f"{port}") as boss,
        running("distributed.cli.dask_worker", address, *place, "--no-nanny"),
        running(*job, "--backend", "dask", "--address", address) as walking,
    ):
        deadline = Deadline()
        while count_kept(journal) < 4 and walking.poll() is None:
            assert not deadline.passed()
        boss.kill()
        finished = count_kept(journal)
        done = walking.wait(10.0 * PATIENCE_S) == 0
    assert finished >= 4
    if not done:  # joblib may carry the batch to its end without the cluster
        again = [sys.executable, "-m", *job[:-1], "--workers", "1"]
        said = subprocess.run(again, capture_output=True, text=True, check=True).stdout
        assert int(said.split("going on after ")[1].split()[0]) >= finished
    assert out.read_bytes() == here
