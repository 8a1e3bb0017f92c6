"""The interface of a gait online: commands in, joint targets out, and what it shows."""

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Sequence
from functools import cache
from typing import ClassVar

from gaitchain.balance.state import Attitude
from gaitchain.errors import CommandError
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.zmp import Support
from gaitchain.messages import (
    CONTROL_PERIOD_S,
    Array,
    Command,
    JointTargets,
    PanelMessage,
    Sensors,
)
from gaitchain.walker.generator import Decision, GaitState, Generator
from gaitchain.walker.policy_table import Policy


class Gait(ABC):
    """A gait that a `Walker` drives; both families of gaits are one.

    It keeps the commands, one for each of the coming steps, and where the walk is in
    the chain.
    """

    rest_s: ClassVar[float] = 0.0
    """How long it stands before it walks, to learn what upright is [s]."""
    generator_kind: ClassVar[type[Generator]]
    generator: Generator
    """What chooses the key poses."""
    joint_names: tuple[str, ...]
    """Of both legs, hip to ankle, the left leg first."""
    state: GaitState
    """Where the walk is in the chain."""
    decision: Decision | None
    """The latest decision and its runners-up."""
    steps: int
    """Steps begun so far."""

    def __init__(
        self,
        library: GaitLibrary,
        policy: Policy = "look_ahead",
        *,
        feedback: bool = True,
        period_s: float = CONTROL_PERIOD_S,
    ) -> None:
        """Stand, with nothing commanded.

        Args:
            library: the gaits.
            policy: how the chain chooses, see `Generator`.
            feedback: whether to balance; else the plan alone is walked.
            period_s: control period [s].

        Raises:
            LibraryError: the library holds no walk, or one of the other family.
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
        """Take what the family needs of the library; `reset` comes next."""

    def reset(self) -> None:
        """Stand again, as before the first `step`; the commands stay."""
        self.state, self.decision = GaitState(), None
        self._panel: Callable[[], PanelMessage] | None = None
        self.steps = 0
        self._in_use = False  # whether a step with the first command has begun

    def command(self, command: Command) -> Command:
        """Ask for a motion from the next step on.

        Returns:
            The command that will be carried out; `note` says why if it is another.
        """
        done, self._changed = self.generator.clamp(command)
        self._commands, self._in_use = deque([done]), False
        return done

    def follow(self, commands: Sequence[Command]) -> None:
        """Ask for a motion for each of the coming steps; the last one stays.

        Raises:
            CommandError: there is no command.
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
        """Go on to the next command, as a step begins."""
        if self._in_use and len(self._commands) > 1:
            self._commands.popleft()
        self._in_use = True

    @property
    def panel(self) -> PanelMessage | None:
        """The primitive components of the key pose that comes next."""
        return None if self._panel is None else self._panel()

    def _show(self, make: Callable[[], PanelMessage]) -> None:
        """Show this from now on; it is made when somebody asks for it, and once."""
        self._panel = cache(make)

    @property
    def note(self) -> str:
        """Why the command is not carried out as asked, empty where it is."""
        return self._changed

    @abstractmethod
    def step(self, sensors: Sensors) -> JointTargets:
        """Return what the servos shall do now; call once per control period."""

    @property
    @abstractmethod
    def stand(self) -> Array:
        """(2 n,) joint angles of the standing pose [rad]."""

    @property
    @abstractmethod
    def standing(self) -> bool:
        """Whether the robot stands still."""

    @property
    @abstractmethod
    def support(self) -> Support:
        """The planned support region at the latest `step`, when not standing."""

    @property
    @abstractmethod
    def estimate(self) -> Attitude | None:
        """The trunk's orientation as the sensors have it; None where nothing asks."""

    @property
    @abstractmethod
    def planned_zmp(self) -> Array | None:
        """(2,) planned ZMP in the support-foot frame, None while unknown [m]."""
