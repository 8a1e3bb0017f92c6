"""Draw walks: gaits linked end to start, as the cyclic chain allows them.

Chain side: only layers, indices and numbers. Pose 0 of the first and the last layer
is where a walk starts and ends.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gaitchain.chain.layered_chain import IntArray
from gaitchain.errors import ChainError

Mask = NDArray[np.bool_]


def draw_walks(
    allowed: Sequence[Mask],
    count: int,
    steps: int,
    rng: np.random.Generator,
    pairs: Mask | None = None,
) -> list[IntArray]:
    """Draw walks whose every edge is allowed, inner poses uniformly.

    A step's last pose is drawn first, then the poses that lead to it, so that no draw
    runs into a dead end.

    Args:
        allowed: three masks (N_i, N_{i+1}) of edges.
        count: number of walks.
        steps: steps per walk, >= 2.
        rng: source of randomness.
        pairs: (N_1, N_4) first and last poses that may be joined; any by default.

    Returns:
        Walks, each (steps, 4); they start and end at pose 0.

    Raises:
        ChainError: fewer than two steps, or a pose from which no walk can go on.
    """
    if steps < 2:
        raise ChainError(f"{steps} steps: a walk has at least 2, a first and a last")
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

    Each step goes on to the pose that was least often reached from where it stands.

    Args:
        gait_of: (N_1, N_4, 4) the gait that joins each pair.
        allowed: (N_1, N_4) pairs that may be walked.
        count: number of walks.
        steps: steps per walk, >= 2.
        rng: source of randomness.

    Returns:
        Walks, each (steps, 4); they start and end at pose 0.

    Raises:
        ChainError: fewer than two steps, or a pose from which no walk can go on.
    """
    if steps < 2:
        raise ChainError(f"{steps} steps: a walk has at least 2, a first and a last")
    visits = np.zeros(allowed.shape)
    homeward = _homeward(allowed, steps - 1)
    walks = []
    for _ in range(count):
        at, gaits = 0, []
        for step in range(steps):
            onward = _onward(allowed, at, homeward[-1 - step])
            tiring = visits[at, onward] + rng.uniform(0.0, 0.5, onward.size)
            target = int(onward[np.argmin(tiring)])
            visits[at, target] += 1
            gaits.append(gait_of[at, target])
            at = target
        walks.append(np.array(gaits, dtype=np.int64))
    return walks


def _homeward(pairs: Mask, steps: int) -> list[Mask]:
    """Poses from which a walk can end at pose 0 in exactly 0, 1, ... `steps` steps."""
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
    """Poses where the next step may end, so that the walk can still end at pose 0."""
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
