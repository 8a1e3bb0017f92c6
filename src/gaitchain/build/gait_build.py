"""The offline half of a gait's interface: what its library is built with.

The other halves are `gait.family` (numbers, files, schedules) and `walker.gait` (the
gait online).
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gaitchain.build.grid import Grid
from gaitchain.build.step_meter import StepTerms
from gaitchain.build.workers import Crew
from gaitchain.chain.layered_chain import IntArray
from gaitchain.chain.policy import Regret
from gaitchain.chain.sampling import Mask
from gaitchain.gait.build_config import BuildConfig
from gaitchain.gait.command_range import CommandRange
from gaitchain.gait.family import GaitPoses
from gaitchain.gait.motion import Timing
from gaitchain.messages import Array
from gaitchain.robot.robot import Robot
from gaitchain.sim.world import World
from gaitchain.sim.world_range import WorldRange


class Candidates(NamedTuple):
    """What can be walked at all."""

    poses: GaitPoses
    timing: Timing
    edges: tuple[Mask, ...]
    """Three masks (N_i, N_{i+1}) of edges that the robot can carry out."""
    pairs: Mask | None
    """(N_1, N_4) steps; None where edges say it all."""


class Draw(NamedTuple):
    """What candidates are drawn for."""

    config: BuildConfig
    robot: Robot
    poses: np.random.Generator
    """Source of randomness of the candidates."""
    search: np.random.Generator
    """The same of a search for how the robot steps best."""
    crew: Crew


class GaitBuild(ABC):
    """How the libraries of one family of gaits are built."""

    grid: ClassVar[Grid]
    """Worlds of its qualification."""

    @abstractmethod
    def draw(self, draw: Draw) -> Candidates:
        """Draw candidates and find out which of them go together.

        Raises:
            GaitchainError: preset and robot do not fit, or the preset makes no walk.
        """

    @abstractmethod
    def roll_out(
        self, poses: Any, timing: Timing, gaits: NDArray[np.int64], world: World
    ) -> StepTerms:
        """Walk linked gaits in physics and measure each step."""

    @abstractmethod
    def training_worlds(self, poses: Any, speed_limit: float | None) -> WorldRange:
        """Return the worlds that a library is trained and tested in.

        Args:
            poses: the candidates.
            speed_limit: of the servos; None is the robot's own [deg/s].
        """

    @abstractmethod
    def trial_worlds(self) -> tuple[WorldRange, Mapping[str, Any]]:
        """Return the worlds of a user's trials, and numbers that all of them share."""

    @abstractmethod
    def planned_cost(self, poses: Any, timing: Timing, gaits: IntArray) -> Array:
        """(G,) cost of gaits in [0, 1] by the plan alone.

        Raises:
            CommandError: the plan says nothing about the cost.
        """

    @abstractmethod
    def planned_regret(
        self, poses: Any, timing: Timing, edges: tuple[Mask, ...], seed: int
    ) -> Regret | None:
        """Measure the policies on the planned cost; None where there is none."""

    @abstractmethod
    def steady_ends(self, most: CommandRange) -> list[tuple[int, int]]:
        """Name the ends of the range that must walk on and on: axis, low or high."""
