"""The generator's tables: every choice of a library, worked out beforehand."""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gaitchain.chain.layered_chain import FloatArray, IntArray
from gaitchain.chain.policy import cost_to_go
from gaitchain.gait.family import STAND
from gaitchain.gait.library import GaitLibrary

Policy = Literal["look_ahead", "greedy"]
_FAR = 1_000_000  # steps: no way


def safe_pairs(library: GaitLibrary) -> tuple[NDArray[np.bool_], IntArray]:
    """Steps that physics passed and from whose end the robot can come to a stand.

    Returns:
        (N_1, N_4) mask, and (N_4,) least number of steps to standing.
    """
    passed = library.allowed_pairs
    distance = steps_to_stand(passed)
    return passed & (distance < _FAR), distance


def steps_to_stand(pairs: NDArray[np.bool_]) -> IntArray:
    """(N_4,) least number of steps to standing from each pose, by steps that may be."""
    distance = np.where(np.arange(pairs.shape[1]) == STAND, 0, _FAR)
    for steps in range(1, pairs.shape[0] + 1):
        near = (pairs & (distance == steps - 1)).any(axis=1)
        distance = np.where(near & (distance == _FAR), steps, distance)
    return distance


def pair_costs(library: GaitLibrary) -> FloatArray:
    """(N_1, N_4) expected cost of the best gait of each pair."""
    gaits, total = library.gait_of, np.zeros(library.gait_of.shape[:2])
    for layer, costs in enumerate(library.path_costs):
        total += costs[gaits[..., layer], gaits[..., layer + 1]]
    return np.where(gaits[..., 0] < 0, np.inf, total)


Options = tuple[tuple[int, float], ...]


def ranked_choices(library: GaitLibrary, policy: Policy) -> list[list[list[Options]]]:
    """choices[target][layer][pose]: (next pose, cost) of every way on, best first."""
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
