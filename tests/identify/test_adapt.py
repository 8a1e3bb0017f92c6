"""A library for an identified robot keeps what tests took away from its file's."""

from dataclasses import replace

import numpy as np
import pytest
from servo_bench import RES
from small_build import few_steady_walks

from gaitchain.build.workers import Crew
from gaitchain.gait.command_range import CommandRange
from gaitchain.gait.library_file import load_library, save_library
from gaitchain.gait.qualification import GridVerdict
from gaitchain.identify.adapt import adapt
from gaitchain.identify.fit import Fit
from gaitchain.robot.identified import Identified

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
