"""What several modules need: the robot, and small libraries that physics built."""

import fcntl
import os
import pickle
from dataclasses import replace

import pytest

from gaitchain.build import command_envelope
from gaitchain.build.grid import Grid
from gaitchain.build.pipeline import build_library
from gaitchain.build.qualify import qualify_grid
from gaitchain.build.workers import Crew
from gaitchain.errors import ChainError
from gaitchain.gait.build_config import BuildConfig
from gaitchain.robot.box_robot import load_box_robot

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
# The same for strides: in place, ahead, back, to the side and around.
SMALL_BRISK = BuildConfig(
    preset="brisk",
    poses_per_layer=(12, 3, 3, 12),
    walks=6,
    qualification_walks=30,
    epsilon=0.0,
    gate_runs=1,
    gate_share=0.0,
)


@pytest.fixture(scope="session")
def res():
    return load_box_robot("res")


@pytest.fixture(scope="session")
def once(tmp_path_factory):
    """Make something once for all processes of a test run; the others wait for it."""
    if "PYTEST_XDIST_WORKER" not in os.environ:
        return lambda name, make: make()
    folder = tmp_path_factory.getbasetemp().parent  # of the run, not of the worker

    def made(name, make):
        file = folder / f"{name}.pickle"
        with (folder / f"{name}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not file.exists():
                file.write_bytes(pickle.dumps(make()))
            return pickle.loads(file.read_bytes())

    return made


@pytest.fixture(scope="session")
def build_walking():
    """Build with the first seed whose few candidates make a library that walks.

    So few do not always join every pair of step lengths, nor hold a steady walk.
    Returns the library, the report and all that was told on the way.
    """

    def build(config, speeds=1):
        found = []
        for seed in range(10):
            told = []
            try:
                library, report = build_library(
                    replace(config, seed=seed),
                    lambda *news, told=told: told.append(news),
                )
            except ChainError as error:
                found.append(f"seed {seed}: {error}")
                continue
            low, high = library.speed_range
            stops = library.allowed_pairs[1:, 0].any()
            if library.qualified and stops and (low < high or speeds == 1):
                return library, report, told
            found.append(f"seed {seed}: {low} to {high} m/s, stops: {stops}")
        raise AssertionError("\n".join(found))

    return build


@pytest.fixture(scope="session")
def built(build_walking, once):
    """A library with several speeds, its report, and all that was told on the way."""
    return once("built", lambda: build_walking(SMALL, speeds=2))


@pytest.fixture(scope="session")
def library(built):
    return built[0]


@pytest.fixture(scope="session")
def qualified(library, once):
    """That library, qualified in the nominal world alone, and all runs of it."""

    def walk_all():
        runs, crew = [], Crew(1, lambda *news: None)
        grid = Grid((), corners=False)
        return qualify_grid(library, grid, crew, note=runs.append), runs

    return once("qualified", walk_all)


@pytest.fixture(scope="session")
def brisk(once):
    """A dynamic library that walks both ways along, across and around."""
    return once("brisk", _build_brisk)


def _build_brisk():
    found = []
    for seed in range(5):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(command_envelope, "_RUNS", 2)  # at every end of the range
            patch.setattr(command_envelope, "_SECONDS", 10.0)
            library, _ = build_library(replace(SMALL_BRISK, seed=seed))
        span = library.command_range
        both = (span.vx, span.vy, span.yaw_rate)
        if library.qualified and all(low < 0.0 < high for low, high in both):
            return library
        found.append(f"seed {seed}: qualified {library.qualified}, {span}")
    raise AssertionError("\n".join(found))
