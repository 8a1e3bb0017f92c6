"""What is measured beside the rate: push limits, stops, falls."""

import math

import numpy as np
import pytest

from gaitchain.build.push import MOST, RESOLUTION, PushTest
from gaitchain.cli.libraries import shipped_library
from gaitchain.gait.library_file import load_library
from gaitchain.gait.schedule import Segment
from gaitchain.messages import GRAVITY, Command
from gaitchain.proof import measures
from gaitchain.proof.falls import judge_falls, potential_drop, watch_fall
from gaitchain.proof.push_limit import FEW, HALF, log_normal_quantile, push_limits
from gaitchain.proof.stops import Stop, judge_stops, measure_stop
from gaitchain.sim.push import Push
from gaitchain.sim.world import World

LIBRARY = load_library(shipped_library())
AHEAD = (Segment(Command(0.4), 4.0),)
MEAN, SPREAD, WALKS = math.log(0.25), 0.3, 12


@pytest.mark.parametrize(("part", "z"), [(HALF, 0.0), (FEW, -1.6448536)])
def test_intervals_hold_the_true_impulse_as_often_as_they_say(part, z):
    """Of 1000 made-up robots, whose impulses are log-normal, 19 in 20."""
    rng, true, held = np.random.default_rng(4), math.exp(MEAN + z * SPREAD), 0
    for _ in range(1000):
        found = log_normal_quantile(rng.normal(MEAN, SPREAD, WALKS), part, 0.95)
        assert found.low < found.ns < found.high
        held += found.low <= true <= found.high
    assert 0.93 < held / 1000 < 0.97


def test_sides_are_fitted_apart_and_the_hardest_push_is_counted():
    found = [
        PushTest(i, side, 4.0, ns)
        for side, all_ns in ((0.0, (8.0, 16.0, 32.0)), (90.0, (0.0, 50.0 * MOST)))
        for i, ns in enumerate(all_ns)
    ]
    ahead, left = push_limits(found, 50.0)
    assert ahead.j50.ns == pytest.approx(16.0)
    assert ahead.j5.ns == pytest.approx(16.0 * math.exp(-1.6448536 * math.log(2.0)))
    assert (ahead.withstood, left.withstood) == (0, 1)
    assert left.walks == 2
    assert (ahead.fell_alone, left.fell_alone) == (0, 1)
    assert left.j50 is left.j5 is None, "one that falls alone and one other"
    nearly = 50.0 * (MOST - 0.5 * RESOLUTION)  # the hardest push made it fall
    assert push_limits([PushTest(0, 0.0, 4.0, nearly)], 50.0)[0].withstood == 0
    tried = [push for _, push in measures._spread((ahead, left), 2)]
    assert tried == [(0.0, ahead.j50)] * 2


def test_a_stop_takes_time_and_way_but_not_much():
    stop = measure_stop(LIBRARY, World(), AHEAD)
    assert stop.stood
    assert 0.3 < stop.seconds < 2.5
    assert 0.03 < stop.metres < 0.4 * stop.seconds
    still = measure_stop(LIBRARY, World(), (Segment(Command(), 1.0),))
    assert still.stood
    assert (still.seconds, round(still.metres, 2)) == (0.0, 0.0)
    both = judge_stops([stop, still])
    assert both.seconds[-1] == stop.seconds
    assert both.metres[0] == pytest.approx(0.5 * (stop.metres + still.metres))


def test_who_falls_does_not_stop():
    felled = World(push=(Push(90.0, 90.0, 2.0),))
    stop = measure_stop(LIBRARY, felled, AHEAD)
    assert (stop.stood, stop.fell) == (False, True)
    restless = Stop(6.0, 1.0, stood=False, fell=False)
    report = judge_stops([stop, restless])
    assert (report.walks, report.stood, report.fell) == (2, 0, 1)
    assert report.seconds == ()


def test_the_energy_of_a_fall_is_what_its_height_and_push_bring():
    """A push of J brings at most J^2 / 2 m beyond what m g h and the walk have."""
    drop, impulse = potential_drop(LIBRARY), 60.0
    assert drop.potential_j == pytest.approx(drop.mass_kg * GRAVITY * drop.com_m)
    world = World(push=(Push(impulse, 90.0, 3.0),))
    fall = watch_fall(LIBRARY, world, AHEAD).fall
    brought = impulse**2 / (2.0 * drop.mass_kg) + 0.5 * drop.mass_kg * 0.6**2
    assert 0.3 * drop.potential_j < fall.kinetic_j < drop.potential_j + 2.0 * brought
    # The top of a rod of the robot's height that falls over has sqrt(3 g l).
    assert 2.0 < fall.head_mps < 1.5 * math.sqrt(3.0 * GRAVITY * 2.0 * drop.com_m)
    assert 0.1 < fall.seconds < 2.0
    kept = watch_fall(LIBRARY, World(), AHEAD)
    assert kept.fall is None
    report = judge_falls("here", [watch_fall(LIBRARY, world, AHEAD), kept])
    assert (report.walks, report.falls) == (2, 1)
    assert report.causes == ((fall.cause, 1),)
    assert report.kinetic_j == (fall.kinetic_j, fall.kinetic_j)
