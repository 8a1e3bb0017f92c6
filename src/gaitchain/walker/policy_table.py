"""Tables of the generator: every choice of a library, computed in advance."""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gaitchain.chain.layered_chain import FloatArray, IntArray
from gaitchain.chain.policy import cost_to_go
from gaitchain.gait.family import STAND
from gaitchain.gait.library import GaitLibrary

Policy = Literal["look_ahead", "greedy"]
_FAR = 1_000_000  # steps: standing cannot be reached


def safe_pairs(library: GaitLibrary) -> tuple[NDArray[np.bool_], IntArray]:
    """Find the steps that passed physics and after which the robot can still stop.

    Returns:
        (N_1, N_4) mask, and (N_4,) least number of steps to standing.
    """
    passed = library.allowed_pairs
    distance = steps_to_stand(passed)
    return passed & (distance < _FAR), distance


def steps_to_stand(pairs: NDArray[np.bool_]) -> IntArray:
    """Return the least number of allowed steps from each pose to standing, (N_4,)."""
    distance = np.where(np.arange(pairs.shape[1]) == STAND, 0, _FAR)
    for steps in range(1, pairs.shape[0] + 1):
        near = (pairs & (distance == steps - 1)).any(axis=1)
        distance = np.where(near & (distance == _FAR), steps, distance)
    return distance


def pair_costs(library: GaitLibrary) -> FloatArray:
    """Return the expected cost of the best gait of each pair of poses, (N_1, N_4)."""
    gaits, total = library.gait_of, np.zeros(library.gait_of.shape[:2])
    for layer, costs in enumerate(library.path_costs):
        total += costs[gaits[..., layer], gaits[..., layer + 1]]
    return np.where(gaits[..., 0] < 0, np.inf, total)


Options = tuple[tuple[int, float], ...]


def ranked_choices(library: GaitLibrary, policy: Policy) -> list[list[list[Options]]]:
    """Rank the successors of each pose on the way to each target.

    Returns:
        choices[target][layer][pose] = (next pose, cost) pairs, cheapest first.
    """
    targets = library.chain.layer_sizes[-1]
    return [_choices_toward(library, target, policy) for target in range(targets)]


def _choices_toward(
    library: GaitLibrary, target: int, policy: Policy
) -> list[list[Options]]:
    last = np.full(library.chain.layer_sizes[-1], np.inf)
    last[target] = 0.0
    values = cost_to_go(library.path_costs, last)
    table = []
    for layer, costs in enumerate(library.path_costs):
        ahead = costs + values[layer + 1]
        near = np.where(np.isfinite(ahead), library.edge_costs[layer], np.inf)
        table.append(_ranked(ahead if policy == "look_ahead" else near))
    return table


def _ranked(totals: FloatArray) -> list[Options]:
    ranked = []
    for row in totals:
        order = [int(n) for n in np.argsort(row, kind="stable") if np.isfinite(row[n])]
        ranked.append(tuple((n, float(row[n])) for n in order))
    return ranked
