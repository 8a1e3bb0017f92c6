"""Draw walks: gaits linked end to start, as the cyclic chain allows them.

Chain side: only layers, indices and numbers. Pose 0 of the first and the last layer
is where a walk starts and ends.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gaitchain.chain import IntArray
from gaitchain.errors import ChainError

Mask = NDArray[np.bool_]


def draw_walks(
    allowed: Sequence[Mask], count: int, steps: int, rng: np.random.Generator
) -> list[IntArray]:
    """Draw walks whose every edge is allowed, inner poses uniformly.

    A step's last pose is drawn first, then the poses that lead to it, so that no draw
    runs into a dead end.

    Args:
        allowed: three masks (N_i, N_{i+1}) of edges.
        count: number of walks.
        steps: steps per walk, >= 2.
        rng: source of randomness.

    Returns:
        Walks, each (steps, 4); they start and end at pose 0.

    Raises:
        ChainError: fewer than two steps, or a pose pair that no path joins.
    """
    if steps < 2:
        raise ChainError(f"{steps} steps: a walk has at least 2, a first and a last")
    ends = allowed[-1].shape[1]
    walks = []
    for _ in range(count):
        targets = [*rng.integers(1, ends, steps - 1), 0]
        starts = [0, *targets[:-1]]
        gaits = [
            _draw_gait(allowed, int(first), int(last), rng)
            for first, last in zip(starts, targets, strict=True)
        ]
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
        ChainError: fewer than two steps, or a pose from which pose 0 is out of reach.
    """
    if steps < 2:
        raise ChainError(f"{steps} steps: a walk has at least 2, a first and a last")
    visits = np.zeros(allowed.shape)
    walks = []
    for _ in range(count):
        at, gaits = 0, []
        for step in range(steps):
            onward = allowed[at].copy()
            onward[0] = False
            if step >= steps - 2:
                onward &= allowed[:, 0]  # the next step must be able to end the walk
            if step == steps - 1:
                onward = np.zeros_like(onward)
                onward[0] = allowed[at, 0]
            if not onward.any():
                raise ChainError(f"pose {at} has no allowed step on; allow one more")
            tiring = visits[at] + rng.uniform(0.0, 0.5, onward.size)
            target = int(np.argmin(np.where(onward, tiring, np.inf)))
            visits[at, target] += 1
            gaits.append(gait_of[at, target])
            at = target
        walks.append(np.array(gaits, dtype=np.int64))
    return walks


def _draw_gait(
    allowed: Sequence[Mask], first: int, last: int, rng: np.random.Generator
) -> tuple[int, int, int, int]:
    reach_third = allowed[2][:, last]
    onward = allowed[1] & reach_third
    second_ok = allowed[0][first] & onward.any(axis=1)
    if not second_ok.any():
        raise ChainError(
            f"no allowed path leads from pose {first} of layer 1 to pose {last} of "
            "layer 4; allow more edges or draw more candidates"
        )
    second = int(rng.choice(np.flatnonzero(second_ok)))
    third = int(rng.choice(np.flatnonzero(onward[second])))
    return first, second, third, last
