"""A proof on dask, a real one: the same verdict, whatever is killed."""

import json
import os
import signal
import socket
import subprocess
import sys
from contextlib import closing, contextmanager, suppress
from functools import wraps

import pytest
import small_proof
from joblib import parallel_config
from patience import PATIENCE_S, Deadline
from small_proof import WORDS, few_worlds, proven

from gaitchain.cli import run
from gaitchain.cli.cluster import dask_client
from gaitchain.proof import proof_walks
from gaitchain.proof.proof_walks import CHOSEN

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def here():
    """What one process finds."""
    return proven(1)


def test_a_killed_dask_worker_changes_nothing(here):
    pytest.importorskip("distributed")
    client = dask_client(None, 2)
    with client, parallel_config(backend="dask", client=client):
        before = client.run(os.getpid)
        os.kill(next(iter(before.values())), signal.SIGKILL)
        assert proven(2) == here
        client.wait_for_workers(2, timeout=PATIENCE_S)
        assert set(client.run(os.getpid).values()) != set(before.values())


@contextmanager
def running(*words, **pipes):
    """A Python process of our own, ended by its id."""
    child = subprocess.Popen([sys.executable, *words], **pipes)
    try:
        yield child
    finally:
        child.kill()
        child.wait(PATIENCE_S)


def free_port():
    with closing(socket.socket()) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def walks_kept(journal):
    """The numbers of the walks in it."""
    lines = journal.read_bytes().splitlines(keepends=True) if journal.exists() else []
    whole = [line for line in lines[1:] if line.endswith(b"\n")]
    return [json.loads(line)[0][-1] for line in whole]


def wait_for_walks(journal, count, walking):
    """Wait until so many walks are kept; return how many are."""
    deadline = Deadline()
    while len(walks_kept(journal)) < count:
        with suppress(subprocess.TimeoutExpired):  # the walks need the processor
            walking.wait(0.02)
        assert walking.returncode is None, "it ended too early"
        assert not deadline.passed()
    return len(walks_kept(journal))


@contextmanager
def counted(monkeypatch):
    """The numbers of the walks that are walked here."""
    walk, numbers = proof_walks._walk, []

    @wraps(walk)
    def noted(*job):
        numbers.append(job[-1][1])
        return walk(*job)

    with monkeypatch.context() as patch:
        patch.setattr(proof_walks, "_walk", noted)
        yield numbers


def test_a_killed_worker_and_scheduler_lose_nothing_that_is_finished(
    here, tmp_path, monkeypatch
):
    """What was finished is in the journal, from which the same command goes on."""
    pytest.importorskip("distributed")
    port, out = free_port(), tmp_path / "P.gait"
    address, journal = f"tcp://127.0.0.1:{port}", tmp_path / "P.gait.proof.jsonl"
    place = "--host", "127.0.0.1", "--no-dashboard"
    scheduler = "-m", "distributed.cli.dask_scheduler", *place, "--port", f"{port}"
    worker = "-m", "distributed.cli.dask_worker", address, *place, "--no-nanny"
    job = *WORDS, "-o", str(out), "--quiet"
    asking = small_proof.__file__, *job, "--backend", "dask", "--address", address
    with (
        running(*scheduler) as boss,
        running(*worker, "--nthreads", "1") as first,
        running(*worker, "--nthreads", "1"),
        running(*asking) as asked,
    ):
        kept = wait_for_walks(journal, 4, asked)
        first.kill()
        wait_for_walks(journal, kept + 2, asked)  # the other worker goes on
        boss.kill()
        assert asked.wait(10.0 * PATIENCE_S) != 0
    finished = walks_kept(journal)
    assert not out.exists()
    with few_worlds(), counted(monkeypatch) as numbers:
        assert run([*job, "--workers", "1"]) == 0
    drawn = [number for number in numbers if number < CHOSEN]
    assert drawn == [number for number in range(32) if number not in finished]
    assert drawn != numbers == sorted(set(numbers)), "some worlds are walked at the end"
    assert out.read_bytes() == here
