"""Limits of numbers hold at their ends, for numbers of any size and kind."""

import math
from fractions import Fraction

import numpy as np
import pytest

from gaitchain.errors import CommandError
from gaitchain.gait.limits import Limits, is_real
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


@pytest.mark.parametrize(
    ("limits", "shown"),
    [
        (SEED, "a whole number, 0 to 18446744073709551615"),
        (Limits(1, 10**12), "1 to 1000000000000"),
        (Limits(1e-9, 1e6, unit="s"), "1e-09 to 1000000 s"),
        (Limits(1.1, math.inf), "at least 1.1, inf for no limit"),
    ],
)
def test_limits_are_shown_with_all_their_digits(limits, shown):
    assert str(limits) == shown


@pytest.mark.parametrize("value", [0, 1.5, math.nan, -math.inf, np.float32(1), 10**300])
def test_numbers_that_fit_a_float(value):
    assert is_real(value)


@pytest.mark.parametrize("value", [10**400, "1", None, 1j, np.array(1.0), [1.0]])
def test_what_fits_no_float(value):
    assert not is_real(value)


def test_a_world_has_the_largest_seed_and_refuses_larger_ones():
    assert World(seed=2**64 - 1).seed == 2**64 - 1
    with pytest.raises(CommandError, match="seed is 18446744073709551616, must be"):
        World(seed=2**64)
    with pytest.raises(CommandError, match="plant_seed is 1000"):
        World(plant_seed=10**400)
