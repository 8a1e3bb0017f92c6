"""Rollout of gaits in physics: cost, forward motion and fall of each step.

A *walk* is a sequence of linked gaits, (S, 4) pose indices: it starts from standing,
each step's kp_4 is the next step's kp_1, and it ends standing.
"""

from collections.abc import Iterator, Sequence
from dataclasses import astuple, dataclass, field

import numpy as np
from numpy.typing import NDArray

from gaitchain.build.families import build_of
from gaitchain.build.jobs import run_jobs
from gaitchain.errors import CommandError
from gaitchain.gait.family import STAND, GaitPoses
from gaitchain.gait.keypose.cost import Gaits, saturate
from gaitchain.gait.motion import Timing
from gaitchain.messages import Array
from gaitchain.sim.world import World
from gaitchain.sim.world_range import WorldRange

Walk = NDArray[np.int64]


@dataclass(frozen=True)
class Weights:
    """Weights of the terms of a measured step's cost; a term is 1 at its scale. Ours.

    A step with every term at its scale costs 0.63.
    """

    zmp: float = 1.0
    """Weight of the mean squared ZMP displacement; scale half a sole's length."""
    tracking: float = 0.25
    """Weight of the mean squared joint error; scale 3 deg."""
    effort: float = 0.25
    """Weight of the mean squared torque; scale half the torque limit."""
    slip: float = 0.5
    """Weight of the support foot's squared turn in single support; scale 15 deg."""


@dataclass(frozen=True, eq=False)
class WalkResult:
    """Measurements of one walk, step by step; NaN after a fall."""

    cost: Array
    """(S,) measured cost in [0, 1]; 1 where the robot fell."""
    advance: Array
    """(S,) forward motion of the base [m]."""
    error: Array
    """(S,) largest DCM error [m]."""
    slip: Array
    """(S,) turn of the support foot on the ground [rad]."""
    fell: bool
    pushed: bool
    """Whether there was a push."""


@dataclass(frozen=True, eq=False)
class PhysicsCost:
    """The cost of gaits measured in MuJoCo, each walk in its own world.

    It is called as `keypose.cost.PlannedCost` is, which plans the same. The world of
    the n-th walk depends only on the seed and n, not on the workers.
    """

    poses: GaitPoses
    timing: Timing
    weights: Weights = Weights()
    worlds: WorldRange = field(default_factory=WorldRange)
    seed: int = 0
    """Seed of the worlds."""
    workers: int = 1
    """Number of processes."""

    def __call__(self, gaits: Gaits) -> Array:
        """Measure the cost of gaits that are linked to walks.

        Args:
            gaits: (W, S, 4) pose indices, W walks of S steps.

        Returns:
            (W, S) costs in [0, 1]; 1 for the step that fell, NaN after it.

        Raises:
            CommandError: a walk is not linked, or does not begin and end standing.
        """
        return np.stack([result.cost for result in self.walk_all(list(gaits))])

    def walk_all(self, walks: Sequence[Walk]) -> Iterator[WalkResult]:
        """Walk each walk.

        Args:
            walks: the walks, (S, 4) pose indices each.

        Yields:
            One result per walk, in order.

        Raises:
            CommandError: a walk is not linked, or does not begin and end standing.
        """
        for walk in walks:
            _check_walk(walk)
        seeds = np.random.SeedSequence(self.seed).spawn(len(walks))
        jobs = [(self, walk, child) for walk, child in zip(walks, seeds, strict=True)]
        yield from run_jobs(_measure, jobs, WalkResult, self.workers, batch_size=4)

    def measure(self, walk: Walk, world: World) -> WalkResult:
        """Walk once in a given world."""
        roll_out = build_of(self.poses).roll_out
        made = roll_out(self.poses, self.timing, walk, world)
        weights = astuple(self.weights)
        cost = saturate(made.terms @ weights, sum(weights))
        if (end := made.fell_in) is not None:
            cost[end], cost[end + 1 :] = 1.0, np.nan
            for measured in (made.advance, made.error, made.slip):
                measured[end:] = np.nan
        fell, pushed = end is not None, bool(world.push)
        return WalkResult(cost, made.advance, made.error, made.slip, fell, pushed)


def _measure(
    source: PhysicsCost, walk: Walk, seed: np.random.SeedSequence
) -> WalkResult:
    return source.measure(walk, source.worlds.draw(np.random.default_rng(seed)))


def _check_walk(walk: Walk) -> None:
    linked = np.array_equal(walk[:-1, 3], walk[1:, 0])
    if not (linked and walk[0, 0] == STAND and walk[-1, 3] == STAND):
        raise CommandError(
            f"walk {walk.tolist()}: each step must start at the pose where the step "
            f"before it ended, the first and last at the standing pose {STAND}"
        )
