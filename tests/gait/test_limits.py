"""Limits of numbers hold at their ends, for numbers of any size and kind."""

import math
from fractions import Fraction

import numpy as np
import pytest

from gaitchain.errors import CommandError
from gaitchain.gait.limits import Limits
from gaitchain.sim.world import World

SEED = Limits(0, 2**64 - 1, whole=True)
PART = Limits(0.0, 1.0)


@pytest.mark.parametrize("value", [0, 2**64 - 1, np.uint64(2**64 - 1), np.int8(3)])
def test_whole_numbers_within_limits(value):
    assert SEED.hold(value)


@pytest.mark.parametrize("value", [-1, 2**64, 10**400, -(10**400), 1.0, True, "1"])
def test_what_is_no_whole_number_within_limits(value):
    assert SEED.hold(value) is False


@pytest.mark.parametrize("value", [0, 1, 1.0, Fraction(1, 3), np.float32(0.5)])
def test_numbers_within_limits(value):
    assert PART.hold(value)


@pytest.mark.parametrize(
    "value", [math.nan, math.inf, 1 + Fraction(1, 10**30), 10**400, False, None]
)
def test_what_is_no_number_within_limits(value):
    assert PART.hold(value) is False


def test_a_world_has_the_largest_seed_and_refuses_larger_ones():
    assert World(seed=2**64 - 1).seed == 2**64 - 1
    with pytest.raises(CommandError, match="seed is 18446744073709551616, must be"):
        World(seed=2**64)
    with pytest.raises(CommandError, match="plant_seed is 1000"):
        World(plant_seed=10**400)
