"""What several modules need: the robot, and a small library that physics built."""

from dataclasses import replace

import pytest

from gaitchain.biped import load_biped
from gaitchain.build import BuildConfig, build_library
from gaitchain.errors import ChainError

# Small enough for seconds, large enough for starts, stops and several speeds. Any
# share of the gate counts as passed: the candidates' quality is not tested here.
SMALL = BuildConfig(
    poses_per_layer=(5, 10, 15, 5),
    walks=8,
    steps_per_walk=4,
    qualification_walks=16,
    gate_runs=2,
    gate_share=0.0,
)


@pytest.fixture(scope="session")
def res():
    return load_biped("res")


@pytest.fixture(scope="session")
def built():
    """The library, the report, and all that was told on the way.

    So few candidates do not always join every pair of step lengths; the first seed
    that does is taken.
    """
    for seed in range(20):
        told = []
        try:
            config = replace(SMALL, seed=seed)
            return *build_library(
                config, lambda *news, told=told: told.append(news)
            ), told
        except ChainError as error:
            last = error
    raise last


@pytest.fixture(scope="session")
def library(built):
    return built[0]
