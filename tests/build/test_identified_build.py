"""A build for a robot that was identified: its preset, and its training worlds."""

from dataclasses import replace

import numpy as np
import pytest

from gaitchain.build.families import build_of_family
from gaitchain.build.gait_build import Draw
from gaitchain.build.keypose import KEY_POSE_BUILD
from gaitchain.build.workers import Crew
from gaitchain.cli import run
from gaitchain.cli.libraries import shipped_library
from gaitchain.gait.build_config import BuildConfig
from gaitchain.gait.families import family_of_preset
from gaitchain.gait.library_file import load_library, save_library
from gaitchain.robot.box_robot import load_box_robot
from gaitchain.robot.identified import Identified, unsure_numbers
from gaitchain.sim.robot_faults import likely_robot
from gaitchain.sim.world_range import WorldRange

RES = load_box_robot("res")
CREW = Crew(1, lambda *news: None)
COUNT = unsure_numbers(12)
MINE = RES.as_identified(replace(Identified.of_file(12), unknown=0.02 * np.eye(COUNT)))


@pytest.fixture
def mine(tmp_path):
    """The shipped library, of strides, for a robot that was identified."""
    own, path = load_library(shipped_library()), tmp_path / "mine.gait"
    save_library(replace(own, poses=replace(own.poses, robot=MINE)), path)
    return path


@pytest.mark.parametrize(
    ("words", "preset"), [([], "brisk"), (["--preset", "default"], "default")]
)
def test_it_walks_as_the_library_that_was_identified_unless_told(
    words, preset, mine, monkeypatch, capsys
):
    """Boxes walked as in the paper, whatever they had walked before."""
    asked = []

    def build(config, tell, workers, robot):
        asked.append((config.preset, robot))
        raise KeyboardInterrupt

    monkeypatch.setattr("gaitchain.cli.build.build_library", build)
    out = str(mine.with_name("own.gait"))
    run(["build", "res", "--identified", str(mine), "-o", out, *words])
    assert asked == [(preset, MINE)]
    said = " ".join(capsys.readouterr().out.split())
    assert ("--preset brisk, that of" in said) is not bool(words)


@pytest.mark.parametrize(
    ("preset", "poses"), [("default", (3, 4, 6, 3)), ("brisk", (6, 1, 1, 6))]
)
def test_boxes_that_were_identified_have_the_steps_of_boxes(preset, poses):
    """As those of a file they had poses placed by their CoM, and another rhythm."""
    config = BuildConfig(preset=preset, poses_per_layer=poses)
    build = build_of_family(family_of_preset(preset))
    own, other = (
        build.draw(Draw(config, robot, *map(np.random.default_rng, (0, 1)), CREW))
        for robot in (RES, MINE)
    )
    assert other.timing == own.timing
    for one, another in zip(own.edges, other.edges, strict=True):
        np.testing.assert_array_equal(another, one)


def test_key_poses_are_trained_on_all_robots_that_may_have_made_the_log():
    rng = np.random.default_rng(0)
    config = BuildConfig(preset="default", poses_per_layer=(2, 2, 2, 2))
    plain = KEY_POSE_BUILD.draw(Draw(config, RES, rng, rng, CREW)).poses
    poses = replace(plain, robot=MINE)
    worlds = KEY_POSE_BUILD.training_worlds(poses, 150.0)
    drawn = [worlds.draw(np.random.default_rng(seed)) for seed in range(2)]
    assert [world.doubt for world in drawn] == [1.0, 1.0]
    one, other = (likely_robot(MINE, world).identified for world in drawn)
    assert not np.allclose(one.gain, other.gain)
    of_file = KEY_POSE_BUILD.training_worlds(plain, 150.0)
    assert of_file.facts() == WorldRange(speed_limit_deg_s=150.0).facts()
