"""The pendulum online, against numerical integration and its invariants."""

import numpy as np
import pytest
import scipy
from hypothesis import given, settings
from hypothesis import strategies as st

from gaitchain.balance.pendulum import (
    double_support_map,
    steady_lead,
    swaying_lead,
    swing_pendulum,
)


def numbers(low, high):
    """Of ordinary size: the integrator divides by tiny ones."""
    return st.floats(low, high).map(lambda value: round(value, 6))


PLACES, SPEEDS = numbers(-0.3, 0.3), numbers(-1.5, 1.5)
OMEGAS, TIMES = numbers(2.5, 6.0), numbers(0.01, 0.6)


def integrated(slope, start, time_s):
    """The end of an initial value problem, to 1e-10."""
    way = scipy.integrate.solve_ivp(
        slope, (0.0, time_s), start, "DOP853", rtol=1e-11, atol=1e-13
    )
    return way.y[:, -1]


@settings(max_examples=40)
@given(PLACES, SPEEDS, PLACES, SPEEDS, OMEGAS, TIMES)
def test_the_pendulum_swings_as_its_equation_says(x, v, zmp, rate, omega, time_s):
    expected = integrated(
        lambda t, y: [y[1], omega**2 * (y[0] - zmp - rate * t)], [x, v], time_s
    )
    moved = swing_pendulum(x, v, zmp, rate, omega, time_s)
    np.testing.assert_allclose(moved, expected, rtol=1e-8, atol=1e-9)


@settings(max_examples=40)
@given(PLACES, SPEEDS, PLACES, OMEGAS, TIMES)
def test_over_a_resting_zmp_the_orbital_energy_stays(x, v, zmp, omega, time_s):
    end, speed = swing_pendulum(x, v, zmp, 0.0, omega, time_s)
    before = v**2 - omega**2 * (x - zmp) ** 2
    after = speed**2 - omega**2 * (end - zmp) ** 2
    assert after == pytest.approx(before, abs=1e-8)
    # And the DCM runs away from the ZMP, the other component towards it.
    grown = (x + v / omega - zmp) * np.exp(omega * time_s)
    shrunk = (x - v / omega - zmp) * np.exp(-omega * time_s)
    assert end + speed / omega - zmp == pytest.approx(grown, abs=1e-9)
    assert end - speed / omega - zmp == pytest.approx(shrunk, abs=1e-9)


@settings(max_examples=40)
@given(PLACES, SPEEDS, PLACES, SPEEDS, OMEGAS, TIMES, st.floats(0.0, 1.0))
def test_two_short_swings_are_one_long_one(x, v, zmp, rate, omega, time_s, part):
    first = part * time_s
    half_way = swing_pendulum(x, v, zmp, rate, omega, first)
    moved = zmp + rate * first
    end = swing_pendulum(*half_way, moved, rate, omega, time_s - first)
    whole = swing_pendulum(x, v, zmp, rate, omega, time_s)
    np.testing.assert_allclose(end, whole, rtol=1e-9, atol=1e-11)


@settings(max_examples=40)
@given(PLACES, PLACES, PLACES, OMEGAS, numbers(0.02, 0.3))
def test_double_support_moves_the_dcm_as_integration_does(
    dcm, zmp, next_zmp, omega, time_s
):
    def slope(t, y):
        return omega * (y - zmp - (next_zmp - zmp) * t / time_s)

    growth, old, new = double_support_map(omega, time_s)
    assert growth + old + new == pytest.approx(1.0, abs=1e-12)
    (expected,) = integrated(slope, [dcm], time_s)
    end = growth * dcm + old * zmp + new * next_zmp
    assert end == pytest.approx(expected, abs=1e-9)


def after_a_step(dcm, way, omega, single, double):
    """Return the DCM seen from the ZMP of the next foot, integrated over a step."""
    (touch_down,) = integrated(lambda t, y: omega * y, [dcm], single)
    (end,) = integrated(
        lambda t, y: omega * (y - way * t / double), [touch_down], double
    )
    return end - way


TIMES = OMEGAS, numbers(0.2, 0.6), numbers(0.02, 0.2)


@settings(max_examples=40)
@given(numbers(-0.4, 0.4), *TIMES)
def test_the_steady_dcm_ahead_repeats_itself(length, omega, single, double):
    growth, _, new = double_support_map(omega, double)
    lead = steady_lead(length, new, growth * np.exp(omega * single))
    after = after_a_step(lead, length, omega, single, double)
    assert after == pytest.approx(lead, abs=1e-8)


@settings(max_examples=40)
@given(numbers(0.0, 0.4), numbers(0.0, 0.4), *TIMES)
def test_the_steady_dcm_beside_repeats_itself_in_two_steps(
    width, other, omega, single, double
):
    growth, _, new = double_support_map(omega, double)
    growth *= np.exp(omega * single)
    lead = swaying_lead(width, other, new, growth)
    then = -after_a_step(lead, width, omega, single, double)
    assert then == pytest.approx(swaying_lead(other, width, new, growth), abs=1e-8)
