"""Disturbed walks in physics, and what a library learns from them."""

from dataclasses import replace

import numpy as np
import pytest

from gaitchain.build.families import build_of
from gaitchain.build.push import impulse_unit_ns
from gaitchain.build.recovery_walks import _draw_world, _walk_on, recover
from gaitchain.build.workers import Crew
from gaitchain.cli.libraries import shipped_library
from gaitchain.gait.library_file import library_bytes, load_library, parse_library
from gaitchain.sim.world import World

LIBRARY = replace(load_library(shipped_library()), recovery=None)
WORLDS = build_of(LIBRARY.poses).training_worlds(LIBRARY.poses, 150.0)
SCALE_NS, LEG = impulse_unit_ns(LIBRARY), LIBRARY.robot.reduced.leg_length


def crew(workers, told=None):
    def tell(*news):
        if told is not None:
            told.append(news)

    return Crew(workers, tell, WORLDS)


@pytest.mark.slow
def test_the_number_of_workers_changes_nothing():
    told = []
    one, two = (
        recover(LIBRARY, 6, np.random.default_rng(3), crew(workers, told)).recovery
        for workers in (1, 2)
    )
    assert one.cost.tolist() == two.cost.tolist()
    stages = [stage for stage, done, total in told if done == total == 2]
    rounds = ["", ", round 2", ", round 3"]
    assert stages[-3:] == [f"walking on after disturbances{r}" for r in rounds]


def test_without_walks_nothing_is_learned():
    assert recover(LIBRARY, 0, np.random.default_rng(3), crew(1)) is LIBRARY


@pytest.mark.slow
def test_a_library_keeps_what_it_learned():
    learned = recover(LIBRARY, 2, np.random.default_rng(5), crew(1))
    again = parse_library(library_bytes(learned), "memory")
    assert again.recovery.cost.tolist() == learned.recovery.cost.tolist()
    assert parse_library(library_bytes(LIBRARY), "memory").recovery is None


def test_the_worlds_are_pushed_tripped_shaken_and_loaded():
    worlds = [_draw_world(crew(1), LIBRARY, SCALE_NS, (1, i)) for i in range(60)]
    blocks = np.array([world.blocks_m for world in worlds]) / LEG
    assert ((blocks == 0.0) | ((blocks >= 0.015) & (blocks <= 0.045))).all()
    pushes = [world.push for world in worlds]
    waists = np.array([world.waist for world in worlds])
    even = [not (world.push or world.blocks_m) for world in worlds]
    assert (np.isfinite(waists) == even).all(), "none is calm"
    assert np.isinf(waists).sum() > 30
    assert waists.min() >= 4.0
    assert waists[np.isfinite(waists)].max() <= 12.0
    sizes = [push.impulse_ns / SCALE_NS for of_one in pushes for push in of_one]
    assert 0.05 <= min(sizes) < 0.06
    assert 0.19 < max(sizes) <= 0.2
    for share in (
        np.mean(blocks == 0.0),
        np.mean([not of_one for of_one in pushes]),
        np.mean(even),
        np.mean([world.payload > 0.0 for world in worlds]),
        np.mean([world.arms == "random" for world in worlds]),
    ):
        assert 0.1 < share < 0.7


def test_a_calm_walk_loses_nothing():
    sizes = np.array([0.5, 0.25])
    walk = _walk_on(LIBRARY, World(speed_limit_deg_s=150.0), sizes, (1, 2))
    assert not walk.fell
    assert walk.lost == pytest.approx(0.0, abs=1e-12)
    assert walk.steps > 40
    assert walk.sizes == sizes.tolist()


@pytest.mark.slow
def test_a_disturbed_walk_leaves_out_what_its_sizes_say():
    world = _draw_world(crew(1), LIBRARY, SCALE_NS, (1, 0))
    small, large = (
        [_walk_on(LIBRARY, world, np.full(2, size), (1, i)).lost for i in range(2)]
        for size in (0.0, 0.75)
    )
    assert min(small) > max(large) + 0.1


@pytest.mark.slow
def test_a_robot_that_is_often_off_by_as_much_leaves_nothing_out():
    world = _draw_world(crew(1), LIBRARY, SCALE_NS, (1, 0))
    often = replace(LIBRARY, usual_spread=10.0)
    walk = _walk_on(often, world, np.zeros(2), (1, 0))
    assert walk.lost == pytest.approx(0.0, abs=1e-12)
