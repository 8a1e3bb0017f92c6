"""The online gait generator: selects the next key pose. No clock, no I/O.

At each kp_1 the command determines the pose in which the step ends; at every key moment
the chain determines the next pose on the way there. All choices are computed when the
generator is created, so a decision is a table look-up.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from gaitchain.errors import CommandError, LibraryError
from gaitchain.gait.family import STAND
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.step_target import Landing, Step
from gaitchain.messages import Command
from gaitchain.walker.policy_table import (
    Options,
    Policy,
    pair_costs,
    ranked_choices,
    safe_pairs,
)

LATE_STOP = 1e6
"""Cost of each step by which a stop is delayed; larger than all other costs."""
Motion = tuple[float, float, float]
"""Motion of the point midway between the feet in one step: ahead [m], to the left [m],
turn to the left [rad]."""

NO_MOTION: Motion = (0.0, 0.0, 0.0)
BESIDE = Landing(0.0, 0.0, 0.0)


@dataclass(frozen=True)
class ChainState:
    """State of the walk in the chain."""

    layer: int = 0
    """Key moment reached, 0 for kp_1."""
    pose: int = STAND
    """Index of the pose in the layer."""
    first: int = STAND
    """Pose at which this step began."""
    target: int = STAND
    """Pose in which this step is to end."""
    left_support: bool = True
    """Whether the left leg is the support leg."""
    asked: Motion = NO_MOTION
    """Motion that the command requests of this step."""
    owed: Motion = NO_MOTION
    """Residual: motion requested of earlier steps that they did not make."""
    missed: Motion = NO_MOTION
    """What a stride ahead misses each time, per leg of its length; learned."""
    ends: tuple[tuple[int, float], ...] = ()
    """(pose, cost) in which the step may end; see `Decision.ends`."""
    expected: tuple[float, ...] = ()
    """Parts of these costs; see `Decision.expected`."""
    landing: Landing = BESIDE
    """Desired landing of the swing foot, for strides; a key pose contains its own."""


@dataclass(frozen=True)
class Decision:
    """The next key pose and the costs that led to it."""

    layer: int
    """Key moment of the chosen pose, 0 for kp_1; 0 also while standing still."""
    pose: int
    """Index of the chosen pose in its layer."""
    cost: float
    """Expected cost of the path through the chosen pose to the end of the step."""
    runners_up: tuple[tuple[int, float], ...]
    """(pose, cost) of the other candidates, cheapest first."""
    target: int
    """Pose in which the step is to end."""
    speed: float
    """Forward speed of this step, negative backward [m/s]: measured in physics for key
    poses, planned for strides."""
    sizes: tuple[tuple[float, float], ...] = ()
    """(part of the command range, expected cost to go) of the sizes that the step of a
    disturbed walk can have, the chosen one first; empty where nothing disturbs it."""
    ends: tuple[tuple[int, float], ...] = ()
    """(pose, cost) in which the step may end, the chosen one first: the expected cost,
    and the squared distance to what the command asks for. Empty where the command alone
    says how it ends."""
    expected: tuple[float, ...] = ()
    """Of the cost of each of `ends`, what walking there is expected to cost, from 0 to
    1 for each edge of the chain; the rest is how far it is off the command: 1 where it
    is off by 5 % of the leg, or by 0.1 rad."""


class StepRequest(NamedTuple):
    """Inputs for the choice of a step."""

    command: Command
    """Command of this step."""
    upcoming: Sequence[Command]
    """Commands of the steps after this one, as far as known."""
    made: Step | None
    """Measured motion of the step just made; None if it is not measured."""
    landing: Landing | None = None
    """Where the foot is to land, whatever the command; only strides can be told."""
    last: bool = False
    """Whether the robot is to stand after that landing."""


class Generator(ABC):
    """Select the next key pose of a qualified library for the command.

    Subclasses define how a command determines the end of a step.
    """

    def __init__(self, library: GaitLibrary, policy: Policy = "look_ahead") -> None:
        """Compute all choices.

        Args:
            library: the gaits.
            policy: "greedy" minimises the cost of the next edge (the paper),
                "look_ahead" the cost of the whole path to the end of the step.

        Raises:
            LibraryError: no walk passed physics.
        """
        self.allowed, self._steps_to_stand = safe_pairs(library)
        if not self.allowed[STAND].any() or library.command_range.vx[1] <= 0.0:
            raise LibraryError(
                "the library holds no walk: physics passed no step from standing, or "
                "no steady one; build it with more walks or other candidates"
            )
        self.library = library
        self._choices = ranked_choices(library, policy)
        self._sizes = library.chain.layer_sizes
        self._path_cost = np.where(self.allowed, pair_costs(library), np.inf)

    @abstractmethod
    def clamp(self, command: Command) -> tuple[Command, str]:
        """Clamp a command to the library's range.

        Returns:
            The clamped command, and a note if it differs.
        """

    def stays(self, state: ChainState, command: Command) -> bool:
        """Whether a standing robot makes no step; always False by default."""
        return False

    @abstractmethod
    def begin_step(self, state: ChainState, request: StepRequest) -> ChainState:
        """Choose the pose in which the step that begins now is to end.

        Args:
            state: at kp_1.
            request: commands, and the measured previous step.

        Returns:
            The state with `first`, `target`, `asked` and `owed` of the step.
        """

    @abstractmethod
    def step_speed(self, state: ChainState) -> float:
        """Return the forward speed of a step [m/s]."""

    def advance(
        self,
        state: ChainState,
        command: Command,
        upcoming: Sequence[Command] = (),
        made: Step | None = None,
        landing: Landing | None = None,
        *,
        last: bool = False,
    ) -> tuple[ChainState, Decision]:
        """Select the next key pose.

        Args:
            state: the key moment and pose that the robot has reached.
            command: takes effect at the next kp_1.
            upcoming: commands of the steps after this one, as far as known.
            made: at kp_1, the measured motion of the step just made.
            landing: where the foot is to land, in place of the command.
            last: whether the robot is to stand after that landing.

        Returns:
            The state after the transition, and the decision.

        Raises:
            CommandError: the state is not in the library, or has no successor.
        """
        self._check(state)
        if state.layer == 0:
            if self.stays(state, command):
                standing = Decision(0, STAND, 0.0, (), STAND, 0.0)
                rest = replace(state, target=STAND, asked=NO_MOTION, owed=NO_MOTION)
                return replace(rest, ends=(), expected=()), standing
            request = StepRequest(command, upcoming, made, landing, last)
            state = self.begin_step(state, request)
        (pose, cost), *others = self._options(state)
        speed = self.step_speed(state)
        decision = Decision(
            state.layer + 1,
            pose,
            cost,
            tuple(others),
            state.target,
            speed,
            ends=state.ends,
            expected=state.expected,
        )
        if state.layer + 1 == len(self._sizes) - 1:
            # kp_4 with the roles exchanged is kp_1 of the next step.
            left = not state.left_support
            return replace(state, layer=0, pose=pose, left_support=left), decision
        return replace(state, layer=state.layer + 1, pose=pose), decision

    def likely_next(self, state: ChainState) -> int:
        """Return the pose that would be chosen next from a state inside a step."""
        return self._options(state)[0][0]

    def _options(self, state: ChainState) -> Options:
        options = self._choices[state.target][state.layer][state.pose]
        if not options:
            raise CommandError(
                f"no way leads from pose {state.pose} of layer {state.layer + 1} to "
                f"pose {state.target}; begin at layer 1"
            )
        return options

    def _check(self, state: ChainState) -> None:
        sizes = self._sizes
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
