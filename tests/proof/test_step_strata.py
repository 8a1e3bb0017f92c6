"""Rates of falls of each step of a chain, and whether their intervals hold together."""

import numpy as np
import pytest

from gaitchain.proof.rate_test import rate_interval
from gaitchain.proof.step_strata import StepTally

LONGEST = 30
RATES = np.array([[0.0, 0.01, 0.05], [0.02, 0.0, 0.2]])


def made_walk(rng):
    """A walk of random steps, each of which falls at its own rate."""
    steps = []
    for _ in range(LONGEST):
        steps.append((int(rng.integers(2)), int(rng.integers(3))))
        if rng.random() < RATES[steps[-1]]:
            return steps, True
    return steps, False


def test_what_was_not_walked_is_named():
    tally = StepTally(np.array([[True, True], [True, False]]))
    tally.add([(0, 0), (0, 1), (0, 0)], fell=True)
    tally.add([(0, 0)] * 12, fell=False)
    found = tally.report(LONGEST, 0.95)
    assert (found.allowed, found.walked, found.never) == (3, 2, ((1, 0),))
    (seldom,), (fallen,) = found.seldom, found.fell_on
    assert (seldom.first, seldom.last, seldom.walked, seldom.falls) == (0, 1, 1, 0)
    assert (fallen.first, fallen.last, fallen.walked, fallen.falls) == (0, 0, 14, 1)
    each = 1.0 - 0.05 / 6  # three steps, each with two ends
    walks = (2, True, 1), (12, False, 1)
    assert (fallen.low, fallen.high) == rate_interval(walks, LONGEST, each)


def test_the_least_and_greatest_upper_ends_are_those_of_the_steps():
    """Of one step that was walked ten times as often as the other."""
    tally = StepTally(np.array([[True, True]]))
    for edge, many in (((0, 0), 300), ((0, 1), 30)):
        for _ in range(many):
            tally.add([edge] * LONGEST, fell=False)
    found = tally.report(LONGEST, 0.95)
    much, little = (
        rate_interval([(LONGEST, False, n)], LONGEST, 1.0 - 0.05 / 4)[1]
        for n in (300, 30)
    )
    assert much < little
    assert found.high == pytest.approx((much, 0.5 * (much + little), little))


def test_intervals_of_all_steps_hold_together():
    rng, missed = np.random.default_rng(1), 0
    for _ in range(100):
        tally = StepTally(RATES >= 0.0)
        for _ in range(60):
            steps, fell = made_walk(rng)
            tally.add(steps, fell=fell)
        found = tally.report(LONGEST, 0.95)
        missed += any(
            not s.low <= RATES[s.first, s.last] <= s.high for s in found.fell_on
        )
    assert missed <= 5  # of 100, both ends of all steps


def test_nothing_walked_is_nothing_known():
    found = StepTally(np.ones((1, 2), dtype=bool)).report(LONGEST, 0.95)
    assert (found.walked, found.high, len(found.never)) == (0, (), 2)
