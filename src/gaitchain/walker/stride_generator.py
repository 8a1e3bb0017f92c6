"""Where a stride shall end, for a command in any direction.

The command, and what earlier steps left owing, say where the next foot should land; the
chain takes the stride nearest to that among those that physics passed.
"""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gaitchain.balance.walk_controller import Step
from gaitchain.gait.family import STAND
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.step_target import Landing
from gaitchain.gait.stride.strides import StridePoses
from gaitchain.messages import Array, Command
from gaitchain.walker.generator import (
    LATE_STOP,
    NONE,
    GaitState,
    Generator,
    StepRequest,
)
from gaitchain.walker.policy_table import Policy, steps_to_stand

_TOLERANCE = np.array([0.05, 0.05, 0.1])  # of the leg, of the leg, rad: cost 1
_HASTY = 0.5  # of the longest stride: longer ones are not stopped from at once
_MOST_OWED = np.array([0.17, 0.17, 0.5])  # of the leg, of the leg, rad
# Of what is owed: paid sideways all at once, each wide landing asks for a wider one on
# the other side, and a robot with wide hips sways more and more until it falls.
_PAID_AT_ONCE = np.array([1.0, 0.5, 1.0])


class StrideGenerator(Generator):
    """Choose strides, and the shapes of the swing on the way there."""

    def __init__(self, library: GaitLibrary, policy: Policy = "look_ahead") -> None:
        """Work out all choices; see `Generator`.

        Raises:
            LibraryError: physics passed no walk, or the library holds no strides.
        """
        self._strides = library.poses_as(StridePoses).strides
        super().__init__(library, policy)
        hasty = _hasty_stops(self._strides, self.allowed)
        self._path_cost[hasty, STAND] = np.inf
        self._steps_to_stand = steps_to_stand(np.isfinite(self._path_cost))
        leg = library.robot.reduced.leg_length
        scale = np.array([leg, leg, 1.0])
        self._tolerance, self._most_owed = _TOLERANCE * scale, _MOST_OWED * scale
        self._cell = _cells(self._strides)

    def clamp(self, command: Command) -> tuple[Command, str]:
        """Bring a command into the range; see `CommandRange.clamp`."""
        return self.library.command_range.clamp(command)

    def landing(self, state: GaitState) -> Landing:
        """Return the stride of this step, trimmed within its cell to what is asked."""
        if state.target == STAND:
            return Landing(*self._strides[STAND].tolist())
        low, high = self._cell[0][state.target], self._cell[1][state.target]
        return Landing(*np.clip(state.landing, low, high).tolist())

    def first_support(self, command: Command) -> bool:
        """Whether the left foot supports first: the foot on the way goes first."""
        return command.vy + 0.2 * command.yaw_rate <= 0.0

    def step_speed(self, state: GaitState) -> float:
        """As it is planned, backward below 0."""
        return float(self._strides[state.target][0]) / self.library.timing.step

    def begin_step(self, state: GaitState, request: StepRequest) -> GaitState:
        """See `Generator`; a step knows no commands but its own."""
        command, made = request.command, request.made
        step_s, side = self.library.timing.step, 1.0 if state.left_support else -1.0
        owed = np.array(state.owed)
        if made is not None:
            owed = owed + np.array(state.asked) - self._motion(made, -side)
        owed = np.clip(owed, -self._most_owed, self._most_owed)
        asked = np.array([command.vx, command.vy, command.yaw_rate]) * step_s
        if command.stops:
            asked, owed = np.array(NONE), np.array([0.0, 0.0, owed[2]])
        landing = self._landing_for(asked + _PAID_AT_ONCE * owed, side)
        costs = self._path_cost[state.pose] + np.sum(
            ((self._strides - landing) / self._tolerance) ** 2, axis=1
        )
        if command.stops:
            costs = costs + LATE_STOP * self._steps_to_stand
        else:
            costs[STAND] = np.inf
        return replace(
            state,
            first=state.pose,
            target=int(np.argmin(costs)),
            asked=tuple(asked.tolist()),
            owed=tuple(owed.tolist()),
            landing=Landing(*landing.tolist()),
        )

    def _landing_for(self, motion: Array, side: float) -> Array:
        """(3,) `STRIDE` that moves the robot's middle by a motion."""
        ahead, left, turn = motion
        half = 0.5 * side * self.library.robot.reduced.hip_width
        x, y = _turned(ahead, left, 0.5 * turn)
        dx, dy = _turned(0.0, -half, turn)
        width = self.library.robot.reduced.hip_width
        return np.array([x + dx, -side * (y - half + dy) - width, -side * turn])

    def _motion(self, made: Step, side: float) -> Array:
        """(3,) how a step from a foot moved the robot's middle: ahead, left, turn."""
        half = 0.5 * side * self.library.robot.reduced.hip_width
        dx, dy = _turned(0.0, -half, made.turn)
        x, y = made.ahead - dx, made.left + half - dy
        return np.array([*_turned(x, y, -0.5 * made.turn), made.turn])


def _turned(x: float, y: float, angle: float) -> tuple[float, float]:
    cos, sin = math.cos(angle), math.sin(angle)
    return cos * x - sin * y, sin * x + cos * y


def _hasty_stops(strides: Array, allowed: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(N_1,) strides from which a shorter step comes before a stop, where one can.

    A robot that is stopped from a long stride puts its last foot too far ahead, and has
    to step again once it stands.
    """
    lengths = np.abs(strides[:, 0])
    long = lengths > _HASTY * lengths[allowed.any(axis=0)].max(initial=0.0)
    between = allowed[:, STAND] & ~long
    between[STAND] = False
    return np.asarray(long & (allowed & between).any(axis=1))


def _cells(strides: Array) -> tuple[Array, Array]:
    """Least and most of each stride: half-way to the next ones on each axis."""
    low, high = strides.copy(), strides.copy()
    for axis in range(strides.shape[1]):
        values = np.unique(strides[:, axis])
        middle = 0.5 * (values[1:] + values[:-1])
        ends: NDArray[np.float64] = np.concatenate([values[:1], middle, values[-1:]])
        at = np.searchsorted(values, strides[:, axis])
        low[:, axis], high[:, axis] = ends[at], ends[at + 1]
    return low, high
