"""What a build may walk: a robot's shape reaches its candidates; refusals say why."""

from dataclasses import astuple

import numpy as np
import pytest
from other_robots import with_legs

from gaitchain.build import stride
from gaitchain.build.families import build_of_family
from gaitchain.build.gait_build import Draw
from gaitchain.build.shape_search import GENERATIONS, Found
from gaitchain.build.workers import Crew
from gaitchain.errors import CommandError, LibraryError
from gaitchain.gait.build_config import BuildConfig
from gaitchain.gait.keypose.key_poses import KeyPoses
from gaitchain.gait.stride.shape import BOX_SHAPE, MODEL_SHAPE, StrideShape
from gaitchain.gait.stride.strides import StridePoses
from gaitchain.robot.box_robot import load_box_robot

RES = load_box_robot("res")
FULL = with_legs(RES, RES.legs, name="Toy")
SHAPE = StrideShape(0.48, 0.9, 0.05, balance={"trunk": 1.3, "follow": 0.8})
FEW = (6, 1, 1, 6)


def quiet(stage, done, total):
    del stage, done, total


def drawn(robot, seed=0, **config):
    rngs = np.random.default_rng(seed), np.random.default_rng(seed + 1)
    config = BuildConfig(**config)
    return build_of_family(config.family).draw(
        Draw(config, robot, *rngs, Crew(1, quiet))
    )


def check_times(timing, expected):
    assert astuple(timing) == pytest.approx(astuple(expected))


@pytest.fixture
def searched(monkeypatch):
    """A search that finds `SHAPE` at once; returns what it was asked for."""
    asked = []

    def search(robot, rng, crew, *, start, generations, rhythm, **kwargs):
        del rng, kwargs
        asked.append((robot, crew, generations, rhythm, start))
        return Found(SHAPE, 0.5)

    monkeypatch.setattr(stride, "search_shape", search)
    return asked


def test_the_papers_walk_is_drawn_for_a_robot_from_a_file():
    found = drawn(FULL, preset="default", poses_per_layer=(3, 4, 6, 3))
    assert isinstance(found.poses, KeyPoses)
    assert all(mask.any() for mask in found.edges)


@pytest.mark.parametrize("robot", [RES, FULL])
def test_the_papers_table_is_not_closed(robot):
    with pytest.raises(LibraryError, match="not closed"):
        drawn(robot, preset="table1")


def test_the_papers_walk_is_not_searched_for(searched):
    found = drawn(RES, preset="default", poses_per_layer=(3, 4, 6, 3), search=3)
    assert isinstance(found.poses, KeyPoses)
    assert found.pairs is None
    assert not searched


@pytest.mark.slow
@pytest.mark.parametrize("robot", [RES, FULL], ids=["boxes", "full"])
def test_candidates_follow_the_shape(searched, robot):
    found = drawn(robot, preset="brisk", poses_per_layer=FEW, search=2)
    leg = robot.reduced.leg_length
    assert isinstance(found.poses, StridePoses)
    assert found.poses.robot is robot
    check_times(found.timing, SHAPE.timing(robot))
    assert found.poses.hip_height == pytest.approx(SHAPE.hip_height * leg)
    assert found.poses.balance == SHAPE.balance
    assert found.poses.counts == FEW
    assert found.poses.parameters[1][:, 2] == pytest.approx(SHAPE.lift * leg)
    assert len(searched) == 1
    assert searched[0][0] is robot
    assert searched[0][2] == 2


@pytest.mark.slow
def test_only_a_full_robot_is_searched_for_unasked(searched):
    plain = drawn(RES, preset="brisk", poses_per_layer=FEW)
    assert not searched
    check_times(plain.timing, BOX_SHAPE.timing(RES))
    assert plain.poses.balance == BOX_SHAPE.balance
    drawn(FULL, preset="brisk", poses_per_layer=FEW)
    assert [asked[2] for asked in searched] == [GENERATIONS]
    usual = drawn(FULL, preset="brisk", poses_per_layer=FEW, search=0)
    check_times(usual.timing, MODEL_SHAPE.timing(FULL))
    assert usual.poses.balance == MODEL_SHAPE.balance
    assert len(searched) == 1
    assert searched[0][4] == MODEL_SHAPE


@pytest.mark.slow
def test_the_search_walks_in_the_builds_worlds_and_crew(searched):
    drawn(RES, preset="brisk", poses_per_layer=FEW, search=1, speed_limit_deg_s=200.0)
    _, crew, _, rhythm, start = searched[0]
    worlds = crew.worlds
    assert worlds.speed_limit_deg_s == 200.0
    assert worlds.numbers["model_error"] > 0.0
    assert worlds.push_ns > 0.0
    assert crew.workers == 1
    assert crew.progress is quiet
    assert rhythm is None
    assert start == BOX_SHAPE


def test_given_times_go_before_the_shapes(searched):
    """In the search as in the build: it tunes the rhythm that is walked."""
    found = drawn(
        RES, preset="brisk", poses_per_layer=FEW, search=1, step_s=0.6, rise_s=0.25
    )
    own = SHAPE.timing(RES)
    assert found.timing.step == 0.6
    assert found.timing.rise == 0.25
    assert found.timing.fall == pytest.approx(0.6 * own.fall / own.step)
    rhythm = searched[0][3]
    assert rhythm(SHAPE) == found.timing
    assert rhythm(MODEL_SHAPE).step == 0.6


def test_the_swing_foot_passes_between_any_pair_and_standing_is_one():
    found = drawn(RES, preset="brisk", poses_per_layer=FEW)
    assert [edge.shape for edge in found.edges] == [(6, 1), (1, 1), (1, 6)]
    assert all(edge.all() for edge in found.edges)
    assert found.pairs.shape == (6, 6)
    assert found.pairs[1:, 0].any()


def test_slow_servos_draw_shorter_strides():
    quick, slow = (
        drawn(RES, preset="brisk", poses_per_layer=FEW, speed_limit_deg_s=limit)
        for limit in (150.0, 90.0)
    )
    assert slow.pairs[1:, 0].any()
    longest = [np.abs(found.poses.strides[:, 0]).max() for found in (quick, slow)]
    assert 0.0 < longest[1] < 0.8 * longest[0]


def test_a_robot_that_can_make_no_step_is_refused_with_the_reason():
    reason = r"Senior can make no step .*: \w+ would have to move at .* limit is 0\.35;"
    with pytest.raises(LibraryError, match=reason):
        drawn(RES, preset="brisk", poses_per_layer=FEW, speed_limit_deg_s=20.0)


@pytest.mark.parametrize("counts", [(6, 1, 1, 5), (6, 2, 1, 6), (6, 1, 3, 6)])
def test_strides_are_passed_between_in_one_way(counts):
    with pytest.raises(CommandError, match=r"strides need \(6, 1, 1, 6\)"):
        drawn(RES, preset="brisk", poses_per_layer=counts)
