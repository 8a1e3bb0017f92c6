"""Feet that turn on the ground are measured, and slow the robot down."""

import numpy as np
import pytest
from planned_library import planned_library

from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.balance.state import DOUBLE, SINGLE
from gaitchain.chain.recovery import ERRORS, Option
from gaitchain.cli.libraries import shipped_library
from gaitchain.gait.library_file import load_library
from gaitchain.messages import Command
from gaitchain.robot.box_robot import load_box_robot
from gaitchain.sim.world import World
from gaitchain.walker.step_size import StepSize
from gaitchain.walker.walker import Walker

LIBRARY = load_library(shipped_library())


def slips_of(world, command, seconds=8.0):
    """Turn of the support foot in single support of each step, measured and true."""
    library = planned_library(load_box_robot("res"))
    walker = Walker(library, require_qualified=False)
    walk, backend = walker.gait._walk, MujocoBackend(library.robot, world)
    backend.connect(walker.stand)
    walker.command(command)
    found, began, true, phase = [], 0.0, 0.0, None
    for _ in range(round(seconds / walker.period_s)):
        yaw = backend.foot_yaws()[0 if walk.side > 0 else 1]
        if walk.phase == SINGLE:
            began = yaw if phase != SINGLE else began
            true = abs(yaw - began)
        elif walk.phase == DOUBLE and phase == SINGLE:
            found.append((walk.state.slip, true))
        phase = walk.phase
        backend.write(walker.step(backend.read()).position)
    assert not backend.fallen
    return np.array(found).T


@pytest.mark.parametrize("friction", [0.8, 0.3])
def test_the_gyro_tells_how_far_a_foot_turned(friction):
    measured, true = slips_of(World(friction=friction), Command(0.3))
    assert len(true) > 8
    np.testing.assert_allclose(measured, true, atol=np.radians(1.0))


def test_feet_turn_further_on_a_slippery_floor():
    rough, slippery = (
        np.median(slips_of(World(friction=mu), Command(0.3))[1]) for mu in (0.8, 0.3)
    )
    assert slippery > 1.5 * rough


class Third:
    """Asks for a third of the range."""

    def options(self, unrest, most):
        return [Option(min(0.3, most), 0.0)]


def test_a_robot_whose_feet_slip_goes_slowly_and_says_why():
    walker = Walker(LIBRARY)
    gait = walker.gait
    gait.step_size = StepSize(Third(), ERRORS)
    backend = MujocoBackend(LIBRARY.robot, World(friction=0.25))
    backend.connect(walker.stand)
    walker.command(Command(LIBRARY.command_range.vx[1]))
    notes = []
    for _ in range(600):
        backend.write(walker.step(backend.read()).position)
        notes.append(walker.note)
    assert not backend.fallen
    assert "its feet slip: walks at 30 % of the command" in notes


def test_what_a_step_was_off_is_the_larger_of_error_and_slip():
    gait = Walker(LIBRARY).gait
    state, leg = gait._walk.state, LIBRARY.robot.reduced.leg_length
    usual, slipped = gait._walk.target.usual_error / leg, False
    for error, slip in ((0.4, 0.2), (0.1, 0.6), (0.0, 0.01), (0.0, 4.0 * ERRORS[1])):
        gait._walk.state = state._replace(worst=error * leg, slip=slip)
        aside = 0.5 * slip  # of a foot half a leg ahead
        assert gait._off() == pytest.approx((error - usual, aside))
        gait._part_of_command(None)
        slipped = slipped if aside < ERRORS[0] else aside > error - usual
        assert gait._slips == slipped, "what disturbed it last is why it is slow"
