"""A build on a cluster: dask and Ray, both real, give the library of this machine."""

import pytest
from joblib import parallel_config

from gaitchain.build import command_envelope, usual_errors
from gaitchain.build.pipeline import build_library
from gaitchain.cli.cluster import _start_ray
from gaitchain.gait.build_config import BuildConfig
from gaitchain.gait.library_file import library_bytes

pytestmark = pytest.mark.slow

SMALL = BuildConfig(
    preset="brisk",
    poses_per_layer=(5, 1, 1, 5),
    walks=4,
    qualification_walks=4,
    recovery_walks=3,
    gate_runs=2,
    gate_share=0.0,
)


def built(workers):
    return library_bytes(build_library(SMALL, workers=workers)[0])


@pytest.fixture(scope="module")
def here():
    """Few steady walks, for all tests of this module."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(command_envelope, "_RUNS", 1)
        patch.setattr(command_envelope, "_SECONDS", 4.0)
        patch.setattr(usual_errors, "_RUNS", 1)
        yield built(1)


def test_dask_builds_the_same_bytes(here):
    distributed = pytest.importorskip("distributed")
    client = distributed.Client(
        n_workers=2, threads_per_worker=1, dashboard_address=None
    )
    with client, parallel_config(backend="dask", client=client):
        assert built(2) == here


def test_ray_builds_the_same_bytes(here):
    """Started as the command line starts it."""
    ray = pytest.importorskip("ray")
    _start_ray(None, 2)
    try:
        with parallel_config(backend="ray"):
            assert built(2) == here
    finally:
        ray.shutdown()
