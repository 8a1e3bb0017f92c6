"""Walks drawn from the chain: linked, allowed, and covering what may be walked."""

from itertools import pairwise, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gaitchain.chain.sampling import cover_once, cover_pairs, draw_walks
from gaitchain.errors import ChainError

SIZES = st.tuples(st.integers(2, 4), st.integers(1, 4), st.integers(1, 4))
SEEDS = st.integers(0, 2**32 - 1)
SHARES = st.sampled_from([0.3, 0.6, 0.9, 1.0])


def random_masks(sizes, seed, share):
    ends, second, third = sizes
    rng = np.random.default_rng(seed)
    shapes = pairwise((ends, second, third, ends))
    return [rng.random(shape) < share for shape in shapes]


def joined_pairs(masks):
    """Brute force: pairs of first and last pose that some path joins."""
    first, second, third = masks
    joined = np.zeros((first.shape[0], third.shape[1]), dtype=bool)
    for a, b, c, d in product(
        range(first.shape[0]),
        range(first.shape[1]),
        range(third.shape[0]),
        range(third.shape[1]),
    ):
        joined[a, d] |= bool(first[a, b] and second[b, c] and third[c, d])
    return joined


def assert_is_a_walk(walk, steps):
    assert walk.shape == (steps, 4)
    assert walk[0, 0] == 0
    assert walk[-1, 3] == 0
    np.testing.assert_array_equal(walk[:-1, 3], walk[1:, 0])


@given(SIZES, SEEDS, SHARES, st.integers(2, 5))
def test_drawn_walks_are_linked_and_allowed(sizes, seed, share, steps):
    masks = random_masks(sizes, seed, share)
    joined = joined_pairs(masks)
    try:
        walks = draw_walks(masks, 3, steps, np.random.default_rng(seed))
    except ChainError as error:
        assert "has no allowed step on" in str(error)
        assert not walk_exists(joined, steps)
        return
    assert walk_exists(joined, steps)
    assert len(walks) == 3
    for walk in walks:
        assert_is_a_walk(walk, steps)
        assert np.all(walk[:-1, 3] > 0)  # stands still only at the end
        for gait in walk:
            for layer, mask in enumerate(masks):
                assert mask[gait[layer], gait[layer + 1]]


def test_inner_poses_are_drawn_uniformly():
    masks = [np.ones((3, 4), bool), np.ones((4, 5), bool), np.ones((5, 3), bool)]
    walks = draw_walks(masks, 400, 5, np.random.default_rng(0))
    gaits = np.concatenate(walks)
    for layer, size in ((1, 4), (2, 5)):
        share = np.bincount(gaits[:, layer], minlength=size) / len(gaits)
        np.testing.assert_allclose(share, 1.0 / size, atol=0.04)
    ends = np.concatenate([walk[:-1, 3] for walk in walks])
    np.testing.assert_allclose(np.bincount(ends) / len(ends), [0, 0.5, 0.5], atol=0.05)


def test_an_unreachable_pose_is_named():
    masks = [np.ones((3, 2), bool), np.ones((2, 2), bool), np.ones((2, 3), bool)]
    masks[2][:, 0] = False  # nothing leads back to standing
    with pytest.raises(ChainError, match=r"pose 0 has no allowed step on.*allow"):
        draw_walks(masks, 1, 2, np.random.default_rng(0))


@pytest.mark.parametrize("steps", [-1, 0, 1])
def test_a_walk_has_a_first_and_a_last_step(steps):
    rng = np.random.default_rng(0)
    with pytest.raises(ChainError, match="at least 2"):
        draw_walks([np.ones((2, 2), bool)] * 3, 1, steps, rng)
    with pytest.raises(ChainError, match="at least 2"):
        cover_pairs(gaits_of(2), np.ones((2, 2), bool), 1, steps, rng)
    with pytest.raises(ChainError, match="at least 2"):
        cover_once(gaits_of(2), np.ones((2, 2), bool), steps, rng)


def gaits_of(ends):
    """Gaits that say which pair they belong to."""
    table = np.empty((ends, ends, 4), dtype=np.int64)
    for first, last in np.ndindex(ends, ends):
        table[first, last] = first, 10 * first + last, 7, last
    return table


@given(st.integers(2, 6), SEEDS, SHARES, st.integers(2, 6), st.integers(1, 20))
def test_covering_walks_are_linked_and_allowed(ends, seed, share, steps, count):
    rng = np.random.default_rng(seed)
    allowed = rng.random((ends, ends)) < share
    table = gaits_of(ends)
    try:
        walks = cover_pairs(table, allowed, count, steps, rng)
    except ChainError as error:
        assert "has no allowed step on" in str(error)
        assert not walk_exists(allowed, steps)
        return
    assert walk_exists(allowed, steps)
    assert len(walks) == count
    for walk in walks:
        assert_is_a_walk(walk, steps)
        assert np.all(walk[:-1, 3] > 0)
        assert allowed[walk[:, 0], walk[:, 3]].all()
        np.testing.assert_array_equal(walk, table[walk[:, 0], walk[:, 3]])


@given(st.integers(3, 6), SEEDS)
def test_covering_is_even(ends, seed):
    allowed = np.ones((ends, ends), dtype=bool)
    allowed[0, 0] = False
    rng = np.random.default_rng(seed)
    walks = np.concatenate(cover_pairs(gaits_of(ends), allowed, 12 * ends, 5, rng))
    visits = np.zeros((ends, ends), dtype=int)
    np.add.at(visits, (walks[:, 0], walks[:, 3]), 1)
    np.testing.assert_array_equal(visits > 0, allowed)
    # From each pose every other one is reached equally often, but for one visit.
    assert np.all(np.ptp(visits[:, 1:], axis=1) <= 1)


def pairs_on_a_walk(pairs):
    """Brute force: pairs on a walk from pose 0 and back, not by way of it."""
    inner = pairs.copy()
    inner[:, 0] = False
    from_0, to_0 = (np.arange(len(pairs)) == 0 for _ in range(2))
    for _ in pairs:
        from_0 |= (inner & from_0[:, None]).any(axis=0)
        to_0[1:] |= (pairs & to_0).any(axis=1)[1:]
    found = pairs & from_0[:, None] & to_0
    found[0, 0] = False
    return found


@given(st.integers(1, 9), SEEDS, st.just(0.15) | SHARES, st.integers(2, 9))
def test_every_pair_that_a_walk_can_visit_is_covered(ends, seed, share, steps):
    rng = np.random.default_rng(seed)
    pairs = rng.random((ends, ends)) < share
    table, seen = gaits_of(ends), np.zeros_like(pairs)
    for walk in cover_once(table, pairs, steps, rng):
        new = ~seen
        assert_is_a_walk(walk, len(walk))
        assert np.all(walk[:-1, 3] > 0)
        np.testing.assert_array_equal(walk, table[walk[:, 0], walk[:, 3]])
        seen[walk[:, 0], walk[:, 3]] = True
        assert (new & seen).any()
        assert len(walk) <= max(steps, 2 * ends)
    np.testing.assert_array_equal(seen, pairs_on_a_walk(pairs))


@pytest.mark.parametrize(("ends", "steps"), [(13, 22), (25, 22), (12, 30)])
def test_few_walks_cover_every_pair(ends, steps):
    """Each begins and ends by a pair of its own; little is walked twice."""
    pairs = np.ones((ends, ends), dtype=bool)
    rng = np.random.default_rng(0)
    walks = cover_once(gaits_of(ends), pairs, steps, rng)
    least = max(ends - 1, (ends**2 - 1) / steps)
    assert least <= len(walks) <= 1.1 * least + 1
    assert max(map(len, walks)) <= steps
    assert sum(map(len, walks)) < 1.2 * (ends**2 - 1)


def walk_exists(pairs, steps):
    """Whether allowed pairs lead from 0 to 0 in so many steps, not by way of 0."""
    inner = pairs[1:, 1:]
    reached = pairs[0, 1:]
    for _ in range(steps - 2):
        reached = (reached[:, None] & inner).any(axis=0)
    return bool((reached & pairs[1:, 0]).any())


@settings(max_examples=100)
@given(st.integers(2, 4), SEEDS, st.integers(2, 6))
def test_walks_are_found_wherever_there_are_some(ends, seed, steps):
    rng = np.random.default_rng(seed)
    pairs = rng.random((ends, ends)) < 0.5
    masks = [pairs, np.eye(ends, dtype=bool), np.eye(ends, dtype=bool)]
    for draw in (
        lambda: draw_walks(masks, 3, steps, rng),
        lambda: cover_pairs(gaits_of(ends), pairs, 3, steps, rng),
    ):
        if walk_exists(pairs, steps):
            for walk in draw():
                assert_is_a_walk(walk, steps)
        else:
            with pytest.raises(ChainError, match="no allowed step on"):
                draw()


def test_same_generator_same_walks():
    masks = [np.ones((3, 4), bool), np.ones((4, 5), bool), np.ones((5, 3), bool)]
    for draw in (
        lambda rng: draw_walks(masks, 4, 3, rng),
        lambda rng: cover_pairs(gaits_of(3), masks[0][:, :3], 4, 3, rng),
        lambda rng: cover_once(gaits_of(3), masks[0][:, :3], 4, rng),
    ):
        seeds = (np.random.default_rng(seed) for seed in (1, 1, 2))
        one, two, other = (np.concatenate(draw(rng)) for rng in seeds)
        np.testing.assert_array_equal(one, two)
        assert not np.array_equal(one, other)
