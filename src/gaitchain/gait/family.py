"""The offline interface that key poses and strides both implement.

Callers use the library's `family` and do not depend on which one it is. The parts of
the interface that need physics are in `build.gait_build`, the online part is in
`walker.gait`.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, ClassVar, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from gaitchain.gait.command_range import CommandRange
from gaitchain.gait.motion import Timing
from gaitchain.gait.schedule import Schedule
from gaitchain.messages import Array
from gaitchain.robot.robot import Robot

STAND = 0
"""Index of the standing pose in layers 1 and 4 of a closed set."""
LAYERS = 4
"""Key moments of a step: kp_1 to kp_4."""

Arrays = Mapping[str, NDArray[Any]]


class GaitPoses(Protocol):
    """The candidates of each key moment."""

    @property
    def robot(self) -> Robot:
        """The robot."""

    @property
    def parameters(self) -> tuple[Array, ...]:
        """Per layer (N_i, parameters of the layer)."""

    @property
    def closed(self) -> bool:
        """Whether layer 4 with the legs' roles exchanged is layer 1."""

    @property
    def counts(self) -> tuple[int, ...]:
        """Candidates per key moment."""

    @property
    def step_lengths(self) -> Array:
        """(N_4,) step length of each candidate of the last layer [m]."""

    def keep(self, kept: Sequence[NDArray[np.int64]]) -> Self:
        """Return the set of the candidates with these indices, per layer."""


class GaitFamily(ABC):
    """A family of gaits; its instances have no state."""

    name: ClassVar[str]
    """Name in messages and files."""
    presets: ClassVar[tuple[str, ...]]
    """Presets that draw its candidates."""
    balanced: ClassVar[bool]
    """Whether it is trained with feedback; otherwise robots of boxes in open loop."""
    counts_steps: ClassVar[bool]
    """Whether its schedules count steps, not seconds."""
    directed: ClassVar[bool]
    """Whether training walks follow what earlier ones taught, and costs are shrunk as
    much as the samples ask; otherwise walks are uniform, costs shrunk by one gait."""
    cover_walks: ClassVar[int]
    """Default number of walks that visit every pair of first and last pose."""
    recovery_walks: ClassVar[int]
    """Default number of disturbed walks from which it is learned how far to step after
    a disturbance; 0 for a gait that does not choose that."""

    @abstractmethod
    def columns(self) -> tuple[tuple[str, ...], ...]:
        """Return the names of the parameters of each layer."""

    @abstractmethod
    def stored(self, poses: Any) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
        """Split candidates into values of a file's header, and named arrays."""

    @abstractmethod
    def restored(self, robot: Robot, facts: Mapping[str, Any], arrays: Arrays) -> Any:
        """Assemble candidates from the result of `stored`.

        Raises:
            ValueError: header and arrays are inconsistent.
        """

    @abstractmethod
    def command_range(
        self,
        poses: Any,
        cycles: NDArray[np.bool_],
        advance: Array,
        step_s: float,
    ) -> CommandRange:
        """Return the range of commands of the cycles of two steps that can repeat.

        Args:
            poses: the candidates.
            cycles: (N_1, N_4) mask of steps that form a cycle with their reverse,
                without those that begin or end standing.
            advance: (N_1, N_4) measured forward motion of each step [m].
            step_s: time of a step [s].
        """

    @abstractmethod
    def random_schedule(
        self, rng: np.random.Generator, most: CommandRange, seconds: float
    ) -> Schedule:
        """Draw a schedule over the whole range of commands.

        Args:
            rng: source of randomness.
            most: the library's range.
            seconds: length of a schedule that counts time [s].
        """

    @abstractmethod
    def courses(self, most: CommandRange) -> Iterator[tuple[str, Schedule]]:
        """Yield the schedules of a qualification as (group of commands, schedule)."""

    @abstractmethod
    def demonstration(self, most: CommandRange) -> Schedule:
        """Return a schedule that demonstrates the range of commands."""

    @abstractmethod
    def describe(
        self, poses: Any, timing: Timing, gaits: NDArray[np.int64]
    ) -> list[tuple[str, str]]:
        """Describe the steps for a person, as (quantity, value with unit) rows.

        Args:
            poses: the candidates.
            timing: the step's times.
            gaits: (G, 4) pose indices of the qualified gaits.
        """
