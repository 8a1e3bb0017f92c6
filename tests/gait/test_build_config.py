"""Configurations hold plain values, whatever kind of them they are given."""

import json
from dataclasses import asdict
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from gaitchain.errors import CommandError
from gaitchain.gait.build_config import BuildConfig


@pytest.mark.parametrize(
    ("given", "plain"),
    [
        ({"seed": np.int64(3)}, {"seed": 3}),
        ({"walks": np.uint8(9), "search": np.int32(0)}, {"walks": 9, "search": 0}),
        ({"epsilon": np.float32(0.5)}, {"epsilon": 0.5}),
        ({"gate_share": Fraction(1, 2)}, {"gate_share": 0.5}),
        ({"poses_per_layer": [3, 4, 5, 3]}, {"poses_per_layer": (3, 4, 5, 3)}),
        (
            {"preset": "brisk", "poses_per_layer": np.array([3, 1, 1, 3])},
            {"preset": "brisk", "poses_per_layer": (3, 1, 1, 3)},
        ),
        ({"robot": Path("res")}, {"robot": "res"}),
        ({"profile": Path("my.toml")}, {"profile": "my.toml"}),
        ({"robot": np.str_("res"), "cost": np.str_("planned")}, {"cost": "planned"}),
    ],
)
def test_values_are_stored_as_files_hold_them(given, plain):
    """A build that ran to its end could not be saved."""
    config, expected = BuildConfig(**given), BuildConfig(**plain)
    assert repr(config) == repr(expected), "by which work that goes on is compared"
    stored = json.loads(json.dumps(asdict(config)))
    assert BuildConfig.from_json(stored) == expected


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"robot": None}, "robot is None, must be a name or the path"),
        ({"robot": b"res"}, "robot is b'res', must be"),
        ({"profile": 3}, "profile is 3, must be a name or the path"),
        ({"preset": ["brisk"]}, r"preset \['brisk'\]: give one of default"),
        ({"cost": np.array([1, 2])}, "cost array.*give one of physics, planned"),
        ({"seed": np.float64(1.0)}, "seed is .*, must be a whole number"),
        ({"search_s": 10**400}, "search_s is 1000.*, must be at least 0 s, inf for"),
    ],
)
def test_what_no_file_can_hold_is_refused_at_once(given, message):
    with pytest.raises(CommandError, match=message):
        BuildConfig(**given)


@pytest.mark.parametrize(
    "counts",
    [
        *((3, 4, 3), (3, 4, 5, 3, 3), (2.5, 1, 1, 2.5), (-1, 1, 1, -1), (0, 1, 1, 0)),
        *((3, True, 1, 3), 4, "3113", np.ones((4, 4), int), (10**7, 1, 1, 10**7)),
    ],
)
@pytest.mark.parametrize("preset", ["default", "brisk"])
def test_layers_have_so_many_poses_that_they_can_be_counted(preset, counts):
    said = r"(?s)poses_per_layer is .*, must be 4 numbers, each a whole number, 1 to "
    with pytest.raises(CommandError, match=said):
        BuildConfig(preset=preset, poses_per_layer=counts)


@pytest.mark.parametrize("counts", [(1, 1, 1, 1), (1, 2, 1, 1), (2, 1, 1, 3)])
def test_strides_are_two_at_least_and_the_same_at_both_ends_of_a_step(counts):
    with pytest.raises(CommandError, match=r"strides need \(2, 1, 1, 2\), as a step"):
        BuildConfig(preset="brisk", poses_per_layer=counts)
