"""A hidden robot: the same in all its walks, another by another seed, and not told."""

import json

import numpy as np
import pytest

from gaitchain.build.trial import draw_world
from gaitchain.cli import run
from gaitchain.robot.box_robot import load_box_robot
from gaitchain.sim.hidden_robot import draw_hidden_robot
from gaitchain.sim.model import build_model
from gaitchain.sim.world import DISTURBANCES, World
from gaitchain.sim.world_draws import draw_encoder_offsets, draw_gains, stream_of

RES = load_box_robot("res")


def test_it_is_the_same_robot_in_any_world():
    numbers = draw_hidden_robot(4)
    one, other = (World(**numbers, seed=seed) for seed in (1, 2))
    for drawn in draw_gains, draw_encoder_offsets:
        np.testing.assert_array_equal(drawn(one, 12), drawn(other, 12))
    models = [build_model(RES, world) for world in (one, other)]
    np.testing.assert_array_equal(models[0].body_ipos, models[1].body_ipos)
    np.testing.assert_array_equal(models[0].site_quat, models[1].site_quat)
    noise = [stream_of(world, 2).normal() for world in (one, other)]
    assert noise[0] != noise[1], "its sensors' noise is the world's"


def test_it_is_the_same_robot_in_all_walks_of_key_poses(library):
    numbers = draw_hidden_robot(3)
    worlds = [
        draw_world(library, (7, i), np.random.default_rng((7, i)), fixed=numbers)
        for i in range(3)
    ]
    own = {name: {getattr(world, name) for world in worlds} for name in DISTURBANCES}
    varied = {name for name, values in own.items() if len(values) > 1}
    assert not varied


def test_robots_differ_within_what_is_said():
    drawn = [draw_hidden_robot(seed) for seed in range(200)]
    assert draw_hidden_robot(3) == draw_hidden_robot(3)
    assert len({numbers["plant_seed"] for numbers in drawn}) == len(drawn)
    for name, (low, high) in {
        "delay_s": (0.0, 0.04),
        "backlash_deg": (0.0, 1.5),
        "friction": (0.6, 1.0),
    }.items():
        values = np.array([numbers[name] for numbers in drawn])
        assert low <= values.min() < low + 0.05 * (high - low)
        assert high - 0.05 * (high - low) < values.max() <= high
    gains = np.array([draw_gains(World(**numbers), 12) for numbers in drawn])
    assert 0.6 <= gains.min() < 0.61
    assert 1.39 < gains.max() <= 1.4


def test_its_numbers_are_not_told(tmp_path, capsys):
    found = tmp_path / "found.json"
    words = ["trial", "res", "--runs", "1", "--robot-hidden", "3", "--seconds", "3"]
    assert run([*words, "--json", str(found)]) in (0, 1)
    told = found.read_text("utf-8")
    figures = json.loads(told)
    assert figures["robot_hidden"] == 3
    assert figures["fixed"] == {}
    assert figures["per_run"][0]["world"] == {}
    for name, value in draw_hidden_robot(3).items():
        assert name not in told
        assert str(value) not in told or value in (0.0, 1.0, 2.0, 0.4, 0.02)
    assert "a hidden robot" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--friction", "0.5"], "--friction: the hidden robot has one of its own"),
        (["--servo", "mx106"], "--servo: the hidden robot has one of its own"),
        (["--doubt", "1"], "--doubt: the hidden robot has one of its own"),
        (["--own-model", "a.xml"], "--robot-hidden: not with --own-model"),
    ],
)
def test_what_it_is_like_cannot_be_said(words, message, capsys):
    asked = ["trial", "res", "--robot-hidden", "3", *words]
    assert run(asked) == 2
    assert message in capsys.readouterr().err
