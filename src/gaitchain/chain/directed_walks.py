"""Training walks that go where earlier ones leave the best way open. Ours.

Uniform draws spend most of their walks on gaits that are never chosen. Here the ends
of the steps stay as they were drawn, and the poses in between are the cheapest way by
costs drawn from what the earlier walks leave possible (Thompson sampling): good ways
are walked more often, and so are those of which little is known.
"""

from collections.abc import Sequence

import numpy as np

from gaitchain.chain.expectation import join_effects, path_effects
from gaitchain.chain.layered_chain import FloatArray, IntArray
from gaitchain.chain.policy import forbid, look_ahead
from gaitchain.chain.sampling import Mask


def direct_walks(
    walks: Sequence[IntArray],
    allowed: Sequence[Mask],
    samples: tuple[IntArray, FloatArray],
    rng: np.random.Generator,
) -> list[IntArray]:
    """Replace the inner poses of walks, each by costs drawn for it.

    Args:
        walks: (S, 4) each; first and last poses of their steps stay.
        allowed: three masks (N_i, N_{i+1}) of edges.
        samples: (G, 4) gaits walked so far and (G,) their costs.
        rng: source of randomness.

    Returns:
        Walks of the same lengths.
    """
    sizes = (*(len(mask) for mask in allowed), allowed[-1].shape[1])
    fit = path_effects(sizes, *samples)
    directed = []
    for walk in walks:
        costs = forbid(join_effects(sizes, fit.mean, fit.drawn(rng)), allowed)
        steps = walk[:, [0, -1]].tolist()
        directed.append(np.stack([look_ahead(costs, a, [b]) for a, b in steps]))
    return directed
