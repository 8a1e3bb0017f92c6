"""The walks of the search: what is walked, and what it counts."""

import math

import numpy as np
import pytest
from other_robots import resized

from gaitchain.balance.state import STAND
from gaitchain.build.search_walks import WALKS, Walk, fits, steps_held, walk_of
from gaitchain.build.stride_feasibility import feasible_pairs
from gaitchain.build.stride_rollout import find_fall
from gaitchain.gait.stride.shape import StrideShape
from gaitchain.messages import GRAVITY
from gaitchain.robot.box_robot import load_box_robot
from gaitchain.sim.world import World

RES = load_box_robot("res")
BIPED = RES.reduced
DEFAULT = StrideShape()
STEP_S = DEFAULT.timing(RES).step


def test_a_plan_within_the_legs_reach_fits_and_one_beyond_does_not():
    task = RES, DEFAULT, DEFAULT.timing(RES), Walk(1.0)
    assert fits(*task, 0.1, None)
    assert not fits(*task, 1.5, None)
    assert not fits(*task, 0.1, 10.0), "10 deg/s"


@pytest.mark.parametrize(
    "walk",
    [
        Walk(1.0),
        Walk(0.0, outward=0.15),
        Walk(0.4, turn=0.3),
    ],
)
def test_a_walk_goes_from_a_stand_to_a_stand(walk):
    poses, gaits = walk_of(RES, DEFAULT, STEP_S, walk, 0.2)
    assert gaits[0, 0] == gaits[-1, 3] == 0
    assert len(gaits) == walk.steps
    np.testing.assert_array_equal(gaits[1:, 0], gaits[:-1, 3])
    strides = poses.strides[gaits[:, 3]]
    step_s = DEFAULT.timing(RES).step
    speed = 0.2 * walk.ahead * math.sqrt(GRAVITY * BIPED.leg_length)
    np.testing.assert_allclose(strides[2:-3, 0], speed * step_s)
    np.testing.assert_allclose(strides[[1, -3], 0], 2 / 3 * speed * step_s)
    np.testing.assert_allclose(strides[[0, -2], 0], 1 / 3 * speed * step_s)
    # One foot leads aside and around; the other follows.
    np.testing.assert_allclose(strides[2:-3:2, 1], walk.outward * BIPED.leg_length)
    np.testing.assert_allclose(strides[2:-3:2, 2], walk.turn)
    np.testing.assert_array_equal(strides[3:-3:2, 1:], 0.0)


def test_a_walk_slows_down_over_several_steps():
    """Short soles cannot stop from half of the steps that they can make."""
    short, timing, pace = resized(RES, sole_length=0.08), DEFAULT.timing(RES), 0.2
    poses, _ = walk_of(short, DEFAULT, STEP_S, Walk(0.5), pace)
    longest = int(np.argmax(poses.strides[:, 0]))
    stops = feasible_pairs(poses, timing, math.inf)[:, STAND]
    assert stops[1]
    assert not stops[longest]
    assert fits(short, DEFAULT, timing, Walk(1.0), pace, math.inf)


def test_steps_held_are_those_before_the_fall():
    """As physics counts them; a fall, even in the last one, halves what they count."""
    walk, calm, timing = Walk(1.0), World(), DEFAULT.timing(RES)
    assert steps_held(RES, DEFAULT, timing, walk, 0.2, calm) == 1.0
    slippery = World(friction=0.02)
    poses, gaits = walk_of(RES, DEFAULT, STEP_S, walk, 0.2)
    fell_in = find_fall(poses, timing, gaits, slippery)
    assert fell_in is not None
    held = steps_held(RES, DEFAULT, timing, walk, 0.2, slippery)
    assert held == pytest.approx(0.5 * fell_in / len(gaits))


def test_a_walk_beyond_the_plan_counts_by_the_part_that_can_be_made():
    """Among shapes that all break a limit, some do so by less."""
    walk, timing, pace = Walk(1.0), DEFAULT.timing(RES), 0.6
    limit = World().speed_limit_deg_s
    assert not fits(RES, DEFAULT, timing, walk, pace, limit)
    part = next(
        part
        for part in (0.75, 0.5, 0.25)
        if fits(RES, DEFAULT, timing, walk.times(part), pace, limit)
    )
    held = steps_held(RES, DEFAULT, timing, walk, pace, World())
    alone = steps_held(RES, DEFAULT, timing, walk.times(part), pace, World())
    assert held == pytest.approx(part * alone)
    assert 0.0 < held < 1.0
    assert steps_held(RES, DEFAULT, timing, walk, 9.0, World()) == 0.0


def test_smaller_walks_are_otherwise_the_same():
    for walk in WALKS:
        half = walk.times(0.5)
        sizes = {"ahead": half.ahead, "outward": half.outward, "turn": half.turn}
        assert walk._replace(**sizes) == half
        assert 2.0 * half.ahead == walk.ahead
