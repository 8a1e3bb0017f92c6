"""The regret of the greedy choice and of looking ahead, which the paper leaves open."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from gaitchain.chain.layered_chain import IntArray
from gaitchain.chain.policy import regret
from gaitchain.chain.pruning import all_gaits
from gaitchain.figures.draws import Draw, draws
from gaitchain.figures.style import rounded, write_json


def regret_table(
    out: Path, seeds: int = 20, samples: Sequence[int] = (100, 2000)
) -> dict[str, Any]:
    """Measure how much worse than the best gait each policy chooses.

    Over all gaits of Table I (2500) on the planned cost; the policies know only the
    edge costs learned from the sampled gaits.

    Args:
        out: folder for regret.json.
        seeds: draws of candidates and gaits to average.
        samples: numbers of gaits to learn from.

    Returns:
        The numbers, as in the JSON.
    """
    drawn = draws(seeds, max(samples, default=0))
    every = all_gaits(drawn[0].counts)
    rows = np.array([_regrets(d, every, samples) for d in drawn])
    result = {
        "regret": {
            str(count): {
                "greedy": _spread(rows[:, i, 0]),
                "look_ahead": _spread(rows[:, i, 1]),
            }
            for i, count in enumerate(samples)
        },
        "unit": "mean over start poses of (cost - best cost), over the cost's range",
        "gaits": len(every),
        "seeds": seeds,
        "ours": ", ".join(
            f"{rows[:, i, 1].mean():.1%} (greedy {rows[:, i, 0].mean():.1%}) after "
            f"{count} gaits"
            for i, count in enumerate(samples)
        ),
        "paper": {
            "text": "Online, the next pose of least cost is chosen; how far that is "
            "from the best gait is not reported."
        },
    }
    return write_json(out / "regret.json", result)


def _regrets(draw: Draw, every: IntArray, samples: Sequence[int]) -> list[list[float]]:
    true = draw.cost(every)
    measured = [
        regret(draw.learn(count).cost, draw.ahead(count), every, true)
        for count in samples
    ]
    return [[m.greedy, m.look_ahead] for m in measured]


def _spread(values: np.ndarray[Any, Any]) -> dict[str, float]:
    return {
        "mean": rounded(values.mean(), 5),
        "std": rounded(values.std(), 5),
        "max": rounded(values.max(), 5),
    }
