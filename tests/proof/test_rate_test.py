"""The sequential test: false verdicts as seldom as promised, and in time."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gaitchain.errors import CommandError
from gaitchain.proof.rate_test import RateTest, rate_interval, steps_needed

BOUND, LONGEST = 1e-2, 40
REPEATS = 1000
BATCH = 64  # walks that are drawn at once


def walks(rate, rng, frail=0.0):
    """Walks of a gait: each step falls with a rate, that of some walks is larger."""
    while True:
        mine = rate * (rng.exponential(size=BATCH) if frail else np.ones(BATCH))
        lengths = rng.integers(5, LONGEST + 1, BATCH)
        falls = rng.geometric(np.maximum(mine, 1e-12))
        made = np.minimum(falls, lengths), falls <= lengths
        yield from zip(*map(np.ndarray.tolist, made), strict=True)


def each_once(made):
    return [(length, fell, 1) for length, fell in made]


def verdict_of(rate, seed, frail=0.0, most=20_000):
    test, steps = RateTest(BOUND, LONGEST), 0
    for length, fell in walks(rate, np.random.default_rng((7, seed)), frail):
        steps += length
        found = test.add(length, fell=fell)
        if found != "open" or steps > most:
            return found, steps
    raise AssertionError


@pytest.mark.slow
@pytest.mark.parametrize(("rate", "false"), [(BOUND, "below"), (0.99 * BOUND, "above")])
def test_verdicts_at_the_bound_are_false_in_at_most_one_of_twenty(rate, false):
    """Each step falls alike, so the rate of falls per step is that of a step."""
    found = [verdict_of(rate, seed)[0] for seed in range(REPEATS)]
    assert np.mean([verdict == false for verdict in found]) <= 0.05


@pytest.mark.slow
def test_walks_need_not_be_alike():
    """Some walks are worse than others, as worlds are: falls per step are counted."""
    rng = np.random.default_rng(5)
    made = walks(BOUND, rng, frail=1.0)
    many = [next(made) for _ in range(200_000)]
    true = sum(fell for _, fell in many) / sum(length for length, _ in many)
    test = [verdict_of(BOUND * BOUND / true, seed, frail=1.0)[0] for seed in range(300)]
    assert np.mean([verdict == "below" for verdict in test]) <= 0.05


def test_falls_that_were_no_draws_count_against_below_and_for_nothing():
    """Whatever world is chosen: what they leave of the bet was won by draws."""
    test = RateTest(BOUND, LONGEST)
    while test.verdict == "open":
        test.add(20, fell=False)
    assert test.count_against() == "open"
    for _ in range(100):
        assert test.count_against() == "open", "never above"


def test_a_gait_that_never_falls_is_known_in_the_steps_that_are_promised():
    found, steps = verdict_of(0.0, 1)
    assert found == "below"
    need = steps_needed(BOUND)
    assert need <= steps <= need + 2 * LONGEST
    assert need < 1.3 * 3.0 / BOUND  # "rule of three": no test needs fewer than 3 / b


@pytest.mark.parametrize("bound", [1e-4, 1e-3, 2.9e-3])
@pytest.mark.parametrize("length", [1, 40, 160])
def test_steps_that_are_promised_suffice_in_walks_of_any_length(bound, length):
    """Walks of 0.46 / bound steps take a fifth more than very short ones."""
    test, steps = RateTest(bound, 2 * length), 0
    while test.verdict == "open":
        test.add(length, fell=False)
        steps += length
    assert 0.95 * steps_needed(bound, length=length) - length < steps
    assert steps <= steps_needed(bound, length=length)


@pytest.mark.parametrize(
    ("part", "verdict", "most"), [(0.2, "below", 2500), (5.0, "above", 1000)]
)
def test_other_rates_are_told_apart_soon(part, verdict, most):
    found = [verdict_of(part * BOUND, seed) for seed in range(200)]
    assert np.mean([v == verdict for v, _ in found]) > 0.99
    assert np.median([steps for _, steps in found]) < most


@pytest.mark.slow
def test_the_interval_holds_the_true_rate_at_any_time():
    missed = 0
    for seed in range(200):
        made = walks(BOUND, np.random.default_rng((9, seed)))
        all_walks = [next(made) for _ in range(400)]
        for end in (3, 10, 30, 100, 400):
            low, high = rate_interval(each_once(all_walks[:end]), LONGEST)
            if not low <= BOUND <= high:
                missed += 1
                break
    assert missed <= 2 * 0.05 * 200


def test_the_interval_closes_in():
    made = walks(BOUND, np.random.default_rng(3))
    many = [next(made) for _ in range(20_000)]
    low, high = rate_interval(each_once(many), LONGEST)
    assert 0.8 * BOUND < low < BOUND < high < 1.25 * BOUND


@given(
    st.lists(st.tuples(st.integers(1, LONGEST), st.booleans()), max_size=40),
    st.sampled_from([1e-3, BOUND, 2e-2]),
)
def test_interval_and_test_agree(made, bound):
    """Who is shown to be below a bound has an interval that ends near it."""
    test = RateTest(bound, LONGEST)
    for length, fell in made:
        test.add(length, fell=fell)
    low, high = rate_interval(each_once(made), LONGEST)
    assert 0.0 <= low <= high <= 1.0
    assert (test.verdict == "below") == (high <= bound)
    assert (test.verdict == "above") == (low > bound)
    if made and not any(fell for _, fell in made):
        assert low == 0.0
    assert 0.0 <= test.sureness <= 1.0


def test_a_fall_in_one_walk_alone_leaves_no_least_rate():
    low, high = rate_interval([(5, True, 1)], LONGEST, 0.99)
    assert low == 0.0
    assert high == pytest.approx(1.0)


def test_no_walks_leave_everything_possible():
    assert rate_interval([], LONGEST) == (0.0, 1.0)


def test_walks_that_are_alike_are_counted_and_not_listed():
    """A thousand million of them take no more room than one."""
    few = [(30, False, 700), (12, True, 3), (5, True, 2)]
    listed = [walk[:2] for walk in few for _ in range(walk[2])]
    found = rate_interval(few, LONGEST)
    assert found == pytest.approx(rate_interval(each_once(listed), LONGEST))
    many = [(length, fell, 10**9 * count) for length, fell, count in few]
    rate = 5 / (700 * 30 + 3 * 12 + 2 * 5)
    low, high = rate_interval(many, LONGEST)
    assert found[0] < low < rate < high < found[1]


@pytest.mark.parametrize(
    ("bound", "longest", "confidence", "said"),
    [
        (0.0, 10, 0.95, "bound is 0"),
        (math.nan, 10, 0.95, "bound is nan"),
        (1e-4, 10, 1.0, "confidence is 1"),
        (1e-2, 100, 0.95, "less than 1 / bound, 100 steps; take shorter walks"),
    ],
)
def test_what_cannot_be_tested_is_refused(bound, longest, confidence, said):
    with pytest.raises(CommandError, match=said):
        RateTest(bound, longest, confidence)
