"""Regret of the policies on the planned cost, against the best of all gaits."""

import numpy as np

from gaitchain.chain.expectation import expected_costs, path_costs
from gaitchain.chain.policy import Regret, forbid, regret
from gaitchain.chain.pruning import all_gaits
from gaitchain.chain.sampling import Mask
from gaitchain.gait.keypose.cost import PlannedCost
from gaitchain.gait.keypose.key_poses import KeyPoses
from gaitchain.gait.motion import Timing

_SAMPLE = 10_000  # gaits from which the expected costs are estimated
_MOST_GAITS = 2_000_000


def planned_regret(
    poses: KeyPoses, timing: Timing, allowed: tuple[Mask, ...], seed: int
) -> Regret:
    """Compute the regret of both policies on the planned cost.

    The planned cost of every feasible gait can be computed; the expected costs of the
    edges are estimated from a sample of them.

    Args:
        poses: the candidates.
        timing: the step's times.
        allowed: masks of the feasible edges.
        seed: seed of the sample.

    Returns:
        The regret against the exhaustive optimum.
    """
    gaits = all_gaits(poses.counts, limit=_MOST_GAITS)
    for layer, mask in enumerate(allowed):
        gaits = gaits[mask[gaits[:, layer], gaits[:, layer + 1]]]
    costs = PlannedCost(poses, timing)(gaits)
    sample = np.random.default_rng(seed).integers(len(gaits), size=_SAMPLE)
    learned = expected_costs(poses.counts, gaits[sample], costs[sample])
    ahead = path_costs(poses.counts, gaits[sample], costs[sample])
    return regret(forbid(learned.cost, allowed), forbid(ahead, allowed), gaits, costs)
