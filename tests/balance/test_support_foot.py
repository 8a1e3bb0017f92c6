"""Whether the swing foot is down, by the legs and by what its sole bears."""

import math
from dataclasses import replace

import numpy as np
import pytest
from walk_record import walk_record

from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.balance.gains import derive_gains, open_loop
from gaitchain.balance.leg_kinematics import legs_of
from gaitchain.balance.state import (
    Foot,
    GaitState,
    Pelvis,
    Planar,
    SoleLoads,
    StepTimes,
    View,
)
from gaitchain.balance.support_foot import touched_down
from gaitchain.gait.zmp import Support
from gaitchain.messages import CONTROL_PERIOD_S, Command
from gaitchain.robot.box_robot import load_box_robot
from gaitchain.sim.world import World
from gaitchain.walker.walker import Walker

LEGS = legs_of(load_box_robot("res"))
GAINS = derive_gains(LEGS)
WEIGHT = LEGS.mass * 9.81
NONE = np.full(2, math.nan)
LEVEL, HIGH = 0.0, 0.03


TIMES = StepTimes(*[1.0] * len(StepTimes._fields))


def touch(clearance, load, side=1.0, gains=GAINS):
    """Touch-down of a walk that measures a clearance [m] and loads [N]."""
    swing = Foot(0.0, -LEGS.hip_width, 0.0)
    measured = View(Pelvis(), Planar(), 0.0, Planar(), swing, 0.5, clearance)
    state, load = GaitState(side=side), SoleLoads(*load)
    walk = walk_record(gains, TIMES, state=state, measured=measured, load=load)
    return touched_down(LEGS, walk)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(
    ("clearance", "borne", "found"),
    [
        (LEVEL, math.nan, (True, True)),
        (HIGH, math.nan, (False, False)),
        (LEVEL, 0.5, (True, True)),
        (LEVEL, 0.0, (False, True)),  # over lower ground
        (HIGH, 0.5, (False, True)),  # on a block, or caught by its side
        (HIGH, 0.0, (False, False)),
    ],
)
def test_a_sure_touch_down_is_seen_by_all_there_is(side, clearance, borne, found):
    load = np.array([1.0 - borne, borne])[:: int(side)] * WEIGHT
    assert touch(clearance, load, side) == found


def test_a_walk_without_feedback_sees_no_touch_down():
    load = np.array([0.0, WEIGHT])
    assert touch(LEVEL, load, gains=open_loop(GAINS)) == (False, False)


@pytest.mark.parametrize("lost", [None, NONE, np.full(2, math.inf)])
def test_soles_that_fail_while_it_walks_do_not_bring_it_down(brisk, lost):
    walker = Walker(brisk)
    backend = MujocoBackend(brisk.robot, World(foot_sensors=True))
    backend.connect(walker.stand)
    walker.command(Command(0.2))
    for tick in range(round(5.0 / CONTROL_PERIOD_S)):
        sensors = backend.read()
        if tick > round(2.0 / CONTROL_PERIOD_S):
            sensors = replace(sensors, foot_load=lost)
        backend.write(walker.step(sensors).position)
    assert not backend.fallen
    assert walker.gait.steps > 6


def test_the_swing_sole_bears_nothing(brisk):
    """The loads that it is told are those of the physics, on the right sides."""
    walker = Walker(brisk)
    backend = MujocoBackend(brisk.robot, World(foot_sensors=True))
    backend.connect(walker.stand)
    walker.command(Command(0.2))
    loads = {Support.LEFT_SINGLE: [], Support.RIGHT_SINGLE: []}
    for _ in range(round(4.0 / CONTROL_PERIOD_S)):
        sensors = backend.read()
        backend.write(walker.step(sensors).position)
        if walker.gait.steps > 2 and walker.gait.support in loads:
            loads[walker.gait.support].append(sensors.foot_load / WEIGHT)
    left, right = (np.median(seen, axis=0) for seen in loads.values())
    np.testing.assert_allclose(left, [1.0, 0.0], atol=0.15)
    np.testing.assert_allclose(right, [0.0, 1.0], atol=0.15)
