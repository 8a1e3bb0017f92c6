"""The build part of a gait's interface, which needs physics.

The other parts are `gait.family` (numbers, files, schedules) and `walker.gait` (the
gait online).
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from functools import partial
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
    """Candidate poses, and which motions between them are feasible."""

    poses: GaitPoses
    """The candidates."""
    timing: Timing
    """Times of a step."""
    edges: tuple[Mask, ...]
    """Three masks (N_i, N_{i+1}) of feasible edges."""
    pairs: Mask | None
    """(N_1, N_4) feasible steps; None if only the edges decide."""


class Draw(NamedTuple):
    """Inputs for drawing candidates."""

    config: BuildConfig
    """Configuration of the build."""
    robot: Robot
    """The robot."""
    poses: np.random.Generator
    """Source of randomness for the candidates."""
    search: np.random.Generator
    """Source of randomness for the search of the step's shape."""
    crew: Crew
    """Processes for the physics."""


Drawing = Callable[[], Candidates]
"""Draws a set of candidates; raises as `GaitBuild.draw` does."""


class GaitBuild(ABC):
    """Base class of the build part of a family of gaits."""

    grid: ClassVar[Grid]
    """Grid of worlds of a qualification."""

    @abstractmethod
    def draw(self, draw: Draw) -> Candidates:
        """Draw candidates and find the feasible motions between them.

        Raises:
            GaitchainError: preset and robot do not fit, or no walk is feasible.
        """

    def drawings(self, draw: Draw) -> list[Drawing]:
        """Return what draws the candidates, then others for where those do not walk.

        Raises:
            GaitchainError: see `draw`.
        """
        return [partial(self.draw, draw)]

    @abstractmethod
    def roll_out(
        self, poses: Any, timing: Timing, gaits: NDArray[np.int64], world: World
    ) -> StepTerms:
        """Walk linked gaits in physics and measure each step.

        Args:
            poses: the candidates.
            timing: the step's times.
            gaits: (S, 4) pose indices, from standing to standing; the left leg
                supports first.
            world: the disturbances.
        """

    @abstractmethod
    def training_worlds(self, poses: Any, speed_limit: float | None) -> WorldRange:
        """Return the range of worlds in which a library is trained and tested.

        Args:
            poses: the candidates.
            speed_limit: speed limit of the servos [deg/s]; None for the robot's.
        """

    @abstractmethod
    def trial_worlds(self) -> tuple[WorldRange, Mapping[str, Any]]:
        """Return the range of worlds of a user's trials, and fields they all share."""

    @abstractmethod
    def planned_cost(self, poses: Any, timing: Timing, gaits: IntArray) -> Array:
        """Compute the cost of gaits from the plan alone, (G,) in [0, 1].

        Raises:
            CommandError: the family has no planned cost.
        """

    @abstractmethod
    def planned_regret(
        self, poses: Any, timing: Timing, edges: tuple[Mask, ...], seed: int
    ) -> Regret | None:
        """Compute the policies' regret on the planned cost; None if it is unknown."""

    @abstractmethod
    def steady_ends(self, most: CommandRange) -> list[tuple[int, int]]:
        """Return the ends of the range to test for long: (axis, 0 low or 1 high)."""
