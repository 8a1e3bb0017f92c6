"""The interface of a gait: what key poses and strides both offer to everybody else.

Nobody asks which kind a library is of; whoever needs something that differs asks its
family. What needs physics or drawing is in `build.family`, what moves the joints in
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
        """(N_4,) step length that each candidate of the last layer ends with [m]."""

    def keep(self, kept: Sequence[NDArray[np.int64]]) -> Self:
        """Return the set without the candidates that pruning dropped."""


class GaitFamily(ABC):
    """A kind of gait; its members have no state."""

    name: ClassVar[str]
    """As messages and files have it."""
    presets: ClassVar[tuple[str, ...]]
    """Recipes that draw its candidates."""
    balanced: ClassVar[bool]
    """Whether it is trained and qualified with feedback; else open loop."""
    counts_steps: ClassVar[bool]
    """Whether its schedules count steps, not seconds."""
    epsilon: ClassVar[float]
    """Least pose inner distance of Eq. 2 by default."""
    cover_walks: ClassVar[int]
    """Walks that visit every pair of first and last pose by default."""

    @abstractmethod
    def columns(self) -> tuple[tuple[str, ...], ...]:
        """Name the parameters of each layer."""

    @abstractmethod
    def stored(self, poses: Any) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
        """Take candidates apart into facts of a file's header, and arrays."""

    @abstractmethod
    def restored(self, robot: Robot, facts: Mapping[str, Any], arrays: Arrays) -> Any:
        """Put candidates together from what `stored` gave.

        Raises:
            ValueError: they do not fit together.
        """

    @abstractmethod
    def command_range(
        self,
        poses: Any,
        cycles: NDArray[np.bool_],
        advance: Array,
        step_s: float,
    ) -> CommandRange:
        """Return what can be asked for: cycles of two steps that go on and on.

        Args:
            poses: the candidates.
            cycles: (N_1, N_4) pairs of steps that follow each other in turn, without
                those that begin or end standing.
            advance: (N_1, N_4) measured forward motion of each step [m].
            step_s: time of a step [s].
        """

    @abstractmethod
    def random_schedule(
        self, rng: np.random.Generator, most: CommandRange, seconds: float
    ) -> Schedule:
        """Draw a walk over all that a library can do."""

    @abstractmethod
    def courses(self, most: CommandRange) -> Iterator[tuple[str, Schedule]]:
        """Go through groups of commands that a qualification walks: (group, walk)."""

    @abstractmethod
    def demonstration(self, most: CommandRange) -> Schedule:
        """Return a walk that shows what a library can do."""

    @abstractmethod
    def describe(
        self, poses: Any, timing: Timing, gaits: NDArray[np.int64]
    ) -> list[tuple[str, str]]:
        """Say how it steps: (what, how much).

        Args:
            poses: the candidates.
            timing: the step's times.
            gaits: (G, 4) pose indices of those that hold.
        """

    @abstractmethod
    def bold(self, poses: Any) -> Any:
        """Return the candidates of a robot that no disturbance slows down.

        A robot that slows down stands any command, by doing less than is to be tested.
        """
