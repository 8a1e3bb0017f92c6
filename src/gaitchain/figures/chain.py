"""Fig. 6 and 7, and the regret of each policy, for a chain trained on random gaits."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np

from gaitchain.chain.expectation import (
    EdgeStatistics,
    expected_costs,
    path_costs,
    pose_costs,
)
from gaitchain.chain.layered_chain import FloatArray, IntArray, LayeredChain, draw_gaits
from gaitchain.chain.policy import regret
from gaitchain.chain.pruning import all_gaits, independent_gaits, pose_distances, prune
from gaitchain.chain.training import train_sequential
from gaitchain.errors import CommandError
from gaitchain.figures.style import PAPER, Axes, drawing, rounded, write_json
from gaitchain.gait.keypose.cost import PlannedCost
from gaitchain.gait.keypose.presets import draw_candidates
from gaitchain.gait.motion import Timing
from gaitchain.robot.box_robot import load_box_robot

EPSILONS = tuple(round(1.0 + 0.2 * i, 1) for i in range(11))
"""Values of epsilon in Fig. 6: 1 to 3 in steps of 0.2."""
SAMPLE_COUNTS = (*range(20, 400, 50), 400)
"""Numbers of samples in Fig. 7: 20 to 400 in steps of 50; the last step is shorter."""
ZETA = 3.0
"""Mean over the four key moments; we read the paper's 12 as their sum."""
_BASES = {"e": math.e, "10": 10.0, "2": 2.0}
_CURVES = {
    "e": ("natural logarithm (ours)", "o-", "#1f6fb4"),
    "10": ("base 10", "s-", "#999999"),
    "2": ("base 2", "^-", "#5aa469"),
}
_LAYERS = (1, 2)  # 0-based: the paper's layers 2 and 3
_CLAIM_6 = {
    "layer2_at_3": 3,
    "layer3_at_3": 3,
    "zeta": 12,
    "text": "Both layers lose poses as epsilon grows from 2 to 3 and keep 3 of 10 at "
    "epsilon = 3; the gaits left are a zeta = 12 independent group, which we read as "
    "the sum over four key moments (a mean of 3).",
}
_CLAIM_7 = {
    "layer2_beyond_160": 10,
    "layer3_beyond_160": 10,
    "text": "The poses kept rise with the number of gait samples and stay at 10 of 10 "
    "beyond 160 samples (epsilon = 2.5).",
}


@dataclass(frozen=True, eq=False)
class ChainSample:
    """Candidate poses of Table I for the robot RES, and uniformly drawn gaits."""

    cost: PlannedCost
    """Eq. 3 alone, without the landing impact."""
    gaits: IntArray
    """(N_r, 4) pose indices."""
    f: FloatArray
    """(N_r,) cost of the gaits."""

    @classmethod
    def of_seed(cls, seed: int, samples: int) -> Self:
        """Draw candidates, then gaits, from one generator with this seed."""
        rng = np.random.default_rng(seed)
        poses = draw_candidates(load_box_robot("res"), "table1", rng)
        cost = PlannedCost(poses, Timing(), impact_weight=0.0)
        gaits = draw_gaits(poses.counts, samples, rng)
        return cls(cost, gaits, cost(gaits))

    @property
    def counts(self) -> tuple[int, ...]:
        """Number of candidates at each key moment."""
        return self.cost.poses.counts

    def learn(self, samples: int) -> EdgeStatistics:
        """Estimate the expected edge costs from the first samples."""
        return expected_costs(self.counts, self.gaits[:samples], self.f[:samples])

    def ahead(self, samples: int) -> tuple[FloatArray, ...]:
        """Estimate edge costs whose sum is a gait's cost from the first samples."""
        return path_costs(self.counts, self.gaits[:samples], self.f[:samples])

    def train(self, samples: int) -> tuple[LayeredChain, tuple[FloatArray, ...]]:
        """Train an open chain on the first samples; return it and the pose costs."""
        blank = LayeredChain.uniform(self.counts, cyclic=False)
        chain = train_sequential(blank, self.gaits[:samples], self.f[:samples])
        return chain, pose_costs(self.learn(samples))


def draws(seeds: int, samples: int) -> list[ChainSample]:
    """Return the draws of seeds 0, 1, ...

    Raises:
        CommandError: the number of seeds or samples is below 1.
    """
    if seeds < 1 or samples < 1:
        raise CommandError(f"{seeds} seeds, {samples} samples: need 1 or more of each")
    return [ChainSample.of_seed(seed, samples) for seed in range(seeds)]


def figure_6(out: Path, seeds: int = 20, samples: int = 100) -> dict[str, Any]:
    """Plot the number of poses left after pruning against epsilon (Fig. 6).

    Args:
        out: folder for fig06.png and fig06.json.
        seeds: number of draws of candidates and gaits to average.
        samples: number of gaits that train the chain.

    Returns:
        The numbers, as in the JSON.
    """
    drawn = draws(seeds, samples)
    sizes = np.array([_over_epsilon(d, samples) for d in drawn])
    gaits_left = [_independent_gaits(d, samples) for d in drawn]

    def claim(axes: Axes, label: str | None) -> None:
        axes.axvspan(2.0, 3.0, color=PAPER, alpha=0.06, linewidth=0)
        axes.plot(3.0, 3.0, "*", color=PAPER, markersize=11, clip_on=False, label=label)
        axes.set_xticks([1.0, 1.5, 2.0, 2.5, 3.0])
        axes.set_xlabel("ε, least pose inner distance")

    title = f"Fig. 6: poses kept after {samples} gaits, mean of {seeds} draws"
    label = "paper: falls from ε = 2 to 3, to 3 of 10"
    _draw(out / "fig06.png", (EPSILONS, sizes), title, claim, label)
    result = {
        "epsilon": list(EPSILONS),
        **_by_base(sizes),
        **_of_draws(drawn),
        "samples": samples,
        "independent_gaits_at_eps_3": rounded(np.mean(gaits_left), 2),
        "zeta": ZETA,
        "ours": f"{_kept(sizes)} at ε = 3",
        "paper": _CLAIM_6,
    }
    return write_json(out / "fig06.json", result)


def figure_7(out: Path, seeds: int = 20, epsilon: float = 2.5) -> dict[str, Any]:
    """Plot the number of poses left after pruning against the samples (Fig. 7).

    Args:
        out: folder for fig07.png and fig07.json.
        seeds: number of draws of candidates and gaits to average.
        epsilon: least pose inner distance.

    Returns:
        The numbers, as in the JSON.
    """
    drawn = draws(seeds, max(SAMPLE_COUNTS))
    sizes = np.array([_over_samples(d, epsilon) for d in drawn])

    def claim(axes: Axes, label: str | None) -> None:
        style: dict[str, Any] = {"color": PAPER, "zorder": 5, "clip_on": False}
        axes.plot([160, 400], [10, 10], linestyle=(0, (1, 2)), **style)
        axes.plot(160, 10, "*", markersize=11, label=label, **style)
        axes.set(xticks=range(0, 401, 100), xlabel="gait samples $N_r$")

    title = f"Fig. 7: poses kept at ε = {epsilon:g}, mean of {seeds} draws"
    label = "paper: 10 of 10 beyond 160 samples"
    _draw(out / "fig07.png", (SAMPLE_COUNTS, sizes), title, claim, label)
    result = {
        "samples": list(SAMPLE_COUNTS),
        **_by_base(sizes),
        **_of_draws(drawn),
        "epsilon": epsilon,
        "ours": f"{_kept(sizes)} after {SAMPLE_COUNTS[-1]} samples",
        "paper": _CLAIM_7,
    }
    return write_json(out / "fig07.json", result)


def _of_draws(drawn: Sequence[ChainSample]) -> dict[str, Any]:
    mean_cost = rounded(np.mean([draw.f.mean() for draw in drawn]))
    return {"seeds": len(drawn), "mean_cost": mean_cost}


def _over_epsilon(draw: ChainSample, samples: int) -> list[list[list[int]]]:
    chain, costs = draw.train(samples)
    return [[_sizes(chain, costs, e, b) for e in EPSILONS] for b in _BASES.values()]


def _over_samples(draw: ChainSample, epsilon: float) -> list[list[list[int]]]:
    trained = [draw.train(count) for count in SAMPLE_COUNTS]
    return [
        [_sizes(chain, costs, epsilon, base) for chain, costs in trained]
        for base in _BASES.values()
    ]


def _sizes(
    chain: LayeredChain, costs: Sequence[FloatArray], epsilon: float, base: float
) -> list[int]:
    kept = prune(chain, costs, epsilon, base, layers=_LAYERS).kept
    return [len(kept[layer]) for layer in _LAYERS]


def _independent_gaits(draw: ChainSample, samples: int) -> int:
    """Count the zeta independent gaits among those of the poses left at epsilon 3."""
    chain, costs = draw.train(samples)
    kept = prune(chain, costs, EPSILONS[-1], layers=_LAYERS).kept
    rows = all_gaits([len(group) for group in kept])
    gaits = np.stack([group[rows[:, i]] for i, group in enumerate(kept)], axis=1)
    distances = pose_distances(chain)
    return len(independent_gaits(gaits, distances, draw.cost(gaits), ZETA))


def _kept(sizes: IntArray) -> str:
    second, third = sizes[:, 0, -1].mean(axis=0)
    return f"layers 2 and 3 keep {second:.1f} and {third:.1f} of 10"


def _by_base(sizes: IntArray) -> dict[str, Any]:
    """Return mean and spread of the (seeds, bases, points, layers) sizes by name."""
    mean, std = sizes.mean(axis=0), sizes.std(axis=0)
    named = [
        {"layer2": rounded(mean[b, :, 0]), "layer3": rounded(mean[b, :, 1])}
        for b in range(len(_BASES))
    ]
    return {
        **named[0],
        "layer2_std": rounded(std[0, :, 0]),
        "layer3_std": rounded(std[0, :, 1]),
        "log_base": "e",
        "log_base_10": named[1],
        "log_base_2": named[2],
    }


def _draw(
    path: Path,
    curves: tuple[Sequence[float], IntArray],
    title: str,
    claim: Callable[[Axes, str | None], None],
    label: str,
) -> None:
    """Draw a panel for each layer, with the paper's claim on top."""
    points, sizes = curves
    with drawing(path, 7.2, 3.4) as figure:
        panels = figure.subplots(1, 2, sharey=True)
        for i, axes in enumerate(panels):
            _draw_layer(axes, points, sizes[..., i], named=i == 0)
            claim(axes, label if i == 0 else None)
            axes.set_title(f"layer {i + 2} (key moment kp$_{i + 2}$)")
        panels[0].set_ylabel("poses kept of 10")
        figure.legend(loc="outside lower center", ncols=2)
        figure.suptitle(f"{title} (band: ±1 std)")


def _draw_layer(
    axes: Axes, points: Sequence[float], sizes: IntArray, named: bool
) -> None:
    for i, base in enumerate(_BASES):
        mean, std = sizes[:, i].mean(axis=0), sizes[:, i].std(axis=0)
        name, style, colour = _CURVES[base]
        label = name if named else None
        axes.plot(points, mean, style, color=colour, markersize=3.5, label=label)
        if base == "e":
            low, high = mean - std, np.minimum(mean + std, 10.0)
            axes.fill_between(points, low, high, color=colour, alpha=0.15, linewidth=0)
    axes.set(ylim=(0, 10.6), yticks=range(0, 11, 2))


def regret_table(
    out: Path, seeds: int = 20, samples: Sequence[int] = (100, 2000)
) -> dict[str, Any]:
    """Compute the regret of each policy, relative to the range of costs.

    The planned cost of all 2500 gaits of Table I is known here, but the policies only
    use the edge costs estimated from the sampled gaits.

    Args:
        out: folder for regret.json.
        seeds: number of draws of candidates and gaits to average.
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


def _regrets(
    draw: ChainSample, every: IntArray, samples: Sequence[int]
) -> list[list[float]]:
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
