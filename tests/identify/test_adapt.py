"""A library for an identified robot keeps what tests took away from its file's."""

from dataclasses import replace

import numpy as np
import pytest
from servo_bench import RES
from small_build import few_steady_walks

from gaitchain.analysis.simulated_walk import run_unrecorded
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.build.workers import Crew
from gaitchain.gait.command_range import CommandRange
from gaitchain.gait.library_file import load_library, save_library
from gaitchain.gait.qualification import GridVerdict
from gaitchain.gait.schedule import Segment
from gaitchain.identify.adapt import adapt
from gaitchain.identify.fit import Fit
from gaitchain.messages import Command
from gaitchain.robot.identified import Identified
from gaitchain.walker.walker import Walker

SLOW = CommandRange((-0.1, 0.2), (-0.1, 0.1), (-0.3, 0.3))


@pytest.fixture(scope="module")
def before():
    """The shipped library, of which a grid forbids more, in a smaller range."""
    shipped = load_library("src/gaitchain/data/res.gait")
    steps = np.argwhere(shipped.allowed_pairs)[::40]
    forbidden = np.zeros_like(shipped.grid.forbidden)
    forbidden[tuple(steps.T)] = True
    none = np.zeros(forbidden.shape, dtype=np.int64)
    few = replace(shipped.config, gate_runs=2, gate_share=0.0)
    grid = GridVerdict(none, none, forbidden)
    return replace(shipped, grid=grid, steady=SLOW, config=few)


@pytest.fixture(scope="module")
def after(before):
    return adapted(before, Identified.of_file(12))


def adapted(before, found):
    fit = Fit(found, (), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), ())
    with few_steady_walks():
        return adapt(before, fit, Crew(1, lambda *told: None))


@pytest.mark.slow
def test_steps_that_a_grid_forbade_stay_forbidden(before, after, tmp_path):
    """Without its verdict on worlds, in which this robot did not walk."""
    assert after.grid is None
    assert after.qualification.grid is None
    assert after.allowed_pairs.any()
    assert not (after.allowed_pairs & before.grid.forbidden).any()
    save_library(after, tmp_path / "mine.gait")
    again = load_library(tmp_path / "mine.gait", RES)
    assert not (again.as_built().allowed_pairs & before.grid.forbidden).any()


@pytest.mark.slow
def test_the_range_is_not_wider_than_before(before, after):
    for own, most in zip(after.command_range.ends, before.steady.ends, strict=True):
        assert most[0] <= own[0] <= 0.0 <= own[1] <= most[1]
    assert after.command_range.vx[1] > 0.0


@pytest.mark.slow
def test_what_is_usual_of_its_steps_is_learned_anew(before, after):
    """Play puts steps off that no push did, so that nothing is to be slowed down."""
    worn = replace(Identified.of_file(12), backlash_deg=np.full(12, 1.5))
    assert adapted(before, worn).usual_off > 1.5 * after.usual_off


@pytest.fixture(scope="module")
def as_in_its_file(library):
    """The library of key poses, for a robot that was identified as that of its file."""
    robot = library.robot.as_identified(Identified.of_file(12))
    return replace(library, poses=replace(library.poses, robot=robot))


def way(library, robot):
    """Return when a robot that walks 8 s ahead fell [s], and how far it came [m]."""
    backend = MujocoBackend(robot)
    ahead = Segment(Command(library.command_range.vx[1]), 8.0)
    walked = run_unrecorded(Walker(library), backend, (ahead,))
    return walked.fell_at_s, backend.data.qpos[0]


def test_boxes_that_were_identified_walk_key_poses_as_before(library, as_in_its_file):
    """Other robots' poses are placed and balanced otherwise. In physics of both."""
    fell_at_s, before_m = way(library, library.robot)
    assert fell_at_s is None and before_m > 0.2
    for robot in (library.robot, as_in_its_file.robot):
        fell_at_s, after_m = way(as_in_its_file, robot)
        assert fell_at_s is None
        assert after_m == pytest.approx(before_m, abs=0.02)


def test_a_library_of_key_poses_is_kept_for_boxes_that_were_identified(library):
    own = adapted(library, Identified.of_file(12))
    assert own.command_range == library.command_range
    gates = [found.qualification.gate for found in (own, library)]
    assert [gate.survived for gate in gates] == [gate.schedules for gate in gates]
