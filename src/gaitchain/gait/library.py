"""The gait library: key poses, chain, costs and verdicts of one robot."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property, partial
from importlib.metadata import version as package_version
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gaitchain.chain.layered_chain import FloatArray, IntArray, LayeredChain
from gaitchain.chain.policy import cost_to_go, look_ahead
from gaitchain.errors import LibraryError
from gaitchain.gait.keypose.key_poses import STAND, KeyPoses
from gaitchain.gait.motion import Timing
from gaitchain.gait.stride.strides import StridePoses
from gaitchain.robot.reduced_biped import Biped


@dataclass(frozen=True)
class CommandRange:
    """What a library can be asked for, least and most of each number alone.

    Together they share: the parts of the most that are asked for add up to 1 at most.
    """

    vx: tuple[float, float]
    """[m/s]"""
    vy: tuple[float, float] = (0.0, 0.0)
    """[m/s]"""
    yaw_rate: tuple[float, float] = (0.0, 0.0)
    """[rad/s]"""

    def within(self, other: "CommandRange") -> "CommandRange":
        """Return what both ranges allow."""
        return CommandRange(
            *(
                (max(own[0], limit[0]), min(own[1], limit[1]))
                for own, limit in zip(self.ends, other.ends, strict=True)
            )
        )

    @property
    def ends(self) -> tuple[tuple[float, float], ...]:
        """Least and most of vx, vy and yaw rate."""
        return self.vx, self.vy, self.yaw_rate


@dataclass(frozen=True, eq=False)
class GridVerdict:
    """What a grid of worlds says about each step (`qualify.qualify_grid`)."""

    runs: IntArray
    """(N_1, N_4) how often the step was walked in a world that is required."""
    passes: IntArray
    """(N_1, N_4) how often the robot kept standing."""
    forbidden: NDArray[np.bool_]
    """(N_1, N_4) steps that are taken out."""


@dataclass(frozen=True, eq=False)
class GaitLibrary:
    """Key poses, chain, costs and verdicts of one robot."""

    poses: KeyPoses | StridePoses
    timing: Timing
    chain: LayeredChain
    edge_costs: tuple[FloatArray, ...]
    """Expected cost of a gait through each edge, +inf where it must not be taken."""
    path_costs: tuple[FloatArray, ...]
    """The same, split to add up along a gait (`expectation.path_costs`)."""
    pair_advance: FloatArray
    """(N_1, N_4) measured forward motion of the step between two poses [m]."""
    pair_runs: IntArray
    """(N_1, N_4) how often physics walked the step."""
    pair_passes: IntArray
    """(N_1, N_4) how often the robot kept standing."""
    config: Mapping[str, Any]
    """The build's frozen config."""
    qualification: Mapping[str, Any]
    """What was tested in physics, and what passed."""
    version: str = field(default_factory=partial(package_version, "gaitchain"))
    """The package that built it."""
    grid: GridVerdict | None = None
    """None until the library is qualified on a grid of worlds."""
    steady: CommandRange | None = None
    """What walks on and on without a fall; None where nothing was tried."""

    @property
    def biped(self) -> Biped:
        """The robot that the library is for."""
        return self.poses.biped

    @property
    def qualified(self) -> bool:
        """Whether physics has passed the library as a whole."""
        return bool(self.qualification.get("passed", False))

    def as_built(self) -> "GaitLibrary":
        """Return the library without the verdict of a grid of worlds."""
        facts = dict(self.qualification)
        facts |= facts.pop("grid", {}).get("built", {})
        return replace(self, grid=None, qualification=facts)

    def judged(self, table: Mapping[str, Any], walks: bool) -> "GaitLibrary":
        """Return the library with what a grid says of it as a whole.

        Args:
            table: the figures; "passed" says whether the commands held.
            walks: whether the steps that are left make a walk.
        """
        built = self.as_built()
        out = np.argwhere(built.allowed_pairs & ~self.allowed_pairs).tolist()
        facts = {
            "passed": built.qualified and walks and bool(table["passed"]),
            "speed_mps": list(self.speed_range),
            "commands": asdict(self.command_range),
        }
        before = {name: built.qualification.get(name) for name in facts}
        grid = {**table, "passed": facts["passed"], "taken_out": out, "built": before}
        # As it comes back from a file.
        plain = json.loads(json.dumps({**built.qualification, **facts, "grid": grid}))
        return replace(self, qualification=plain)

    @cached_property
    def allowed_pairs(self) -> NDArray[np.bool_]:
        """(N_1, N_4) steps that the build never fell on and that no grid forbids."""
        passed = (self.pair_runs > 0) & (self.pair_passes == self.pair_runs)
        if self.grid is not None:
            passed &= ~self.grid.forbidden
        return np.asarray(passed, dtype=np.bool_)

    @cached_property
    def speed_range(self) -> tuple[float, float]:
        """Slowest and fastest walk that goes on and on: a cycle of two steps [m/s].

        A dynamic library walks as slowly as one likes.
        """
        if isinstance(self.poses, StridePoses):
            return 0.0, self.command_range.vx[1]
        allowed = self.allowed_pairs.copy()
        allowed[STAND], allowed[:, STAND] = False, False
        cycles = allowed & allowed.T
        if not cycles.any():
            return 0.0, 0.0
        two_steps = self.pair_advance + self.pair_advance.T
        speeds = two_steps[cycles] / (2.0 * self.timing.step)
        return float(speeds.min()), float(speeds.max())

    @property
    def key_poses(self) -> KeyPoses:
        """The poses of the paper's walk.

        Raises:
            LibraryError: the library is a dynamic one.
        """
        if isinstance(self.poses, KeyPoses):
            return self.poses
        raise LibraryError(
            "this library walks by strides; what was asked for needs the paper's key "
            "poses: build one with preset 'default'"
        )

    @property
    def speed_limit_deg_s(self) -> float | None:
        """Joint speed that it was built for; None is the robot's own [deg/s]."""
        limit = self.config.get("speed_limit_deg_s")
        return None if limit is None else float(limit)

    @property
    def dynamic(self) -> bool:
        """Whether it walks by strides, with balance, in any direction."""
        return isinstance(self.poses, StridePoses)

    @cached_property
    def command_range(self) -> CommandRange:
        """What the library can be asked for: cycles of two steps that physics passed.

        Sideways and around, one step of a cycle goes out and the other one follows.
        """
        if not isinstance(self.poses, StridePoses):
            return CommandRange(self.speed_range)
        allowed = self.allowed_pairs.copy()
        allowed[STAND], allowed[:, STAND] = False, False
        first, second = np.nonzero(allowed & allowed.T)
        length, outward, turn = self.poses.strides.T
        cycle = 2.0 * self.timing.step
        straight = (outward == 0.0) & (turn == 0.0)
        aside, around = (
            (length == 0.0) & (turn == 0.0),
            (length == 0.0) & (outward == 0),
        )
        span = CommandRange(
            _span(((length[first] + length[second]) / cycle), straight, first, second),
            _span(((outward[first] - outward[second]) / cycle), aside, first, second),
            _span(((turn[first] - turn[second]) / cycle), around, first, second),
        )
        return span if self.steady is None else span.within(self.steady)

    @cached_property
    def gait_of(self) -> IntArray:
        """(N_1, N_4, 4) the best gait between each pair of first and last pose."""
        return best_gaits(self.path_costs)


def _span(
    speeds: FloatArray, kind: NDArray[np.bool_], first: IntArray, second: IntArray
) -> tuple[float, float]:
    """Least and most speed of the cycles whose strides are all of a kind."""
    fitting = speeds[kind[first] & kind[second]]
    return (float(fitting.min()), float(fitting.max())) if fitting.size else (0.0, 0.0)


def best_gaits(path_costs: tuple[FloatArray, ...]) -> IntArray:
    """Find the cheapest gait between each first and last pose by looking ahead.

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
