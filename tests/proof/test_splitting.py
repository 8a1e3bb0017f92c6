"""Splitting against the exact chance of a process that can be computed."""

import numpy as np
import pytest

from gaitchain.errors import CommandError
from gaitchain.proof.splitting import (
    EVENT,
    Chance,
    SplitRun,
    brute_force,
    count_events,
    mean_chance,
    overlap,
    split,
)

SLICES, GOAL, UP = 24, 12, 0.35


def walk_all(seeds):
    """A walk of +-1 from 0, which never goes below; at GOAL it has had the event."""
    for own in seeds:
        at, levels = 0, []
        for seed in own:  # uniform below 2^62
            rises = seed < UP * 2.0**62
            at = max(at + (1 if rises else -1), 0)
            levels.append(at / GOAL)
            if at == GOAL:
                break
        yield levels


def exact(goal=GOAL):
    """The same by the powers of its matrix, the goal absorbing."""
    move = np.zeros((goal + 1, goal + 1))
    for at in range(goal):
        move[at, at + 1] += UP
        move[at, max(at - 1, 0)] += 1.0 - UP
    move[goal, goal] = 1.0
    return np.linalg.matrix_power(move, SLICES)[0, goal]


def runs_of(seed, count=12, paths=24, dropped=0.5):
    rng = np.random.default_rng(seed)
    return [split(walk_all, SLICES, paths, rng, dropped) for _ in range(count)]


@pytest.mark.parametrize("dropped", [0.1, 0.5])
def test_the_mean_is_exact_where_brute_force_sees_nothing(dropped):
    """Levels of this process tie, as few processes do."""
    true = exact()
    assert 1e-4 < true < 3e-4
    found = np.array([run.chance for run in runs_of(3, 120, dropped=dropped)])
    error = found.std(ddof=1) / np.sqrt(len(found))
    assert error < 0.25 * true
    assert abs(found.mean() - true) < 3.0 * error


@pytest.mark.slow
def test_intervals_hold_the_true_chance():
    true = exact()
    found = [mean_chance(runs_of((8, seed), 8, 48)) for seed in range(30)]
    held = sum(c.low <= true <= c.high for c in found)
    assert held >= 25, "of 30; 28 or 29 are meant"


def test_it_takes_less_than_brute_force():
    """For the same spread."""
    runs = runs_of(5, 60)
    found = np.array([run.chance for run in runs])
    walked = float(np.mean([run.paths for run in runs]))
    alone = exact() / found.var(ddof=1)
    assert walked < 0.2 * alone


def test_what_all_see_is_brute_force():
    """Where half of the first paths have the event nothing is split."""

    def easy(seeds):
        return ([EVENT if own[0] % 4 else 0.0] for own in seeds)

    run = split(easy, 3, 64, np.random.default_rng(1))
    assert (run.paths, run.first) == (64, 64)
    assert run.chance == run.met / 64
    assert 0.6 < run.chance < 0.9


def test_who_gets_nowhere_gives_no_chance_but_an_honest_interval():
    run = split(lambda seeds: ([0.0] for _ in seeds), 1, 10, np.random.default_rng(1))
    assert (run.chance, run.paths) == (0.0, 10)
    found = mean_chance([run, run])
    assert found.low == found.mean == 0.0
    assert found.high == pytest.approx(1.0 - 0.025 ** (1.0 / 20.0))


def test_branches_share_the_past_and_no_more():
    seen = []

    def noted(seeds):
        seen.extend(seeds)
        return walk_all(seeds)

    split(noted, SLICES, 16, np.random.default_rng(2))
    assert len(set(seen[:16])) == 16
    for number, own in enumerate(seen[16:], start=16):
        shared = max(
            sum(np.cumprod(np.array(own) == np.array(other))) for other in seen[:number]
        )
        assert 0 < shared <= SLICES
    assert len(set(seen)) > 16, "not all branch in their last slice"


def test_brute_force_has_the_exact_interval():
    part, low, high = brute_force(0, 10)
    assert (part, low) == (0.0, 0.0)
    assert high == pytest.approx(1.0 - 0.025**0.1)
    assert brute_force(10, 10)[2] == 1.0


def test_runs_that_are_alike_do_not_make_a_chance_sure():
    """Their first paths are then all that is known."""
    certain = mean_chance([SplitRun(1.0, 10, 10, 10)] * 3)
    assert (certain.mean, certain.high) == (1.0, 1.0)
    assert certain.low == pytest.approx(0.025 ** (1.0 / 30.0))
    found = mean_chance([SplitRun(0.1, 10, 10, 1)] * 3)
    assert (found.low, found.high) == brute_force(3, 30)[1:]
    assert found.mean == pytest.approx(0.1)
    seldom = mean_chance([SplitRun(1e-6, 30, 10, 0)] * 3)
    assert (seldom.low, seldom.mean) == (0.0, 1e-6)


def test_paths_without_splitting_have_the_exact_chance():
    """Of a nearer goal, which many reach."""
    goal = GOAL // 3

    def nearer(seeds):
        return ([level * GOAL / goal for level in path] for path in walk_all(seeds))

    met = count_events(nearer, SLICES, 2000, np.random.default_rng(2))
    _, low, high = brute_force(met, 2000)
    assert 0.1 < low <= exact(goal) <= high


def test_intervals_that_share_no_chance_do_not_agree():
    low, middle, high = (Chance(x, x - 0.1, x + 0.1) for x in (0.2, 0.3, 0.6))
    assert overlap(low, middle)
    assert overlap(middle, low)
    assert not overlap(middle, high)
    assert not overlap(high, low)


def test_too_few_paths_are_refused():
    with pytest.raises(CommandError, match="takes 4 or more"):
        split(walk_all, SLICES, 3, np.random.default_rng(1))
