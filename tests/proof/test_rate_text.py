"""Ends of intervals as texts: never inside the interval, never far outside it."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gaitchain.proof.rate_text import interval_text, upper_text


@pytest.mark.parametrize(
    ("low", "high", "text"),
    [
        (0.0, 1.0, "0 to 1"),
        (0.0, 0.01048, "0 to 0.011"),
        (0.01, 0.01, "0.01 to 0.01"),
        (0.00129, 0.0999, "0.0012 to 0.1"),
        (1.29e-6, 9.91e-6, "1.2e-06 to 1e-05"),
    ],
)
def test_ends_are_rounded_outward(low, high, text):
    assert interval_text(low, high) == text


@given(st.floats(1e-12, 1.0), st.floats(1e-12, 1.0))
def test_an_interval_as_text_holds_what_it_tells(one, other):
    low, high = sorted((one, other))
    least, most = map(float, interval_text(low, high).split(" to "))
    assert 0.9 * low <= least <= low
    assert high <= most <= 1.1 * high
    assert upper_text(high) == interval_text(low, high).split(" to ")[1]
