"""Effect of pruning and of looking ahead on the expected cost of the chosen gaits."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gaitchain.chain.layered_chain import FloatArray, IntArray
from gaitchain.chain.policy import cost_to_go, greedy, look_ahead

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class ChoiceGain:
    """Mean expected costs of the gaits chosen between first and last poses."""

    all_poses: float
    """With `look_ahead` over all candidates."""
    kept_poses: float
    """With `look_ahead` over the poses that pruning kept."""
    kept_greedy: float
    """With the paper's greedy rule over the poses that pruning kept."""


def choice_gain(
    all_paths: Sequence[FloatArray],
    kept_paths: Sequence[FloatArray],
    kept_edges: Sequence[FloatArray],
    pairs: Mask,
) -> ChoiceGain:
    """Compare the gaits that are chosen between pairs of first and last poses.

    Args:
        all_paths: path costs of all candidates, three matrices; +inf forbids an edge.
        kept_paths: path costs of the kept poses; layers 1 and 4 are kept entirely.
        kept_edges: expected edge costs of the kept poses, for the greedy rule.
        pairs: (N_1, N_4) pairs that may be walked.

    Returns:
        The mean costs over these pairs.
    """
    rows: list[list[float]] = []
    for last in np.flatnonzero(pairs.any(axis=0)).tolist():
        ways = [
            _cost_to(all_paths, all_paths, last, look_ahead),
            _cost_to(kept_paths, kept_paths, last, look_ahead),
            _cost_to(kept_paths, kept_edges, last, greedy),
        ]
        for first in np.flatnonzero(pairs[:, last]).tolist():
            rows.append([way(first) for way in ways])
    means = np.array(rows).mean(axis=0) if rows else np.full(3, np.nan)
    return ChoiceGain(*(float(m) for m in means))


def _cost_to(
    paths: Sequence[FloatArray],
    rule: Sequence[FloatArray],
    last: int,
    choose: Callable[..., IntArray],
) -> Callable[[int], float]:
    """Return a function of the first pose: cost, by `paths`, of the gait to `last`.

    The gait is chosen by `choose` on the edge costs `rule`.
    """
    end = np.full(paths[-1].shape[1], np.inf)
    end[last] = 0.0
    values = cost_to_go(paths, end)
    # The greedy rule, too, avoids edges from which `last` cannot be reached.
    open_edges = [
        np.where(np.isfinite(path + values[i + 1]), edge, np.inf)
        for i, (path, edge) in enumerate(zip(paths, rule, strict=True))
    ]

    def cost(first: int) -> float:
        gait = choose(open_edges, first, [last])
        return float(sum(c[gait[i], gait[i + 1]] for i, c in enumerate(paths)))

    return cost
