"""Draw walks: gaits linked end to start, as the cyclic chain allows them.

A walk starts at pose 0 of the first layer and ends at pose 0 of the last.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gaitchain.chain.layered_chain import FloatArray, IntArray
from gaitchain.errors import ChainError

Mask = NDArray[np.bool_]


def draw_walks(
    allowed: Sequence[Mask],
    count: int,
    steps: int,
    rng: np.random.Generator,
    pairs: Mask | None = None,
) -> list[IntArray]:
    """Draw walks over allowed edges, the poses in between uniformly.

    The last pose of a step is drawn first, then the poses on the way to it, so that no
    draw ends in a dead end.

    Args:
        allowed: three masks (N_i, N_{i+1}) of edges.
        count: number of walks.
        steps: steps per walk, >= 2.
        rng: source of randomness.
        pairs: (N_1, N_4) pairs of first and last pose that are allowed; all by default.

    Returns:
        Walks, each (steps, 4); they start and end at pose 0.

    Raises:
        ChainError: fewer than two steps, or a pose from which no walk can continue.
    """
    _check_steps(steps)
    joined = np.linalg.multi_dot([mask.astype(float) for mask in allowed]) > 0.0
    if pairs is not None:
        joined &= pairs
    homeward = _homeward(joined, steps - 1)
    walks = []
    for _ in range(count):
        at, gaits = 0, []
        for step in range(steps):
            target = int(rng.choice(_onward(joined, at, homeward[-1 - step])))
            gaits.append(_draw_gait(allowed, at, target, rng))
            at = target
        walks.append(np.array(gaits, dtype=np.int64))
    return walks


def cover_pairs(
    gait_of: IntArray, allowed: Mask, count: int, steps: int, rng: np.random.Generator
) -> list[IntArray]:
    """Draw walks that visit all allowed pairs of first and last pose evenly.

    Each step ends at the pose that was least often reached from its first pose.

    Args:
        gait_of: (N_1, N_4, 4) the gait that joins each pair.
        allowed: (N_1, N_4) pairs that may be walked.
        count: number of walks.
        steps: steps per walk, >= 2.
        rng: source of randomness.

    Returns:
        Walks, each (steps, 4); they start and end at pose 0.

    Raises:
        ChainError: fewer than two steps, or a pose from which no walk can continue.
    """
    _check_steps(steps)
    visits = np.zeros(allowed.shape)
    homeward = _homeward(allowed, steps - 1)
    return [gait_of[_cover_walk(allowed, visits, homeward, rng)] for _ in range(count)]


def cover_once(
    gait_of: IntArray, allowed: Mask, steps: int, rng: np.random.Generator
) -> list[IntArray]:
    """Draw few walks that together visit every allowed pair of first and last pose.

    Like `cover_pairs`, but a step may end only at the poses from which the rest of the
    walk can visit the greatest number of new pairs.

    Args:
        gait_of: (N_1, N_4, 4) the gait that joins each pair.
        allowed: (N_1, N_4) pairs that may be walked.
        steps: largest number of steps of a walk, >= 2; a pair that cannot be visited in
            so many steps gets a longer walk.
        rng: source of randomness.

    Returns:
        Walks, each (S, 4); they start and end at pose 0. Pairs that no such walk can
        visit are left out.

    Raises:
        ChainError: fewer than two steps.
    """
    _check_steps(steps)
    visits, walks = np.zeros(allowed.shape), list[IntArray]()
    # A walk of twice as many steps as there are poses can visit any one pair.
    longest = max(steps, 2 * len(allowed))
    homeward = _homeward(allowed, longest - 1)
    while length := _new_length(allowed, visits, steps, longest):
        poses = _cover_walk(allowed, visits, homeward[:length], rng, once=True)
        walks.append(gait_of[poses])
    return walks


def _check_steps(steps: int) -> None:
    if steps < 2:
        raise ChainError(f"{steps} steps: a walk has at least 2, a first and a last")


def _new_length(pairs: Mask, visits: FloatArray, steps: int, longest: int) -> int:
    """Return the length of the shortest walk that visits the most new pairs, in steps.

    It exceeds `steps` only if no shorter walk visits a new pair; 0 if no walk does.
    """

    def new(length: int) -> float:
        return float(_new_ahead(pairs, visits, 0, length - 1).max())

    best = max(range(2, steps + 1), key=new)
    lengths = best, *range(steps + 1, longest + 1)
    return next((length for length in lengths if new(length) > 0.0), 0)


def _cover_walk(
    pairs: Mask,
    visits: FloatArray,
    homeward: list[Mask],
    rng: np.random.Generator,
    *,
    once: bool = False,
) -> tuple[IntArray, IntArray]:
    """Draw a walk over the pairs with the fewest visits, and add its visits.

    Returns:
        (S,) first and (S,) last pose of its steps.
    """
    poses = [0]
    for left in reversed(range(len(homeward))):
        at = poses[-1]
        onward = _onward(pairs, at, homeward[left])
        if once:
            new = _new_ahead(pairs, visits, at, left)[onward]
            onward = onward[new == new.max()]
        jittered = visits[at, onward] + rng.uniform(0.0, 0.5, onward.size)
        poses.append(int(onward[np.argmin(jittered)]))
        visits[at, poses[-1]] += 1
    return np.array(poses[:-1]), np.array(poses[1:])


def _new_ahead(pairs: Mask, visits: FloatArray, at: int, left: int) -> FloatArray:
    """Return how many new pairs a walk can visit after a step from `at` to each pose.

    The walk ends at pose 0 in `left` more steps. The number is an upper bound, as a new
    pair counts at every visit, but it is 0 only if there is none; -inf if there is no
    such walk.
    """
    new = np.where(pairs, visits == 0.0, -np.inf)
    home = np.arange(len(pairs)) == 0
    most = np.where(home, 0.0, -np.inf)
    for _ in range(left):
        most = np.where(home, -np.inf, (new + most).max(axis=1))
    return np.asarray(new[at] + most)


def _homeward(pairs: Mask, steps: int) -> list[Mask]:
    """Return the poses from which a walk can end in exactly 0, 1, ... `steps` steps."""
    home = np.zeros(pairs.shape[0], dtype=np.bool_)
    home[0] = True
    able = [home]
    between = pairs.copy()
    between[:, 0] = False  # pose 0 ends a walk
    for left in range(1, steps + 1):
        reach = pairs[:, 0] if left == 1 else np.any(between & able[-1], axis=1)
        able.append(np.asarray(reach & ~home))
    return able


def _onward(pairs: Mask, at: int, homeward: Mask) -> IntArray:
    """Return the poses where the next step may end so that the walk can still end."""
    onward = np.flatnonzero(pairs[at] & homeward)
    if not onward.size:
        raise ChainError(
            f"pose {at} has no allowed step on that leads back to pose 0 in time; "
            "allow more edges or draw more candidates"
        )
    return onward


def _draw_gait(
    allowed: Sequence[Mask], first: int, last: int, rng: np.random.Generator
) -> tuple[int, int, int, int]:
    """Draw the inner poses of a gait between two poses that some path joins."""
    onward = allowed[1] & allowed[2][:, last]
    second_ok = allowed[0][first] & onward.any(axis=1)
    second = int(rng.choice(np.flatnonzero(second_ok)))
    third = int(rng.choice(np.flatnonzero(onward[second])))
    return first, second, third, last
