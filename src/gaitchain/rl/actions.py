"""What an agent can do: change the walk's targets, its command, or replace it."""

from abc import ABC, abstractmethod
from typing import Literal

import numpy as np

from gaitchain.gait.library import GaitLibrary
from gaitchain.messages import CONTROL_PERIOD_S, Array, Command, Sensors
from gaitchain.rl.phase import StepPhase
from gaitchain.walker.walker import Walker

ActionKind = Literal["residual", "command", "targets"]
_LEAST_RAD = 1e-6


class Control(ABC):
    """How an action becomes joint targets; actions are in [-1, 1]."""

    size: int
    """Numbers of an action."""

    @abstractmethod
    def reset(self) -> None:
        """Return to standing, with a command of 0."""

    @abstractmethod
    def rest(self, sensors: Sensors) -> Array:
        """Return joint targets (n,) [rad] for the time before the episode."""

    @abstractmethod
    def command(self, command: Command) -> None:
        """Set the command of the episode."""

    @abstractmethod
    def act(self, action: Array, sensors: Sensors) -> Array:
        """Return joint targets (n,) [rad]."""

    @property
    @abstractmethod
    def phase(self) -> float:
        """Part of the cycle of two steps that is done, 0 to 1."""


class ResidualControl(Control):
    """The walk, with the action added to its joint targets."""

    def __init__(self, library: GaitLibrary, residual_rad: float) -> None:
        """Prepare the walk; an action of 1 adds `residual_rad`."""
        self.walker = Walker(library)
        self.size = len(self.walker.joint_names)
        self._scale = residual_rad
        self._step_phase = StepPhase(self.walker.gait)

    def reset(self) -> None:
        """Return to standing, with a command of 0."""
        self.walker.reset()
        self.walker.command(Command())
        self._step_phase.reset()

    def rest(self, sensors: Sensors) -> Array:
        """Return the targets of the walk, which is standing."""
        return self.walker.step(sensors).position

    def command(self, command: Command) -> None:
        """Set the command of the walk."""
        self.walker.command(command)

    def act(self, action: Array, sensors: Sensors) -> Array:
        """Return the walk's targets plus the residual."""
        return self._walked(sensors) + self._scale * action

    def _walked(self, sensors: Sensors) -> Array:
        targets = self.walker.step(sensors).position
        self._step_phase.tick()
        return targets

    @property
    def phase(self) -> float:
        """Place in the walk's own cycle."""
        return self._step_phase.value


class CommandControl(ResidualControl):
    """The walk, with the action in place of its command."""

    def __init__(self, library: GaitLibrary) -> None:
        """Prepare the walk; an action has parts of the limits of vx, vy, yaw rate."""
        super().__init__(library, 0.0)
        self.size = 3

    def command(self, command: Command) -> None:
        """Leave the command to the actions."""

    def act(self, action: Array, sensors: Sensors) -> Array:
        """Return the walk's targets for the commanded parts."""
        self.walker.command(self.walker.command_range.steer(action.tolist()))
        return self._walked(sensors)


class TargetControl(Control):
    """No walk: the action is the joint targets, and the phase a clock."""

    def __init__(self, library: GaitLibrary, stand: Array) -> None:
        """Map -1, 0, 1 to a joint's lower limit, its standing angle, its upper limit.

        Args:
            library: the gaits, for limits and the time of a step.
            stand: (n,) standing pose [rad].
        """
        self.scale = TargetScale(library, stand)
        self.size = len(stand)
        self._cycle_s = 2.0 * library.timing.step
        self.reset()

    def reset(self) -> None:
        """Set the clock to 0."""
        self._time_s = 0.0

    def rest(self, sensors: Sensors) -> Array:
        """Return the standing pose."""
        return self.scale.stand

    def command(self, command: Command) -> None:
        """Leave the command to the agent, who sees it."""

    def act(self, action: Array, sensors: Sensors) -> Array:
        """Return the targets."""
        self._time_s += CONTROL_PERIOD_S
        return self.scale.targets(action)

    @property
    def phase(self) -> float:
        """Place in a cycle of the planned time."""
        return (self._time_s / self._cycle_s) % 1.0


class TargetScale:
    """Joint targets as numbers in [-1, 1]: limits at the ends, the stand at 0."""

    def __init__(self, library: GaitLibrary, stand: Array) -> None:
        """Take the limits of the library's robot; `stand` is (n,) [rad]."""
        legs = library.robot.legs
        self.stand = stand
        # A joint that stands at its limit cannot go on to that side.
        self._below = np.maximum(stand - legs.lower, _LEAST_RAD)
        self._above = np.maximum(legs.upper - stand, _LEAST_RAD)

    def targets(self, action: Array) -> Array:
        """Return joint targets (n,) [rad]."""
        sides = np.where(action < 0.0, self._below, self._above)
        return np.asarray(self.stand + action * sides)

    def action(self, targets: Array) -> Array:
        """Return the action (n,) that has joint targets [rad], within [-1, 1]."""
        off = targets - self.stand
        sides = np.where(off < 0.0, self._below, self._above)
        return np.asarray(np.clip(off / sides, -1.0, 1.0))


def make_control(
    kind: ActionKind, library: GaitLibrary, stand: Array, residual_rad: float
) -> Control:
    """Return the control of a kind of actions."""
    if kind == "residual":
        return ResidualControl(library, residual_rad)
    if kind == "command":
        return CommandControl(library)
    return TargetControl(library, stand)
