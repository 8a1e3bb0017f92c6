"""The online gait generator: which key pose next, and why. No clock, no I/O.

At each kp_1 the command chooses the pose in which the step shall end; at every key
moment the chain chooses the next pose on the way there. All choices are worked out when
the generator is made, so deciding is looking up.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from gaitchain.balance.walk_controller import Step
from gaitchain.errors import CommandError, LibraryError
from gaitchain.gait.family import STAND
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.step_target import Landing
from gaitchain.messages import Command
from gaitchain.walker.policy_table import (
    Options,
    Policy,
    pair_costs,
    ranked_choices,
    safe_pairs,
)

LATE_STOP = 1e6
"""Cost of each step that a stop comes late: outweighs all else."""
Motion = tuple[float, float, float]
"""Of the robot's middle in a step: ahead, to the left [m], turn to the left [rad]."""


NONE: Motion = (0.0, 0.0, 0.0)
NOWHERE = Landing(0.0, 0.0, 0.0)


@dataclass(frozen=True)
class GaitState:
    """Where the walk is in the chain."""

    layer: int = 0
    """Key moment reached, 0 for kp_1."""
    pose: int = STAND
    first: int = STAND
    """The pose at which this step began."""
    target: int = STAND
    """The pose in which this step is to end."""
    left_support: bool = True
    asked: Motion = NONE
    """Motion that the command asks of this step."""
    owed: Motion = NONE
    """Motion that earlier steps were asked for and did not make."""
    landing: Landing = NOWHERE
    """Where a stride's foot shall land; key poses land where they are."""


@dataclass(frozen=True)
class Decision:
    """The next key pose and the reasons for it."""

    layer: int
    """Key moment of the chosen pose, 0 for kp_1; 0 also while standing still."""
    pose: int
    cost: float
    """Expected cost of going on through the chosen pose to the end of the step."""
    runners_up: tuple[tuple[int, float], ...]
    """(pose, cost) of the other candidates, cheapest first."""
    target: int
    """Pose in which the step is to end."""
    speed: float
    """Forward speed of this step, backward below 0: of a key pose as physics measured
    it, of a stride as it is planned [m/s]."""


class StepRequest(NamedTuple):
    """What is asked of a step that begins."""

    command: Command
    upcoming: Sequence[Command]
    """Commands of the steps after this one, as far as known."""
    made: Step | None
    """The step just made as the robot measured it, if it measures steps."""


class Generator(ABC):
    """Choose the next key pose of a qualified library for the command.

    The two families of gaits differ in how a command chooses the end of a step.
    """

    def __init__(self, library: GaitLibrary, policy: Policy = "look_ahead") -> None:
        """Work out all choices.

        Args:
            library: the gaits.
            policy: "greedy" weighs the next edge alone (the paper), "look_ahead" the
                whole way to the end of the step.

        Raises:
            LibraryError: physics passed no walk.
        """
        self.allowed, self._steps_to_stand = safe_pairs(library)
        if not self.allowed[STAND].any() or library.command_range.vx[1] <= 0.0:
            raise LibraryError(
                "the library holds no walk: physics passed no step from standing, or "
                "no steady one; build it with more walks or other candidates"
            )
        self.library = library
        self._choices = ranked_choices(library, policy)
        self._path_cost = np.where(self.allowed, pair_costs(library), np.inf)

    @abstractmethod
    def clamp(self, command: Command) -> tuple[Command, str]:
        """Bring a command into the library's range.

        Returns:
            The command that will be carried out, and a note if it is another one.
        """

    def stays(self, state: GaitState, command: Command) -> bool:
        """Whether a robot that stands has no step to make; never by default."""
        return False

    @abstractmethod
    def begin_step(self, state: GaitState, request: StepRequest) -> GaitState:
        """Choose where the step that begins now shall end.

        Args:
            state: at kp_1.
            request: what is asked of it.

        Returns:
            The state with `first`, `target` and what was asked and owed.
        """

    @abstractmethod
    def step_speed(self, state: GaitState) -> float:
        """Return the forward speed of a step [m/s]."""

    def advance(
        self,
        state: GaitState,
        command: Command,
        upcoming: Sequence[Command] = (),
        made: Step | None = None,
    ) -> tuple[GaitState, Decision]:
        """Decide on the next key pose.

        Args:
            state: the key moment and pose that the robot has reached.
            command: what is asked for; it counts from the next kp_1 on.
            upcoming: commands of the steps after this one, as far as known.
            made: at kp_1, the step just made as the robot measured it.

        Returns:
            The state after the move, and the decision.

        Raises:
            CommandError: the state is no pose of the library, or no way leads on.
        """
        self._check(state)
        if state.layer == 0:
            if self.stays(state, command):
                standing = Decision(0, STAND, 0.0, (), STAND, 0.0)
                return replace(state, target=STAND, asked=NONE, owed=NONE), standing
            state = self.begin_step(state, StepRequest(command, upcoming, made))
        (pose, cost), *others = self._options(state)
        speed = self.step_speed(state)
        decision = Decision(
            state.layer + 1, pose, cost, tuple(others), state.target, speed
        )
        if state.layer + 1 == len(self.library.chain.transitions):
            # kp_4 with the roles exchanged is kp_1 of the next step.
            left = not state.left_support
            return replace(state, layer=0, pose=pose, left_support=left), decision
        return replace(state, layer=state.layer + 1, pose=pose), decision

    def likely_next(self, state: GaitState) -> int:
        """Return the pose that the chain would take from a state inside a step."""
        return self._options(state)[0][0]

    def _options(self, state: GaitState) -> Options:
        options = self._choices[state.target][state.layer][state.pose]
        if not options:
            raise CommandError(
                f"no way leads from pose {state.pose} of layer {state.layer + 1} to "
                f"pose {state.target}; begin at layer 1"
            )
        return options

    def _check(self, state: GaitState) -> None:
        sizes = self.library.chain.layer_sizes
        inside = (
            0 <= state.layer < len(sizes) - 1
            and 0 <= state.pose < sizes[state.layer]
            and 0 <= state.target < sizes[-1]
        )
        if not inside:
            raise CommandError(
                f"pose {state.pose} of layer {state.layer + 1} on the way to pose "
                f"{state.target}: layers 1 to 4 have {sizes} poses"
            )
