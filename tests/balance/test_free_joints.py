"""Legs of seven joints can move and leave their feet in place; they come back."""

import numpy as np
import pytest
from leg_makes import SEVEN, SIX, make_robot

from gaitchain.balance.state import STAND
from gaitchain.build.search_walks import Walk, walk_of
from gaitchain.gait.stride.shape import MODEL_SHAPE
from gaitchain.messages import GRAVITY, Sensors
from gaitchain.walker.stride_setup import make_walk

_STOOD_S = 10.0


def stand_again(make, walk):
    """Plan a walk and a stand; return how far its joints are off, and their rates."""
    robot = make_robot(make, np.random.default_rng(1))
    timing = MODEL_SHAPE.timing(robot)
    poses, gaits = walk_of(robot, MODEL_SHAPE, timing.step, walk, 0.3, steps=12)
    controller = make_walk(poses, timing, feedback=False)
    goals = list(poses.step_targets(gaits[:, 1:].tolist()))
    controller.begin_shift(True)
    first = before = controller.reference
    period, stood = controller.times.period, 0
    upright = np.array([0.0, 0.0, GRAVITY])
    while stood * period < _STOOD_S:
        joints = controller.reference
        rates = (joints - before) / period
        sensors = Sensors(0.0, joints, rates, np.zeros(3), upright)
        controller.drive(sensors, lambda _: goals.pop(0))
        before, stood = joints, stood + (controller.phase == STAND)
    last = controller.reference
    return np.abs(last - first).max(), np.abs(last - before).max() / period


@pytest.mark.parametrize("make", [SIX, SEVEN])
@pytest.mark.parametrize("walk", [Walk(0.5), Walk(0.3, turn=0.3)], ids=["ahead", "arc"])
def test_after_a_walk_the_joints_are_where_they_stood(make, walk):
    off, rate = stand_again(make, walk)
    assert off < 0.03
    assert rate < 0.01
