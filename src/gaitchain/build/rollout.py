"""Gaits walked in physics: what each step cost, how far it went, whether it fell.

A *walk* is a chain of linked gaits, (S, 4) pose indices: it starts from standing, each
step's kp_4 is the next step's kp_1, and it ends standing. Key poses of the paper's kind
are driven open loop, strides with balance (`stride_physics`).
"""

from collections.abc import Iterator, Sequence
from dataclasses import astuple, dataclass, field

import numpy as np
from numpy.typing import NDArray

from gaitchain.backends.mujoco import CONTROL_PERIOD_S, MujocoBackend
from gaitchain.build.jobs import run_jobs
from gaitchain.build.stride_rollout import walk_strides
from gaitchain.errors import CommandError
from gaitchain.gait.keypose.cost import Gaits, saturate
from gaitchain.gait.keypose.key_poses import STAND, KeyPoses
from gaitchain.gait.motion import StepMotion, Timing
from gaitchain.gait.stride.strides import StridePoses
from gaitchain.messages import Array
from gaitchain.robot.joint_angles import joint_angles
from gaitchain.sim.world import World
from gaitchain.sim.world_range import WorldRange

Walk = NDArray[np.int64]
_BEFORE_S, _AFTER_S = 0.5, 1.0  # standing still before and after the steps


@dataclass(frozen=True)
class Weights:
    """What a measured step's cost is made of, each term 1 at its scale. Ours.

    A step with every term at its scale costs 0.63.
    """

    zmp: float = 1.0
    """Mean squared ZMP displacement, scale half a sole's length."""
    tracking: float = 0.25
    """Mean squared joint error, scale 3 deg."""
    effort: float = 0.25
    """Mean squared torque, scale half the torque limit."""
    slip: float = 0.5
    """Squared turn of the support foot while it carries alone, scale 15 deg."""


@dataclass(frozen=True, eq=False)
class WalkResult:
    """What physics says about one walk, step by step; NaN after a fall."""

    cost: Array
    """(S,) measured cost in [0, 1]; 1 where the robot fell."""
    advance: Array
    """(S,) forward motion of the base [m]."""
    fell: bool


@dataclass(frozen=True, eq=False)
class PhysicsCost:
    """The cost of gaits measured in MuJoCo, each walk in a world of its own.

    A `CostSource`, as `cost.PlannedCost` is. The n-th walk's world depends on the seed
    and n alone, not on the workers.
    """

    poses: KeyPoses | StridePoses
    timing: Timing
    weights: Weights = Weights()
    worlds: WorldRange = field(default_factory=WorldRange)
    seed: int = 0
    """Of the worlds."""
    workers: int = 1
    """Processes."""

    def __call__(self, gaits: Gaits) -> Array:
        """Cost of gaits linked into walks.

        Args:
            gaits: (W, S, 4) pose indices, W walks of S steps.

        Returns:
            (W, S) costs in [0, 1]; 1 for the step that fell, NaN after it.

        Raises:
            CommandError: a walk is not linked, or does not begin and end standing.
        """
        return np.stack([result.cost for result in self.walk_all(list(gaits))])

    def walk_all(self, walks: Sequence[Walk]) -> Iterator[WalkResult]:
        """Walk each walk; results come in order.

        Args:
            walks: the walks, (S, 4) pose indices each.

        Yields:
            One result per walk.

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
        if isinstance(self.poses, StridePoses):
            return self._measure_strides(self.poses, walk, world)
        backend = MujocoBackend(self.poses.biped, world)
        targets = walk_targets(self.poses, self.timing, walk)
        backend.connect(targets[0])
        log = _StepLog(self, walk)
        before = round(_BEFORE_S / CONTROL_PERIOD_S)
        for tick, target in enumerate(targets, start=-before):
            log.add(tick, target, backend)
            backend.write(target)
            if backend.fallen:
                return log.result(fell_at=tick)
        return log.result(fell_at=None, end_x=float(backend.data.qpos[0]))

    def _measure_strides(
        self, poses: StridePoses, walk: Walk, world: World
    ) -> WalkResult:
        terms, advance, fell_in = walk_strides(poses, self.timing, walk, world)
        weights = astuple(self.weights)
        cost = saturate(terms @ weights, sum(weights))
        if fell_in is not None:
            cost[fell_in], cost[fell_in + 1 :] = 1.0, np.nan
            advance[fell_in:] = np.nan
        return WalkResult(cost, advance, fell_in is not None)


def walk_targets(poses: KeyPoses, timing: Timing, walk: Walk) -> Array:
    """Return the servo targets of a walk, standing before and after it.

    Args:
        poses: the candidates.
        timing: the step's times.
        walk: (S, 4) pose indices; the left leg supports first.

    Returns:
        (N, 12) joint angles, one row per control period [rad].
    """
    ticks = round(timing.step / CONTROL_PERIOD_S)
    time_s: Array = np.arange(ticks, dtype=np.float64) * CONTROL_PERIOD_S
    parts = []
    for step, gait in enumerate(walk):
        q = np.stack([poses.q[layer][n] for layer, n in enumerate(gait)])
        dq = np.stack([poses.dq[layer][n] for layer, n in enumerate(gait)])
        q_t = StepMotion(timing.key_times, q, dq).at(time_s).q
        parts.append(joint_angles(q_t, left_support=step % 2 == 0))
    stand = joint_angles(poses.q[0][STAND], left_support=True)
    before = np.tile(stand, (round(_BEFORE_S / CONTROL_PERIOD_S), 1))
    after = np.tile(stand, (round(_AFTER_S / CONTROL_PERIOD_S), 1))
    return np.concatenate([before, *parts, after])


class _StepLog:
    """Sums of the cost terms of each step, filled tick by tick."""

    def __init__(self, source: PhysicsCost, walk: Walk) -> None:
        self._source = source
        self._steps = len(walk)
        self._ticks = round(source.timing.step / CONTROL_PERIOD_S)
        single = source.timing.rise + source.timing.fall
        self._single = round(single / CONTROL_PERIOD_S)
        self._sums = np.zeros((self._steps, 4))
        self._yaw_before = 0.0
        self._start_x = np.full(self._steps + 1, np.nan)

    def add(self, tick: int, target: Array, backend: MujocoBackend) -> None:
        step, phase = divmod(tick, self._ticks)
        if tick < 0 or step >= self._steps:
            return
        if phase == 0:
            self._start_x[step] = backend.data.qpos[0]
            self._yaw_before = backend.foot_yaws()[step % 2]
        if phase == self._single:
            turn = backend.foot_yaws()[step % 2] - self._yaw_before
            self._sums[step, 3] = (turn / np.radians(15.0)) ** 2
        biped = self._source.poses.biped
        limit = biped.joint_torque_limit
        error = backend.data.qpos[7:] - target
        self._sums[step, 1] += np.mean(error**2) / np.radians(3.0) ** 2
        self._sums[step, 2] += (
            np.mean(backend.data.actuator_force**2) / (limit / 2) ** 2
        )
        if phase < self._single:
            sole = backend.foot_positions()[step % 2, :2] + [biped.sole_offset, 0.0]
            off = np.sum((backend.zmp() - sole) ** 2) / (0.5 * biped.sole_length) ** 2
            # No ground contact is as bad as a ZMP a whole sole away.
            self._sums[step, 0] += 4.0 if np.isnan(off) else off

    def result(self, fell_at: int | None, end_x: float = np.nan) -> WalkResult:
        weights = self._source.weights
        means = self._sums / [self._single, self._ticks, self._ticks, 1]
        cost = saturate(means @ astuple(weights), sum(astuple(weights)))
        self._start_x[-1] = end_x
        advance = np.diff(self._start_x)
        if fell_at is not None:
            step = min(max(fell_at // self._ticks, 0), self._steps - 1)
            cost[step], cost[step + 1 :], advance[step:] = 1.0, np.nan, np.nan
        return WalkResult(cost, advance, fell_at is not None)


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
