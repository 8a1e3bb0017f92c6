"""What several modules need: the robot, and a small library that physics built."""

import pytest

from gaitchain.biped import load_biped
from gaitchain.build import BuildConfig, build

# Small enough for seconds, large enough for starts, stops and several speeds. Any
# share of the gate counts as passed: the candidates' quality is not tested here.
SMALL = BuildConfig(
    poses_per_layer=(5, 8, 10, 5),
    seed=1,
    walks=12,
    steps_per_walk=4,
    qualification_walks=20,
    gate_runs=2,
    gate_share=0.0,
)


@pytest.fixture(scope="session")
def res():
    return load_biped("res")


@pytest.fixture(scope="session")
def built():
    """The library, the report, and all that was told on the way."""
    told = []
    library, report = build(SMALL, lambda *news: told.append(news))
    return library, report, told


@pytest.fixture(scope="session")
def library(built):
    return built[0]
