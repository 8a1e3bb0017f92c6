"""A clock that leaves out how long the computer stood still."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gaitchain.backends.servos.stall_free import StallFreeClock


@given(st.lists(st.floats(0.0, 2.0)), st.floats(1e-3, 1.0))
def test_only_what_was_watched_counts(pauses, most_s):
    now_s = 5.0
    clock = StallFreeClock(most_s, lambda: now_s)
    for pause_s in pauses:
        now_s += pause_s
        clock()
    assert clock() == pytest.approx(sum(min(p, most_s) for p in pauses), abs=1e-6)
