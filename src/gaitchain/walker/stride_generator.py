"""Choose the next stride and its swing for a command in any direction. Pure.

At each kp_1 the command, and what earlier steps left owing, say where the next foot
should land; the chain takes the stride nearest to that among those that physics passed,
then the shapes of the swing on the way there.
"""

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gaitchain.balance.walk_controller import Step
from gaitchain.errors import CommandError, LibraryError
from gaitchain.gait.keypose.key_poses import STAND
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.stride.strides import StridePoses
from gaitchain.messages import Array, Command
from gaitchain.walker.keypose_generator import Decision
from gaitchain.walker.policy_table import Policy, pair_costs, ranked_choices, safe_pairs

_TOLERANCE = np.array([0.05, 0.05, 0.1])  # of the leg, of the leg, rad: cost 1
_LATE_STOP = 1e6  # cost of each step that a stop comes late: outweighs all else
_HASTY = 0.5  # of the longest stride: longer ones are not stopped from at once
_MOST_OWED = np.array([0.17, 0.17, 0.5])  # of the leg, of the leg, rad
# Of what is owed: paid sideways all at once, each wide landing asks for a wider one on
# the other side, and a robot with wide hips sways more and more until it falls.
_PAID_AT_ONCE = np.array([1.0, 0.5, 1.0])
_ACROSS = 1.0 + 1e-9


class Wanted(NamedTuple):
    """Where a foot should land, as `strides.STRIDE`."""

    length: float
    outward: float
    turn: float


_NOWHERE = Wanted(0.0, 0.0, 0.0)


@dataclass(frozen=True)
class StrideState:
    """Where the walk is in the chain."""

    layer: int = 0
    """Key moment reached, 0 for kp_1."""
    pose: int = STAND
    first: int = STAND
    """The stride with which this step began."""
    target: int = STAND
    """The stride with which it is to end."""
    left_support: bool = True
    asked: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Motion asked of this step: ahead, left [m], turn to the left [rad]."""
    owed: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Motion that earlier steps were asked for and did not make."""
    wanted: Wanted = _NOWHERE
    """Where this step's foot should land."""


class StrideGenerator:
    """Choose the next key pose of a dynamic library."""

    def __init__(self, library: GaitLibrary, policy: Policy = "look_ahead") -> None:
        """Work out all choices; see `keypose_generator.Generator`.

        Raises:
            LibraryError: physics passed no walk, or the library holds no strides.
        """
        if not isinstance(library.poses, StridePoses):
            raise LibraryError("the library holds no strides; use generator.Generator")
        self.library, self._poses = library, library.poses
        allowed, self._steps_to_stand = safe_pairs(library)
        if not allowed[STAND].any() or library.command_range.vx[1] <= 0.0:
            raise LibraryError(
                "the library holds no walk: physics passed no step from standing, or "
                "no steady one; build it with more walks or other candidates"
            )
        self._choices = ranked_choices(library, policy)
        self._path_cost = np.where(allowed, pair_costs(library), np.inf)
        self._path_cost[_hasty_stops(self._poses.strides, allowed), STAND] = np.inf
        leg = library.biped.leg_length
        scale = np.array([leg, leg, 1.0])
        self._tolerance, self._most_owed = _TOLERANCE * scale, _MOST_OWED * scale
        self._cell = _cells(self._poses.strides)

    def clamp(self, command: Command) -> tuple[Command, str]:
        """Bring a command into the library's range, keeping its direction.

        The parts of each most that are asked for may add up to 1.

        Returns:
            The command that will be carried out, and a note if it is another one.
        """
        if command.stops:
            asked = command.vx, command.vy, command.yaw_rate
            finite = all(map(math.isfinite, asked))
            return Command(), "" if finite else f"{asked} is no command: stop"
        span = self.library.command_range
        parts = [
            _part(value, *limits)
            for value, limits in (
                (command.vx, span.vx),
                (command.vy, span.vy),
                (command.yaw_rate, span.yaw_rate),
            )
        ]
        total = sum(parts)
        if total <= _ACROSS:
            return command, ""
        if math.isinf(total):
            return Command(), f"{command}: no such way in this library: stop"
        done = Command(command.vx / total, command.vy / total, command.yaw_rate / total)
        return done, (
            f"{command.vx:g}, {command.vy:g} m/s, {command.yaw_rate:g} rad/s is "
            f"{total:.2f} of what the library walks: {done.vx:.3f}, {done.vy:.3f}, "
            f"{done.yaw_rate:.3f}"
        )

    def advance(
        self, state: StrideState, command: Command, made: Step | None = None
    ) -> tuple[StrideState, Decision]:
        """Decide on the next key pose.

        Args:
            state: the key moment and pose that the robot has reached.
            command: what is asked for; it counts from the next kp_1 on.
            made: at kp_1, the step just made as the robot measured it.

        Returns:
            The state after the move, and the decision.

        Raises:
            CommandError: no way leads on.
        """
        if state.layer == 0:
            state = self._begin_step(state, command, made)
        options = self._choices[state.target][state.layer][state.pose]
        if not options:
            raise CommandError(
                f"no way leads from pose {state.pose} of layer {state.layer + 1} to "
                f"pose {state.target}; begin at layer 1"
            )
        pose, cost = options[0]
        layer = state.layer + 1
        speed = math.hypot(*self._poses.strides[state.target][:2])
        decision = Decision(
            layer,
            pose,
            cost,
            options[1:],
            state.target,
            speed / self.library.timing.step,
        )
        if layer == len(self.library.chain.transitions):
            left = not state.left_support
            return replace(state, layer=0, pose=pose, left_support=left), decision
        return replace(state, layer=layer, pose=pose), decision

    def likely_next(self, state: StrideState) -> int:
        """Return the pose that the chain would take from a state inside a step."""
        return self._choices[state.target][state.layer][state.pose][0][0]

    def landing(self, state: StrideState) -> Wanted:
        """Return the stride of this step, trimmed within its cell to what is wanted."""
        stride = self._poses.strides[state.target]
        if state.target == STAND:
            return Wanted(*stride.tolist())
        low, high = self._cell[0][state.target], self._cell[1][state.target]
        return Wanted(*np.clip(state.wanted, low, high).tolist())

    def first_support(self, command: Command) -> bool:
        """Whether the left foot supports first: the foot on the way goes first."""
        return command.vy + 0.2 * command.yaw_rate <= 0.0

    def _begin_step(
        self, state: StrideState, command: Command, made: Step | None
    ) -> StrideState:
        step_s, side = self.library.timing.step, 1.0 if state.left_support else -1.0
        owed = np.array(state.owed)
        if made is not None:
            owed = owed + np.array(state.asked) - self._motion(made, -side)
        owed = np.clip(owed, -self._most_owed, self._most_owed)
        asked = np.array([command.vx, command.vy, command.yaw_rate]) * step_s
        stops = command.stops
        if stops:
            asked, owed = np.zeros(3), np.array([0.0, 0.0, owed[2]])
        wanted = self._landing_for(asked + _PAID_AT_ONCE * owed, side)
        costs = self._path_cost[state.pose] + np.sum(
            ((self._poses.strides - wanted) / self._tolerance) ** 2, axis=1
        )
        if stops:
            costs = costs + _LATE_STOP * self._steps_to_stand
        else:
            costs[STAND] = np.inf
        return replace(
            state,
            first=state.pose,
            target=int(np.argmin(costs)),
            asked=tuple(asked.tolist()),
            owed=tuple(owed.tolist()),
            wanted=Wanted(*wanted.tolist()),
        )

    def _landing_for(self, motion: Array, side: float) -> Array:
        """(3,) `STRIDE` that moves the robot's middle by a motion."""
        ahead, left, turn = motion
        half = 0.5 * side * self.library.biped.hip_width
        x, y = _turned(ahead, left, 0.5 * turn)
        dx, dy = _turned(0.0, -half, turn)
        width = self.library.biped.hip_width
        return np.array([x + dx, -side * (y - half + dy) - width, -side * turn])

    def _motion(self, made: Step, side: float) -> Array:
        """(3,) how a step from a foot moved the robot's middle: ahead, left, turn."""
        half = 0.5 * side * self.library.biped.hip_width
        dx, dy = _turned(0.0, -half, made.turn)
        x, y = made.ahead - dx, made.left + half - dy
        return np.array([*_turned(x, y, -0.5 * made.turn), made.turn])


def _turned(x: float, y: float, angle: float) -> tuple[float, float]:
    cos, sin = math.cos(angle), math.sin(angle)
    return cos * x - sin * y, sin * x + cos * y


def _part(value: float, low: float, high: float) -> float:
    """Part of the most that is asked for, infinite where nothing is allowed."""
    most = high if value > 0.0 else -low
    if value == 0.0:
        return 0.0
    return abs(value) / most if most > 0.0 else math.inf


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
