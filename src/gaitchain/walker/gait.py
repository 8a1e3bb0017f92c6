"""The online interface of a gait: commands and sensors in, joint targets out."""

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, ClassVar, NamedTuple

import numpy as np

from gaitchain.balance.state import Attitude
from gaitchain.errors import CommandError
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.zmp import Support
from gaitchain.messages import (
    Array,
    Command,
    JointTargets,
    PanelMessage,
    Sensors,
)
from gaitchain.walker.generator import ChainState, Decision, Generator
from gaitchain.walker.place import ORIGIN, Place
from gaitchain.walker.policy_table import Policy

if TYPE_CHECKING:  # which is machine code, a gait's record is not
    from gaitchain.balance.feedforward import Effort


class EndedStep(NamedTuple):
    """What a step was off, measured by the walk itself."""

    first: int
    """Pose in which it began."""
    last: int
    """Pose in which it ended."""
    error: float
    """Largest DCM error [m]."""
    slip: float
    """Turn of the support foot on the ground [rad]."""


class Gait(ABC):
    """Base class of the gaits that a `Walker` runs, with one subclass per family.

    It holds the queue of commands, one for each coming step, and the state of the walk
    in the chain.
    """

    rest_s: ClassVar[float] = 0.0
    """Standing time before a walk, to estimate the vertical and the gyro bias [s]."""
    generator_kind: ClassVar[type[Generator]]
    generator: Generator
    """Selects the key poses."""
    joint_names: tuple[str, ...]
    """Joints of both legs, hip to ankle, the left leg first."""
    state: ChainState
    """State of the walk in the chain."""
    decision: Decision | None
    """Latest decision and its runners-up; None before the first."""
    steps: int
    """Number of steps begun since the last reset."""
    ended: EndedStep | None
    """The step before the latest; None at a start, and where nothing measures it."""

    def __init__(
        self,
        library: GaitLibrary,
        policy: Policy,
        *,
        feedback: bool,
        period_s: float,
    ) -> None:
        """Start in the standing pose, without a command.

        Args:
            library: the gaits.
            policy: selection rule of the chain, see `Generator`.
            feedback: whether to balance; otherwise the plan runs in open loop.
            period_s: control period [s].

        Raises:
            LibraryError: the library has no qualified walk, or is of the other family.
        """
        self.generator = self.generator_kind(library, policy)
        self.joint_names = library.robot.legs.joint_names
        self._prepare(library, feedback=feedback, period_s=period_s)
        self._changed = ""
        self._commands: deque[Command] = deque([Command()])
        self.reset()

    @abstractmethod
    def _prepare(
        self, library: GaitLibrary, *, feedback: bool, period_s: float
    ) -> None:
        """Set up what the family needs from the library; `reset` is called next."""

    def reset(self, at: Place = ORIGIN) -> None:
        """Return to the standing state before the first `step`; keep the commands.

        Args:
            at: where the robot stands, for a gait that measures it.
        """
        self.state, self.decision, self.ended = ChainState(), None, None
        self._panel: PanelMessage | None = None
        self._make_panel: Callable[[], PanelMessage] | None = None
        self.steps = 0
        self._in_use = False  # whether a step with the first command has begun

    def command(self, command: Command) -> Command:
        """Set the command for all steps from the next one on.

        Returns:
            The command after clamping; if it was changed, `note` gives the reason.
        """
        done, self._changed = self.generator.clamp(command)
        self._commands, self._in_use = deque([done]), False
        return done

    @property
    def commanded(self) -> Command:
        """The command in force, after clamping."""
        return self._commands[0]

    def follow(self, commands: Sequence[Command]) -> None:
        """Set one command for each coming step; the last one stays in force.

        A stop that is followed by another command is stood on for the time of a step.

        Raises:
            CommandError: `commands` is empty.
        """
        if not commands:
            raise CommandError("no command to follow; give Command(0.0) to stop")
        done, notes = zip(*map(self._clamp_step, commands), strict=True)
        self._commands, self._in_use = deque(done), False
        self._changed = "; ".join(dict.fromkeys(note for note in notes if note))

    def _clamp_step(self, command: Command) -> tuple[Command, str]:
        """Clamp a command for one step."""
        return self.generator.clamp(command)

    def _take_command(self) -> None:
        """Advance to the next command at the start of a step."""
        if self._in_use and len(self._commands) > 1:
            self._commands.popleft()
        self._in_use = True

    @property
    def panel(self) -> PanelMessage | None:
        """Primitive components of the next key pose."""
        if self._make_panel is not None:
            self._panel, self._make_panel = self._make_panel(), None
        return self._panel

    def _show(self, make: Callable[[], PanelMessage]) -> None:
        """Set the panel's message; it is built on first access and then kept."""
        self._make_panel = make

    @property
    def note(self) -> str:
        """Reason why the command was changed; empty if it was not."""
        return self._changed

    @property
    def effort(self) -> "Effort | None":
        """What the latest targets need of motors; None where they only have angles."""
        return None

    @abstractmethod
    def step(self, sensors: Sensors) -> JointTargets:
        """Compute the joint targets; call once per control period."""

    @property
    @abstractmethod
    def stand(self) -> Array:
        """(2 n,) joint angles of the standing pose [rad]."""

    @property
    def stand_targets(self) -> Array:
        """(2 n,) servo targets that keep the standing pose; its angles by default."""
        return self.stand

    @property
    @abstractmethod
    def standing(self) -> bool:
        """Whether the robot stands still."""

    @property
    def stepping(self) -> bool:
        """Whether a step is being made: neither the first shift nor coming to rest."""
        return not self.standing

    @property
    def settling(self) -> bool:
        """Whether it comes to rest on both feet, or was made to rock there."""
        return False

    @property
    @abstractmethod
    def support(self) -> Support:
        """Planned support region at the latest `step`; valid while walking."""

    @property
    @abstractmethod
    def estimate(self) -> Attitude | None:
        """Estimated orientation of the trunk; None if the gait does not estimate it."""

    @property
    def gyro_bias(self) -> Array:
        """(3,) that the estimate has found of the gyro [rad/s]."""
        return np.zeros(3)

    @property
    def place(self) -> Place | None:
        """Where the robot is by its own steps; None if the gait does not measure it."""
        return None

    @property
    def stop_place(self) -> Place | None:
        """Where it comes to stand if it is told to stop now; None likewise."""
        return None

    @property
    def feet(self) -> tuple[Place, Place] | None:
        """Left and right ankle, in the frame of `place`; None without one."""
        return None

    @property
    def footsteps_left(self) -> int:
        """Number of given footsteps that have not begun."""
        return 0

    @property
    @abstractmethod
    def planned_zmp(self) -> Array | None:
        """(2,) planned ZMP in the support-foot frame [m]; None if there is none."""
