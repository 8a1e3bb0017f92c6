"""Training data: random walks, and walks that follow what those taught."""

from typing import NamedTuple

import numpy as np

from gaitchain.build.families import build_of
from gaitchain.build.gait_build import Candidates
from gaitchain.build.rollout import PhysicsCost
from gaitchain.build.workers import Crew, in_round
from gaitchain.chain.directed_walks import direct_walks
from gaitchain.chain.layered_chain import FloatArray, IntArray
from gaitchain.chain.sampling import draw_walks
from gaitchain.gait.build_config import BuildConfig

_ROUNDS = 3  # from the second on the walks are directed


class Samples(NamedTuple):
    """Gaits and their costs."""

    gaits: IntArray
    """(G, 4) pose indices."""
    costs: FloatArray
    """(G,) f of each gait."""
    falls: int
    """Number of walks that fell."""


def walk_gaits(
    config: BuildConfig,
    drawn: Candidates,
    rng: np.random.Generator,
    crew: Crew,
    *,
    directed: bool,
) -> Samples:
    """Draw walks and measure, or compute, the cost of their steps.

    Args:
        config: cost, and number and length of the walks.
        drawn: the candidates.
        rng: source of randomness.
        crew: processes and worlds.
        directed: whether two thirds of the walks take the way that the earlier ones
            leave open (`directed_walks`); not where the cost is planned.
    """
    poses = drawn.poses
    size = config.walks, config.steps_per_walk
    walks = draw_walks(drawn.edges, *size, rng, drawn.pairs)
    if config.cost == "planned":
        gaits = np.concatenate(walks)
        costs = build_of(poses).planned_cost(poses, drawn.timing, gaits)
        return Samples(gaits, costs, 0)
    seed = int(rng.integers(2**31))
    samples = Samples(np.empty((0, 4), np.int64), np.empty(0), 0)
    parts = np.array_split(np.arange(len(walks)), _ROUNDS if directed else 1)
    for number, part in enumerate(parts):
        chosen = [walks[i] for i in part]
        if number and chosen:
            chosen = direct_walks(chosen, drawn.edges, samples[:2], rng)
        found = _walked(drawn, chosen, crew, seed=seed + number, number=number)
        samples = _joined(samples, found)
    return samples


def _walked(
    drawn: Candidates, walks: list[IntArray], crew: Crew, *, seed: int, number: int
) -> Samples:
    """Walk a round in physics, each walk in its own world."""
    if not walks:
        return Samples(np.empty((0, 4), np.int64), np.empty(0), 0)
    source = PhysicsCost(
        drawn.poses,
        drawn.timing,
        worlds=crew.worlds,
        seed=seed,
        workers=crew.workers,
    )
    stage = in_round("training in physics", number)
    results = list(crew.track(stage, source.walk_all(walks), len(walks)))
    gaits, costs = np.concatenate(walks), np.concatenate([r.cost for r in results])
    known = ~np.isnan(costs)  # steps after a fall have no cost
    return Samples(gaits[known], costs[known], sum(r.fell for r in results))


def _joined(one: Samples, other: Samples) -> Samples:
    return Samples(
        np.concatenate([one.gaits, other.gaits]),
        np.concatenate([one.costs, other.costs]),
        one.falls + other.falls,
    )
