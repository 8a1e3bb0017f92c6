"""What physics measured as the usual DCM error of a step is what walking shows."""

from importlib.resources import files

import numpy as np
import pytest

from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.balance.state import DOUBLE
from gaitchain.gait.library_file import load_library
from gaitchain.messages import Command
from gaitchain.sim.world import World
from gaitchain.walker.walker import Walker

LIBRARY = load_library(files("gaitchain") / "data" / "res.gait")
LEG = LIBRARY.robot.reduced.leg_length


def errors_of(command, seconds=6.0, run_in=8):
    """Return each step's largest DCM error, and the usual one of such a step [m]."""
    walker = Walker(LIBRARY)
    backend = MujocoBackend(LIBRARY.robot, World(seed=5, model_error=0.1))
    backend.connect(walker.stand)
    walker.command(command)
    found, walk = [], walker.gait._walk
    for _ in range(round(seconds / walker.period_s)):
        steps, worst, usual = walker.gait.steps, walk.state.worst, walk.target
        made = walk.phase == DOUBLE
        backend.write(walker.step(backend.read()).position)
        if made and walker.gait.steps > steps:
            found.append((worst, usual.usual_error))
    assert not backend.fallen
    return np.array(found[run_in:]).T


@pytest.mark.parametrize("part", [0.5, 1.0, -1.0])
def test_an_undisturbed_walk_stays_below_the_usual_errors(part):
    """Not by far: worlds of the training, some of which push, differ from this one."""
    low, high = LIBRARY.command_range.vx
    worst, usual = errors_of(Command(part * high if part > 0 else -part * low))
    assert np.mean(worst <= usual) >= 5.0 / 6.0
    assert np.median(worst / usual) > 0.25


def test_long_steps_have_larger_errors():
    lengths = LIBRARY.poses.strides[:, 0]
    straight = np.flatnonzero((LIBRARY.poses.strides[:, 1:] == 0.0).all(axis=1))
    last = max(straight, key=lambda j: lengths[j])
    short = min(straight[1:], key=lambda j: abs(lengths[j]))
    errors = LIBRARY.pair_error
    assert errors[last, last] > 1.5 * errors[short, short]
    assert (errors[1:, 1:] > 0.005 * LEG).all()
    assert (errors < 0.5 * LEG).all()
