"""A walk of strides: what the chain chose becomes motion, one period after another.

Between ticks this is plain Python: standing, the first weight shift, taking the next
stride at the end of each step, and coming to a stand. No clock, no I/O.
"""

import math
from typing import NamedTuple

import numpy as np

from gaitchain.balance.control_step import tick
from gaitchain.balance.frames import seen_from
from gaitchain.balance.gains import Gains
from gaitchain.balance.leg_kinematics import Legs
from gaitchain.balance.packed_state import Row, WalkRow
from gaitchain.balance.reference_pose import standing_joints
from gaitchain.balance.slow_down import caution_after
from gaitchain.balance.standing import memory_at_rest, standing_state
from gaitchain.balance.standing import topples as topples_at
from gaitchain.balance.state import (
    DOUBLE,
    NOT_YET,
    SETTLE,
    SHIFT,
    SINGLE,
    STAND,
    UPRIGHT,
    Attitude,
    Foot,
    GaitState,
    Memory,
    Pelvis,
    StepTimes,
    View,
)
from gaitchain.balance.state_estimation import Senses
from gaitchain.balance.support_foot import measured_step
from gaitchain.gait.step_target import StepTarget
from gaitchain.messages import Array, Sensors

_SLACK_S = 1e-6
_AT_REST = 0.01  # m/s: a pelvis slower than this stands
_LONGEST_SETTLE_S = 2.0
_IN_PLACE = StepTarget(0.0, 0.0, 0.0, 0.5, 1.5, 0.0, 0.0, 0.0, 0.0)


class Step(NamedTuple):
    """A step made, as the legs measured it at touch-down."""

    ahead: float
    """[m]"""
    left: float
    """[m]"""
    turn: float
    """To the left [rad]."""


class Snapshot(NamedTuple):
    """A walk at one moment, to be taken up again."""

    numbers: Row
    """(1,) row of the walk."""
    memory: Memory


class StrideWalk:
    """The state of a walk, and what moves it on."""

    def __init__(self, legs: Legs, gains: Gains, times: StepTimes) -> None:
        """Stand with the feet together."""
        self.legs, self.gains, self.times = legs, gains, times
        self.reset()

    def reset(self) -> None:
        """Stand, upright, facing ahead."""
        self._row = WalkRow(self.gains, self.times)
        self.goal = _IN_PLACE._replace(width=self.legs.hip_width)
        self.state = standing_state(self.legs, self.gains)
        self._memory = memory_at_rest(self.legs, self._pose(self.state))
        self._senses = Senses(self.legs, self.gains, self.times.period, self._row)
        self.step: Step | None = None

    @property
    def caution(self) -> float:
        """Of the step that comes next, see `caution_after`."""
        return caution_after(self.gains, self.state, self.goal.length)

    def snapshot(self) -> Snapshot:
        """Return a copy of the whole state."""
        memory = Memory(*(array.copy() for array in self._memory))
        return Snapshot(self._row.numbers.copy(), memory)

    def restore(self, moment: Snapshot) -> None:
        """Go on from a snapshot."""
        self._row.numbers[:], memory = moment
        self._memory = Memory(*(array.copy() for array in memory))

    @property
    def state(self) -> GaitState:
        """Where the walk is."""
        return self._row.state

    @state.setter
    def state(self, state: GaitState) -> None:
        self._row.state = state

    @property
    def phase(self) -> int:
        """Of the state."""
        return self._row.phase

    @property
    def side(self) -> float:
        """Of the state: +1 while the left foot supports, else -1."""
        return self._row.side

    @property
    def time(self) -> float:
        """Of the state [s]."""
        return self._row.time

    @property
    def goal(self) -> StepTarget:
        """What the chain chose for this step."""
        return self._row.goal

    @goal.setter
    def goal(self, goal: StepTarget) -> None:
        self._row.goal = goal

    @property
    def attitude(self) -> Attitude:
        """The trunk's orientation."""
        return self._row.attitude

    @property
    def view(self) -> View | None:
        """What the latest tick saw; None before the first one."""
        return None if self._senses.targets is None else self._row.view

    @property
    def zmp(self) -> Array:
        """(2,) ZMP that the latest targets are to make, step frame [m]."""
        return self._memory.zmp.copy()

    @property
    def reference(self) -> Array:
        """(2 n,) reference joint angles of the latest tick [rad]."""
        return self._memory.joints.copy()

    @property
    def stand(self) -> Array:
        """(2 n,) joint angles of the standing pose [rad]."""
        width, ahead = self.legs.hip_width, self.gains.foot_zmp.x
        upright = self.state._replace(
            phase=STAND,
            pelvis=Pelvis(ahead, -0.5 * width, 0.0, 0.0),
            pelvis_yaw=0.0,
            lift_off=Foot(0.0, -width, 0.0),
            lean=UPRIGHT,
        )
        return self._pose(upright)

    @property
    def standing(self) -> bool:
        """Whether the robot stands and nothing moves."""
        return self._row.phase == STAND

    @property
    def wants_stride(self) -> bool:
        """Whether the next tick begins a step, so that a goal must be given."""
        row, times = self._row, self.times
        shifted = row.phase == SHIFT and row.time >= times.shift - _SLACK_S
        made = row.phase == DOUBLE and row.time >= times.step - _SLACK_S
        return shifted or (made and self.goal.stops == 0.0)

    def begin_shift(self, left_support: bool) -> None:
        """Leave the stand: shift the weight over the foot that supports first."""
        if left_support != (self.side > 0):
            self.state = seen_from(self.state.lift_off, self.state)
        self.state = self.state._replace(phase=SHIFT, time=0.0, worst=0.0, caution=0.0)
        self._senses.leave_stand()

    def catch(self) -> bool:
        """Step at once where standing feet cannot hold the robot.

        Returns:
            Whether it steps; the next tick then wants a stride.
        """
        if self._row.phase not in (STAND, SETTLE, SHIFT):
            return False
        topples, swing = topples_at(self.legs, self._row.numbers)
        if topples:
            if not swing:
                self.state = seen_from(self.state.lift_off, self.state)
            self.state = self.state._replace(phase=SHIFT, time=self.times.shift)
            self._senses.leave_stand()
        return bool(topples)

    def exchange(self, joints: Array) -> Step:
        """Take the landed foot as the support foot; measure the step just made."""
        self.step = Step(*measured_step(self.legs, joints, self.side))
        left_over = self.time - self.times.step
        landed = seen_from(self.state.landing, self.state)
        self.state = landed._replace(time=max(left_over, 0.0))
        return self.step

    def begin_step(self, goal: StepTarget) -> None:
        """Lift off towards a goal."""
        caution, self.goal = self.caution, goal
        self.state = self.state._replace(
            phase=SINGLE,
            time=0.0 if self.phase == SHIFT else self.time,
            landing=Foot(goal.length, -goal.width, goal.turn),
            first_zmp=NOT_YET,
            rate=1.0,
            worst=0.0,
            caution=caution,
        )

    def sense(self, sensors: Sensors) -> None:
        """Take the trunk's orientation from the sensors.

        What is learned while standing still is used while walking.
        """
        self._senses.sense(sensors, self._memory.offset)
        load = sensors.foot_load
        self._memory.load[:] = math.nan if load is None else load

    def advance(self, sensors: Sensors) -> Array:
        """Return the servo targets of this control period, (2 n,) [rad]."""
        self._change_phase(sensors)
        targets = tick(
            self.legs,
            self._row.numbers,
            sensors.joint_position,
            sensors.joint_velocity,
            self._memory,
        )
        self._senses.targets = np.asarray(targets)
        return self._senses.targets.copy()

    def _change_phase(self, sensors: Sensors) -> None:
        """Come to a stand, or leave it for a push."""
        phase = self._row.phase
        if phase == DOUBLE:
            if self._row.time >= self.times.step - _SLACK_S and self.goal.stops > 0.0:
                self.exchange(sensors.joint_position)
                self.state = self.state._replace(phase=SETTLE, time=0.0)
        elif phase == STAND and self._pushed:
            self.state = self.state._replace(phase=SETTLE, time=0.0)
        elif phase == SETTLE and self._at_rest():
            still = self.state.pelvis._replace(vx=0.0, vy=0.0)
            self.state = self.state._replace(phase=STAND, pelvis=still)

    @property
    def _pushed(self) -> bool:
        error, zone = self._row.error, self.gains.far_zone
        return abs(error.x) > zone.x or abs(error.y) > zone.y

    def _at_rest(self) -> bool:
        if self._pushed:
            return False
        pelvis = self.state.pelvis
        slow = math.hypot(pelvis.vx, pelvis.vy) < _AT_REST
        return slow or self.time > _LONGEST_SETTLE_S

    def _pose(self, state: GaitState) -> Array:
        """(2 n,) reference joint angles of a state under an upright trunk [rad]."""
        row = WalkRow(self.gains, self.times)
        row.goal, row.state = self.goal, state
        return np.asarray(standing_joints(self.legs, row.numbers))
