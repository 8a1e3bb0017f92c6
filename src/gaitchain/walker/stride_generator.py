"""Choice of the next stride for a command in any direction.

The command plus the residual of earlier steps give the desired landing of the next
foot; the stride that is nearest to it is chosen among those that passed physics.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gaitchain.chain.layered_chain import IntArray
from gaitchain.gait.family import STAND
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.step_target import Landing, Step
from gaitchain.gait.stride.strides import StridePoses
from gaitchain.messages import Array, Command
from gaitchain.walker.generator import (
    LATE_STOP,
    NO_MOTION,
    ChainState,
    Generator,
    Motion,
    StepRequest,
)
from gaitchain.walker.policy_table import Options, Policy, steps_to_stand

_TOLERANCE = np.array([0.05, 0.05, 0.1])  # leg, leg, rad: a deviation of cost 1
# Of a given landing: what a miss of a part of the tolerance costs 1, and how much of it
# is no miss.
_EXACT, _NEAR_ENOUGH = 0.1, 0.4
_TOLD = 5  # ends of a step that are told, the chosen one first
_HASTY = 0.5  # of the longest stride: above it, a shorter stride comes before a stop
_MOST_OWED = np.array([0.5, 0.5, 0.5])  # leg, leg, rad: limit of the residual
# Part of the residual that one step corrects. Strides that make up for each other's
# errors at once shake the robot: G1 held 4 instead of 20 of 24 walks at 0.85 m/s.
_PAID_AT_ONCE = 0.2
# The same of what each stride ahead misses again. With the fifth alone, a robot whose
# strides are all 15 % too long is a third of a leg ahead before they get shorter, and
# one whose foot turns by 2 deg in each step stays 10 deg off its heading.
LEARNED = np.array([0.02, 0.0, 0.02])
_TAUGHT = 0.15  # leg: a stride this long teaches half as much as a long one
_MOST_MISSED = np.array([0.3, 0.0, 0.3])  # leg, leg, rad per leg of stride


class StrideTables(NamedTuple):
    """All that a choice of strides is looked up in."""

    choices: list[list[list[Options]]]
    """[target][layer][pose]: (next pose, cost) pairs, cheapest first."""
    path_cost: Array
    """(N_1, N_4) of the best gait of each pair; inf forbids it."""
    steps_to_stand: IntArray
    """(N_4,) least number of steps to standing."""
    strides: Array
    """(N_4, 3) `STRIDE`."""
    cell: tuple[Array, Array]
    """Lower and upper bounds of each stride's cell, two of (N_4, 3)."""
    tolerance: Array
    """(3,) deviation of cost 1."""
    most_owed: Array
    """(3,) limit of the residual."""
    most_missed: Array
    """(3,) limit of what is learned to be missed, per leg of stride."""
    outer_share: Array
    """(2,) part of the way aside and around that the outer foot makes."""


class StrideGenerator(Generator):
    """Select strides."""

    def __init__(self, library: GaitLibrary, policy: Policy = "look_ahead") -> None:
        """Compute all choices; see `Generator`.

        Raises:
            LibraryError: no walk passed physics, or the library holds no strides.
        """
        poses = library.poses_as(StridePoses)
        self._strides, self._stance = poses.strides, poses.stance
        super().__init__(library, policy)
        hasty = _hasty_stops(self._strides, self.allowed)
        self._path_cost[hasty, STAND] = np.inf
        self._steps_to_stand = steps_to_stand(np.isfinite(self._path_cost))
        leg = library.robot.reduced.leg_length
        scale = np.array([leg, leg, 1.0])
        self._leg = leg
        self._tolerance = _TOLERANCE * scale
        self._most_owed = _MOST_OWED * scale
        self._most_missed = _MOST_MISSED * scale
        inward, outward = (f(self._strides[:, 1:], axis=0) for f in (np.min, np.max))
        self._outer_share = outward / np.maximum(outward - inward, 1e-9)
        self._cell = _cells(self._strides)

    @property
    def stance(self) -> float:
        """Distance of the ankles side by side [m]."""
        return self._stance

    @property
    def tables(self) -> StrideTables:
        """What choices are looked up in; for code that makes the same choices."""
        return StrideTables(
            self._choices,
            self._path_cost,
            self._steps_to_stand,
            self._strides,
            self._cell,
            self._tolerance,
            self._most_owed,
            self._most_missed,
            self._outer_share,
        )

    def clamp(self, command: Command) -> tuple[Command, str]:
        """Clamp a command to the range; see `CommandRange.clamp`."""
        return self.library.command_range.clamp(command)

    def landing(self, state: ChainState) -> Landing:
        """Return the desired landing of this step, clamped to the stride's cell."""
        if state.target == STAND:
            return Landing(*self._strides[STAND].tolist())
        low, high = self._cell[0][state.target], self._cell[1][state.target]
        return Landing(*np.minimum(np.maximum(state.landing, low), high).tolist())

    def nearest(
        self, pose: int, landing: Landing, *, before_stop: bool
    ) -> tuple[int, Landing]:
        """Find the stride that lands nearest to a place.

        Args:
            pose: from which the step begins.
            landing: the place, seen from the support foot.
            before_stop: whether the robot has to be able to stand after it.

        Returns:
            The stride, and where it lands.
        """
        (made,), (missed,) = self._reached(np.array([landing]))
        best = self._best(pose, landing, missed, before_stop=before_stop)
        return best, Landing(*made[best].tolist())

    def nearest_in_turn(self, landings: Sequence[Landing]) -> Iterator[Landing]:
        """Yield where steps from a stand land that come nearest to places.

        Args:
            landings: a place for each step, seen from its support foot; after the last
                one the robot has to be able to stand.
        """
        made, missed = self._reached(np.array(landings))
        pose, last = STAND, len(landings) - 1
        for step, landing in enumerate(landings):
            pose = self._best(pose, landing, missed[step], before_stop=step == last)
            yield Landing(*made[step, pose].tolist())

    def _reached(self, wanted: Array) -> tuple[Array, Array]:
        """Return where each stride lands nearest to places, and what it misses costs.

        Args:
            wanted: (S, 3) places.

        Returns:
            Landings, (S, N_4, 3), and costs, (S, N_4).
        """
        low, high = (end.copy() for end in self._cell)
        low[STAND] = high[STAND] = self._strides[STAND]
        made = np.minimum(np.maximum(wanted[:, None], low), high)
        missed = (made - wanted[:, None]) / (_EXACT * self._tolerance)
        return made, np.sum(missed**2, axis=2)

    def _best(
        self, pose: int, landing: Landing, missed: Array, *, before_stop: bool
    ) -> int:
        """Return the stride from a pose that misses a place at the least cost."""
        costs = self._path_cost[pose] + missed
        if before_stop:
            beside = Landing(*self._strides[STAND].tolist())
            if np.isfinite(costs[STAND]) and self.is_near(landing, beside):
                return STAND
            costs[~np.isfinite(self._path_cost[:, STAND])] = np.inf
        return int(np.argmin(costs))

    def is_near(self, wanted: Landing, made: Landing) -> bool:
        """Return whether a landing is as good as the one that was wanted."""
        off = np.abs(np.array(made) - np.array(wanted))
        return bool((off <= _NEAR_ENOUGH * self._tolerance).all())

    def expected_next(self, state: ChainState, command: Command) -> Landing:
        """Return the landing of the next step, if this one is made as planned.

        Args:
            state: inside this step.
            command: that the next step is expected to have, too.
        """
        length, outward, turn = self.landing(state)
        side = 1.0 if state.left_support else -1.0
        made = Step(length, -side * (self._stance + outward), -side * turn)
        left = not state.left_support
        end = replace(state, layer=0, pose=state.target, left_support=left)
        return self.landing(self.begin_step(end, StepRequest(command, (), made)))

    def first_support(self, command: Command) -> bool:
        """Whether the left leg supports first; the foot on the motion's side steps."""
        return command.vy + self._stance * command.yaw_rate <= 0.0

    def step_speed(self, state: ChainState) -> float:
        """Return the planned forward speed of a step, negative backward [m/s]."""
        return float(self._strides[state.target][0]) / self.library.timing.step

    def begin_step(self, state: ChainState, request: StepRequest) -> ChainState:
        """See `Generator`; later commands are not considered."""
        if request.landing is not None:
            return self._begin_at(request.landing, state, last=request.last)
        command = request.command
        side = 1.0 if state.left_support else -1.0
        owed = self._residual(state, request.made, side)
        asked = self._asked(command, side)
        if command.stops:
            asked, owed = np.array(NO_MOTION), np.array([0.0, 0.0, owed[2]])
        stride = float(asked[0]) / self._leg
        missed = self._learned(state.missed, owed, stride)
        more = _PAID_AT_ONCE * owed + stride * missed
        landing = self._landing_for(asked + more, side)
        costs = self._costs(state.pose, landing, stops=command.stops)
        best = np.argsort(costs, kind="stable")[:_TOLD]
        told = [] if command.stops else best[np.isfinite(costs[best])].tolist()
        return replace(
            state,
            first=state.pose,
            target=int(best[0]),
            ends=tuple((end, float(costs[end])) for end in told),
            expected=tuple(self._path_cost[state.pose, told].tolist()),
            asked=tuple(asked.tolist()),
            owed=tuple(owed.tolist()),
            missed=tuple(missed.tolist()),
            landing=Landing(*landing.tolist()),
        )

    def _begin_at(
        self, landing: Landing, state: ChainState, *, last: bool
    ) -> ChainState:
        """Begin a step that lands where it is told to, whatever is owed."""
        target, _ = self.nearest(state.pose, landing, before_stop=last)
        return replace(
            state,
            first=state.pose,
            target=target,
            ends=(),
            expected=(),
            asked=NO_MOTION,
            owed=NO_MOTION,
            landing=landing,
        )

    def _residual(self, state: ChainState, made: Step | None, side: float) -> Array:
        """Return the `Motion` that steps before this one owe, (3,).

        Args:
            state: before this step; its `asked` was asked of the one that was made.
            made: what was measured of that one; None adds nothing.
            side: +1 for left support in this step.
        """
        owed = np.array(state.owed)
        if made is not None:
            asked = made.lasted * np.array(state.asked)
            owed = owed + asked - self._motion(made, -side)
        most = self._most_owed
        return np.asarray(np.minimum(np.maximum(owed, -most), most))

    def _costs(self, pose: int, landing: Array, *, stops: bool) -> Array:
        """Return what each end of a step from a pose costs, (N_4,); inf forbids it."""
        missed = np.sum(((self._strides - landing) / self._tolerance) ** 2, axis=1)
        costs: Array = self._path_cost[pose] + missed
        if stops:
            return np.asarray(costs + LATE_STOP * self._steps_to_stand)
        costs[STAND] = np.inf
        return costs

    def _learned(self, missed: Motion, owed: Array, stride: float) -> Array:
        """Learn from the residual what strides ahead miss, (3,) per leg of length.

        Args:
            missed: as known before.
            owed: residual.
            stride: length that is asked for [legs].
        """
        teaches = stride / (stride**2 + _TAUGHT**2)
        most, found = self._most_missed, np.array(missed) + teaches * LEARNED * owed
        return np.asarray(np.minimum(np.maximum(found, -most), most))

    def _asked(self, command: Command, side: float) -> Array:
        """Return the `Motion` that a command asks of a step, (3,).

        Aside and around, the foot on that side makes the way of both, but for what the
        other one can make inward.
        """
        step_s = self.library.timing.step
        asked = np.array([command.vx, command.vy, command.yaw_rate]) * step_s
        outward = -side * asked[1:] > 0.0
        asked[1:] *= 2.0 * np.where(outward, self._outer_share, 1.0 - self._outer_share)
        return asked

    def _landing_for(self, motion: Array, side: float) -> Array:
        """Return the `STRIDE` that makes a `Motion`, (3,); left support has side +1."""
        ahead, left, turn = motion
        half = 0.5 * side * self._stance
        x, y = _turned(ahead, left, 0.5 * turn)
        dx, dy = _turned(0.0, -half, turn)
        y = -side * (y - half + dy) - self._stance
        return np.array([x + dx, y, -side * turn])

    def _motion(self, made: Step, side: float) -> Array:
        """Return the `Motion` of a measured step, (3,); left support has side +1."""
        half = 0.5 * side * self._stance
        dx, dy = _turned(0.0, -half, made.turn)
        x, y = made.ahead - dx, made.left + half - dy
        return np.array([*_turned(x, y, -0.5 * made.turn), made.turn])


def _turned(x: float, y: float, angle: float) -> tuple[float, float]:
    cos, sin = math.cos(angle), math.sin(angle)
    return cos * x - sin * y, sin * x + cos * y


def _hasty_stops(strides: Array, allowed: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the strides after which a shorter one must come before a stop, (N_1,).

    A robot that stops directly from a long stride puts its last foot too far ahead, and
    has to step again once it stands. Strides that no shorter one can follow are exempt.
    """
    lengths = np.abs(strides[:, 0])
    long = lengths > _HASTY * lengths[allowed.any(axis=0)].max(initial=0.0)
    between = allowed[:, STAND] & ~long
    between[STAND] = False
    return np.asarray(long & (allowed & between).any(axis=1))


def _cells(strides: Array) -> tuple[Array, Array]:
    """Return the lower and upper bounds of each stride's cell, two arrays (N, 3).

    A cell ends halfway to the neighbouring values on each axis.
    """
    low, high = strides.copy(), strides.copy()
    for axis in range(strides.shape[1]):
        values = np.unique(strides[:, axis])
        middle = 0.5 * (values[1:] + values[:-1])
        ends: NDArray[np.float64] = np.concatenate([values[:1], middle, values[-1:]])
        at = np.searchsorted(values, strides[:, axis])
        low[:, axis], high[:, axis] = ends[at], ends[at + 1]
    return low, high
