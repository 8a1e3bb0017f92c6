"""Draws of Table I with gaits sampled from it: what Fig. 6, 7 and the regret share."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gaitchain.chain.expectation import (
    EdgeStatistics,
    expected_costs,
    path_costs,
    pose_costs,
)
from gaitchain.chain.layered_chain import FloatArray, IntArray, LayeredChain, draw_gaits
from gaitchain.chain.training import train_sequential
from gaitchain.errors import CommandError
from gaitchain.gait.keypose.cost import PlannedCost
from gaitchain.gait.keypose.presets import draw_candidates
from gaitchain.gait.motion import Timing
from gaitchain.robot.reduced_biped import load_biped


@dataclass(frozen=True, eq=False)
class Draw:
    """One draw of Table I for the built-in robot, and gaits drawn uniformly from it."""

    cost: PlannedCost
    """Eq. 3 alone, without the landing impact."""
    gaits: IntArray
    """(N_r, 4) pose indices."""
    f: FloatArray
    """(N_r,) their cost."""

    @classmethod
    def of_seed(cls, seed: int, samples: int) -> Draw:
        """Draw candidates, then gaits, from one generator."""
        rng = np.random.default_rng(seed)
        poses = draw_candidates(load_biped("res"), "table1", rng)
        cost = PlannedCost(poses, Timing(), impact_weight=0.0)
        gaits = draw_gaits(poses.counts, samples, rng)
        return cls(cost, gaits, cost(gaits))

    @property
    def counts(self) -> tuple[int, ...]:
        """Candidates per key moment."""
        return self.cost.poses.counts

    def learn(self, samples: int) -> EdgeStatistics:
        """Learn the edge costs from the first samples."""
        return expected_costs(self.counts, self.gaits[:samples], self.f[:samples])

    def ahead(self, samples: int) -> tuple[FloatArray, ...]:
        """Learn the costs that add up along a gait from the first samples."""
        return path_costs(self.counts, self.gaits[:samples], self.f[:samples])

    def train(self, samples: int) -> tuple[LayeredChain, tuple[FloatArray, ...]]:
        """Train an open chain on the first samples; return it and the pose costs."""
        blank = LayeredChain.uniform(self.counts, cyclic=False)
        chain = train_sequential(blank, self.gaits[:samples], self.f[:samples])
        return chain, pose_costs(self.learn(samples))


def draws(seeds: int, samples: int) -> list[Draw]:
    """Draw seeds 0, 1, ...

    Raises:
        CommandError: no seed or no sample is asked for.
    """
    if seeds < 1 or samples < 1:
        raise CommandError(f"{seeds} seeds, {samples} samples: need 1 or more of each")
    return [Draw.of_seed(seed, samples) for seed in range(seeds)]
