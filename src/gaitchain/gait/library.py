"""The gait library: key poses, chain, costs and verdicts of one robot."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

import gaitchain
from gaitchain.chain.layered_chain import FloatArray, IntArray, LayeredChain
from gaitchain.chain.policy import cost_to_go, look_ahead
from gaitchain.chain.recovery import Recovery
from gaitchain.errors import LibraryError
from gaitchain.gait.build_config import BuildConfig
from gaitchain.gait.command_range import CommandRange, ends_text, inward
from gaitchain.gait.families import family_of, family_of_kind
from gaitchain.gait.family import STAND, GaitFamily, GaitPoses
from gaitchain.gait.motion import Timing
from gaitchain.gait.qualification import (
    GridReport,
    GridVerdict,
    ProofReport,
    Qualification,
)
from gaitchain.gait.slide import Slides
from gaitchain.robot.robot import Robot

PosesT = TypeVar("PosesT", bound=GaitPoses)


@dataclass(frozen=True, eq=False)
class GaitLibrary:
    """Key poses, chain, costs and verdicts of one robot."""

    poses: GaitPoses
    """Candidates of one family."""
    timing: Timing
    """Times of a step."""
    chain: LayeredChain
    """The trained and pruned chain."""
    edge_costs: tuple[FloatArray, ...]
    """Expected cost of a gait through each edge; +inf forbids the edge."""
    path_costs: tuple[FloatArray, ...]
    """Costs per edge that add up along a gait (`expectation.path_costs`)."""
    pair_advance: FloatArray
    """(N_1, N_4) measured forward motion of the step between two poses [m]."""
    pair_error: FloatArray
    """(N_1, N_4) usual largest DCM error of the step, 0 if nothing measures it [m]."""
    pair_slip: FloatArray
    """(N_1, N_4) usual turn of its support foot on the ground, likewise [rad]."""
    pair_runs: IntArray
    """(N_1, N_4) how often the step was walked in physics."""
    pair_passes: IntArray
    """(N_1, N_4) how often the robot did not fall in it."""
    config: BuildConfig
    """Configuration of the build."""
    qualification: Qualification = field(default_factory=Qualification)
    """Tests in physics and their results."""
    version: str = field(default_factory=lambda: str(gaitchain.__version__))
    """Version of the package that built it."""
    grid: GridVerdict | None = None
    """Verdicts of a grid of worlds on each step; None before that qualification."""
    steady: CommandRange | None = None
    """Commands that were held for long without a fall; None if this was not tested."""
    usual_off: float = 0.0
    """How far a step of a robot with the faults of training is off its plan, beyond the
    usual of a sound one: 95th percentile [legs]; the larger of DCM error and slip, see
    `chain.recovery`."""
    usual_spread: float = 0.0
    """The same beyond what that robot's own steps are off: 90th percentile [legs]."""
    slides: Slides = field(default_factory=Slides)
    """What feet usually slide, beside what the legs measure."""
    recovery: Recovery | None = None
    """How far to step after a disturbance; None if that was not learned."""

    @classmethod
    def untested(
        cls,
        poses: GaitPoses,
        timing: Timing,
        chain: LayeredChain,
        costs: tuple[Sequence[FloatArray], Sequence[FloatArray]],
        config: BuildConfig,
    ) -> "GaitLibrary":
        """Return a library without any test in physics.

        Args:
            poses: the candidates that were kept.
            timing: the step's times.
            chain: the trained and pruned chain.
            costs: `edge_costs` and `path_costs`.
            config: configuration of the build.
        """
        pairs = poses.counts[0], poses.counts[-1]
        return cls(
            poses=poses,
            timing=timing,
            chain=chain,
            edge_costs=tuple(costs[0]),
            path_costs=tuple(costs[1]),
            pair_advance=np.zeros(pairs),
            pair_error=np.zeros(pairs),
            pair_slip=np.zeros(pairs),
            pair_runs=np.zeros(pairs, dtype=np.int64),
            pair_passes=np.zeros(pairs, dtype=np.int64),
            config=config,
        )

    @property
    def family(self) -> GaitFamily:
        """Family of the candidates."""
        return family_of(self.poses)

    @property
    def robot(self) -> Robot:
        """The robot that the library is for."""
        return self.poses.robot

    @property
    def qualified(self) -> bool:
        """Whether the library as a whole passed physics."""
        return self.qualification.passed

    def poses_as(self, kind: type[PosesT]) -> PosesT:
        """Return the candidates, typed as those of one family.

        Raises:
            LibraryError: the library is of the other family.
        """
        if isinstance(self.poses, kind):
            return self.poses
        needed = family_of_kind(kind)
        raise LibraryError(
            f"this library walks by {self.family.name}; what was asked for needs "
            f"{needed.name}: build one with preset {needed.presets[0]!r}"
        )

    def as_built(self) -> "GaitLibrary":
        """Return the library without the verdict of a grid of worlds, or a proof."""
        plain = replace(self.qualification, grid=None, proof=None)
        return replace(self, grid=None, qualification=plain)

    def judged(self, report: GridReport) -> "GaitLibrary":
        """Return the library with the report of a grid of worlds, without a proof."""
        tests = replace(self.qualification, grid=report, proof=None)
        return replace(self, qualification=tests)

    def proven(self, report: ProofReport | None) -> "GaitLibrary":
        """Return the library with the report of a proof, or without one."""
        return replace(self, qualification=replace(self.qualification, proof=report))

    @cached_property
    def allowed_pairs(self) -> NDArray[np.bool_]:
        """(N_1, N_4) steps that never fell in the build and that no grid forbids."""
        passed = (self.pair_runs > 0) & (self.pair_passes == self.pair_runs)
        if self.grid is not None:
            passed &= ~self.grid.forbidden
        return np.asarray(passed, dtype=np.bool_)

    @cached_property
    def command_range(self) -> CommandRange:
        """Range of commands, from the cycles of two steps that passed physics.

        Its lower end is the slowest steady walk for key poses; strides can be
        arbitrarily slow.
        """
        allowed = self.allowed_pairs.copy()
        allowed[STAND], allowed[:, STAND] = False, False
        cycles = np.asarray(allowed & allowed.T)
        span = self.family.command_range(
            self.poses, cycles, self.pair_advance, self.timing.step
        )
        return span if self.steady is None else span.within(self.steady)

    @property
    def speed_range(self) -> tuple[float, float]:
        """Slowest and fastest steady walk ahead [m/s]."""
        low, high = self.command_range.vx
        return max(low, 0.0), high

    def describe(self) -> list[tuple[str, str]]:
        """Describe steps and speeds for a person, as (quantity, value with unit)."""
        span, gaits = self.command_range, self.gait_of[self.allowed_pairs]
        low, high = self.speed_range
        gain = self.robot.servo_gain
        rows = [
            *([] if gain == 1.0 else [("servo gains", f"{gain:g} of the file's")]),
            ("step", f"T = {self.timing.step:.3g} s"),
            *self.family.describe(self.poses, self.timing, gaits),
            ("speed ahead", ends_text(low, high, "m/s")),
        ]
        deepest, fast = map(inward, span.crouch)
        other = [
            ("backward", _up_to(-span.vx[0], "m/s")),
            ("sideways", _either_way(span.vy, "m/s")),
            ("turning", _either_way(span.yaw_rate, "rad/s")),
            ("crouch", f"{deepest:.3f} m, at full speed {fast:.3f} m lower"),
        ]
        rows += other if any(map(any, span.ends[1:])) else []
        return rows if self.recovery is None else [*rows, self.recovery.describe()]

    @cached_property
    def gait_of(self) -> IntArray:
        """(N_1, N_4, 4) cheapest gait between each pair of first and last pose."""
        return best_gaits(self.path_costs)


def _up_to(end: float, unit: str) -> str:
    return f"to {inward(end):.3f} {unit}" if end else "not at all, as no such walk held"


def _either_way(ends: tuple[float, float], unit: str) -> str:
    right, left = (_up_to(end, unit) for end in (-ends[0], ends[1]))
    return left if left == right else f"{left} to the left, {right} to the right"


def best_gaits(path_costs: tuple[FloatArray, ...]) -> IntArray:
    """Find the cheapest gait between each pair of first and last pose.

    Args:
        path_costs: three matrices (N_i, N_{i+1}), +inf forbids an edge.

    Returns:
        (N_1, N_4, 4) pose indices; -1 throughout where no path is allowed.
    """
    firsts, lasts = path_costs[0].shape[0], path_costs[-1].shape[1]
    result = np.full((firsts, lasts, 4), -1, dtype=np.int64)
    for last in range(lasts):
        end = np.full(lasts, np.inf)
        end[last] = 0.0
        joined = np.flatnonzero(np.isfinite(cost_to_go(path_costs, end)[0]))
        if joined.size:
            result[joined, last] = look_ahead(path_costs, joined, [last])
    return result
