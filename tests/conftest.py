"""What several modules need: the robot, and small libraries that physics built."""

import fcntl
import os
import pickle
import sys
from zlib import crc32

import hypothesis
import pytest
from planned_library import planned_library
from small_build import brief_schedules
from toy_file import toy

from gaitchain.build import command_envelope, recovery_walks, usual_errors
from gaitchain.build.grid import Grid
from gaitchain.build.pipeline import build_library
from gaitchain.build.qualify import qualify_grid
from gaitchain.build.workers import Crew
from gaitchain.discover.loaded_robot import load_robot
from gaitchain.gait.build_config import BuildConfig
from gaitchain.robot.box_robot import load_box_robot

# The same examples on every machine, and as slow as it is;
# `pytest --hypothesis-profile default` draws others.
hypothesis.settings.register_profile(
    "repeatable",
    deadline=None,
    derandomize=True,
    suppress_health_check=[hypothesis.HealthCheck.too_slow],
)
hypothesis.settings.load_profile("repeatable")

# Programs that tests start begin with bytecode, whatever this shell asks of Python; and
# what pytest makes of assertions is kept, which is 7 s of each process of the next run.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

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
    poses_per_layer=(12, 1, 1, 12),
    walks=6,
    qualification_walks=30,
    recovery_walks=6,
    gate_runs=1,
    gate_share=0.0,
    seed=1,
)

BUILT = {"built", "brisk"}  # half a minute each


def pytest_collection_modifyitems(items):
    """Mark as slow what needs a built library or a browser; begin with what takes long.

    Modules are mixed, so that none is left to the end. One builds each library first;
    others that need it come when it is there, so that no process waits for it.
    """
    for item in items:
        if BUILT & set(item.fixturenames) or item.get_closest_marker("browser"):
            item.add_marker("slow")
    items.sort(key=lambda item: crc32(item.path.name.encode()))
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    needing = [[i.path for i in items if name in i.fixturenames] for name in BUILT]
    builders = {paths[0] for paths in needing if paths}
    groups = [builders, slow.difference(*needing), slow]  # then all others
    items.sort(key=lambda item: [item.path not in group for group in groups])


@pytest.fixture(scope="session", autouse=True)
def one_core():
    """Let whatever is told no number of processes work in this one.

    Others test beside it, and each process of a pool loads the physics for 1.4 s.
    """
    with pytest.MonkeyPatch.context() as patch:
        if hasattr(os, "sched_getaffinity"):
            own = os.sched_getaffinity
            patch.setattr(os, "sched_getaffinity", lambda pid: {min(own(pid))})
        yield


@pytest.fixture(autouse=True)
def ordinary_priority():
    """Refuse a test that leaves this process, and all that it starts, before others."""
    yield
    if hasattr(os, "sched_getscheduler"):
        assert os.sched_getscheduler(0) == os.SCHED_OTHER


@pytest.fixture(scope="session")
def res():
    return load_box_robot("res")


@pytest.fixture(scope="session")
def toy_path(tmp_path_factory):
    """The file of a robot that nobody sells."""
    path = tmp_path_factory.mktemp("toy") / "toy.xml"
    path.write_text(toy(), "utf-8")
    return path


@pytest.fixture(scope="session")
def toy_library(toy_path):
    """Steps of that robot, planned and not walked."""
    return planned_library(load_robot(toy_path))


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
def built(once):
    """A library with several speeds, its report, and all progress on the way."""

    def build():
        progress = []
        library, report = build_library(SMALL, lambda *news: progress.append(news))
        return library, report, progress

    return once("built", build)


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
    """A library of strides that walks both ways along, across and around."""
    return once("brisk", _build_brisk)


def _build_brisk():
    with pytest.MonkeyPatch.context() as patch:
        brief_schedules(patch)
        patch.setattr(recovery_walks, "_SECONDS", 8.0)
        patch.setattr(recovery_walks, "_SEGMENTS", 2)
        patch.setattr(command_envelope, "_RUNS", 2)  # at every end of the range
        patch.setattr(command_envelope, "_SECONDS", 10.0)
        patch.setattr(command_envelope, "_SCHEDULES", 1)
        patch.setattr(command_envelope, "_HARD_RUNS", 1)
        patch.setattr(usual_errors, "_RUNS", 1)  # of each command
        patch.setattr(usual_errors, "_RUNS_OFF", 1)
        patch.setattr(usual_errors, "_SECONDS", 3.0)
        return build_library(SMALL_BRISK, workers=1)[0]
