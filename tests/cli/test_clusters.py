"""Work on a cluster: dask and Ray, both real, find what this machine does.

One of each, started once: that, and loading the physics in its processes, takes longer
than all that is asked of it. What kills parts of a cluster has its own
(tests/proof/test_cluster_proof.py).
"""

import importlib
import os
import socket
from functools import partial
from importlib.util import find_spec
from pathlib import Path

import pytest
from joblib import parallel_config
from killed_work import killed_work
from small_build import SMALLEST, few_steady_walks
from small_proof import proven

from gaitchain.build.grid import Grid
from gaitchain.build.jobs import keeping, run_jobs
from gaitchain.build.journal import Journal
from gaitchain.build.pipeline import build_library
from gaitchain.build.qualify import qualify_grid
from gaitchain.build.workers import Crew
from gaitchain.cli.cluster import dask_client, on_ray
from gaitchain.errors import CommandError, WorkerError
from gaitchain.gait.library_file import library_bytes

pytestmark = pytest.mark.slow
# Not imported here: Ray looks at its settings when it is imported.
needs_ray = pytest.mark.skipif(find_spec("ray") is None, reason="no Ray")
SUPPORT = Path(__file__).parents[1] / "support"
TINY = Grid((), corners=False)


def built(workers):
    with few_steady_walks():
        return library_bytes(build_library(SMALLEST, workers=workers)[0])


@pytest.fixture(scope="module")
def built_here():
    return built(1)


@pytest.fixture(scope="module")
def proven_here():
    return proven(1)


@pytest.fixture(scope="module")
def dask():
    """A cluster of two processes."""
    pytest.importorskip("distributed")
    with dask_client(None, 2) as client:
        assert len(client.scheduler_info()["workers"]) == 2
        yield partial(parallel_config, backend="dask", client=client)


def test_dask_builds_the_same_bytes(built_here, dask):
    with dask():
        assert built(2) == built_here


def test_dask_proves_the_same(proven_here, dask):
    with dask():
        assert proven(2) == proven_here


def test_two_processes_and_dask_qualify_the_same(library, qualified, dask):
    """The last runs of the rounds are given, to save time."""
    found, runs = qualified
    given = {run.key: run for run in runs[4:]}
    local, spread = [], []

    def qualify(workers, note):
        crew = Crew(workers, lambda *news: None)
        return library_bytes(qualify_grid(library, TINY, crew, given, note))

    two = qualify(2, local.append)
    with dask():
        four = qualify(4, spread.append)
    assert sorted(local) == sorted(spread) == sorted(runs[:4])
    assert two == four == library_bytes(found)


def resident_mib():
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="Linux tells it")
def test_dask_keeps_nothing_of_jobs_that_are_done(dask):
    """500 jobs that carry 125 MB in all leave less than a third of it here."""
    size = 250_000
    jobs = [(os.urandom(size - 1) + bytes([i]),) for i in range(50)]
    with dask():
        assert sum(run_jobs(len, jobs, int, 2, batch_size=1)) == 50 * size
        before_mib = resident_mib()
        for _ in range(10):
            assert sum(run_jobs(len, jobs, int, 2, batch_size=1)) == 50 * size
        assert resident_mib() - before_mib < 40.0


@needs_ray
@pytest.mark.skipif(os.name == "nt", reason="no such signal")
def test_ray_sends_jobs_again_whose_process_is_killed(tmp_path, monkeypatch):
    """Ray's processes import what they call, here from among the tests."""
    monkeypatch.setenv("PYTHONPATH", str(SUPPORT))
    for often in "once", "always":
        (tmp_path / often).mkdir()

    def kept(name):
        return Journal(tmp_path / f"{name}.jsonl")

    def thirds(often, times, jobs):
        each = [(times, number, tmp_path / often) for number in range(jobs)]
        with keeping(kept(often)):
            return list(run_jobs(killed_work, each, float, 2, batch_size=1))

    with on_ray(None, 2):
        assert thirds("once", 1, 9) == [n / 3 for n in range(9)]
        with pytest.raises(WorkerError, match="memory"):
            thirds("always", 1000, 3)
    assert len(list((tmp_path / "once").iterdir())) == 1
    numbers = [
        sorted(key[-1] for key, _ in kept(often).found) for often in ("once", "always")
    ]
    assert numbers == [list(range(9)), [0, 1]], "each once"


@needs_ray
def test_a_ray_cluster_that_nobody_answers_for_is_told_at_once():
    with socket.socket() as taken:  # bound, and not listening
        taken.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{taken.getsockname()[1]}"
        told = f"--address {address}: no Ray cluster: .* `ray start --head`"
        with pytest.raises(CommandError, match=told), on_ray(address, 1):
            pass


@needs_ray
def test_ray_finds_the_same_by_processes_that_stay_and_go(built_here, proven_here):
    """Started as the command line starts it."""
    with on_ray(None, 2):
        assert built(2) == built_here
        assert proven(2) == proven_here
        context = importlib.import_module("ray").get_runtime_context()
        assert "py_executable" not in context.runtime_env, "by this Python, not by uv"
        # They stay for all calls: each new one would load the physics again.
        found = [run_jobs(os.getpid, [()] * 8, int, 2, batch_size=1) for _ in range(3)]
        assert len({process for each in found for process in each}) <= 2
    # Ray put its pool in the place of joblib's for `multiprocessing`.
    with parallel_config(backend="multiprocessing"):
        assert set(run_jobs(os.getppid, [()] * 4, int, 2)) == {os.getpid()}
