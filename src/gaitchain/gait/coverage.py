"""Walks from standing to standing that together take every step of a library."""

from collections import deque

import numpy as np
from numpy.typing import NDArray

from gaitchain.chain.layered_chain import IntArray
from gaitchain.gait.family import STAND


def cover_walks(
    pairs: NDArray[np.bool_], steps: int, rng: np.random.Generator
) -> list[IntArray]:
    """Draw walks from standing to standing that together take every step.

    Args:
        pairs: (N_1, N_4) steps; from the end of each the robot can come to a stand.
        steps: after so many a walk turns home.
        rng: source of randomness.

    Returns:
        Poses of layer 1 that each walk passes, the standing pose first and last. Steps
        that no walk from standing reaches are not in them.
    """
    inner, stand = pairs.copy(), np.arange(len(pairs)) == STAND
    inner[:, STAND] = False
    left, homeward = inner.copy(), pairs[:, STAND] & ~stand
    walks: list[IntArray] = []
    while True:
        at = [STAND]
        while len(at) <= steps:
            way = _way(inner, at[-1], np.asarray(left.any(axis=1)))
            if way is None:
                break
            at += way
            at.append(int(rng.choice(np.flatnonzero(left[at[-1]]))))
            left[at[:-1], at[1:]] = False
        last = _way(inner, at[-1], homeward)
        if len(at) == 1 and last is None:
            return walks
        at += last or ()
        at += _way(pairs, at[-1], stand) or ()
        left[at[:-1], at[1:]], homeward[at[-2]] = False, False
        walks.append(np.array(at))


def _way(
    pairs: NDArray[np.bool_], start: int, goals: NDArray[np.bool_]
) -> list[int] | None:
    """Shortest way to the nearest goal, without its start; None if there is none."""
    before = {start: start}
    queue = deque([start])
    while queue:
        at = queue.popleft()
        if goals[at]:
            way = []
            while at != start:
                way.append(at)
                at = before[at]
            return way[::-1]
        for onward in np.flatnonzero(pairs[at]).tolist():
            if onward not in before:
                before[onward] = at
                queue.append(onward)
    return None
