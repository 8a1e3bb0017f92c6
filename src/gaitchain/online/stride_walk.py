"""A walk of strides: what the chain chose becomes motion, one period after another.

Between ticks this is plain Python: standing, the first weight shift, taking the next
stride at the end of each step, and coming to a stand. No clock, no I/O.
"""

import math
from typing import NamedTuple

import numpy as np

from gaitchain.kinematics import Array
from gaitchain.messages import Sensors
from gaitchain.online.estimator import measured_step
from gaitchain.online.exchange import seen_from
from gaitchain.online.gains import Gains
from gaitchain.online.legs import Legs, Posture, com_from_pelvis, posture
from gaitchain.online.pose import pose_joints
from gaitchain.online.senses import Senses
from gaitchain.online.standing import topples as topples_at
from gaitchain.online.state import (
    DOUBLE,
    SETTLE,
    SHIFT,
    SINGLE,
    STAND,
    Attitude,
    Foot,
    GaitState,
    Goal,
    Memory,
    Pelvis,
    Planar,
    StepTimes,
    View,
)
from gaitchain.online.tick import tick

_SLACK_S = 1e-6
_AT_REST = 0.01  # m/s: a pelvis slower than this stands
_LONGEST_SETTLE_S = 2.0
_NOT_YET = Planar(math.nan, math.nan)
_IN_PLACE = Goal(0.0, 0.0, 0.0, 0.5, 1.5, 0.0, 0.0, 0.0, 0.0)


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

    goal: Goal
    attitude: Attitude
    state: GaitState
    memory: Memory


class StrideWalk:
    """The state of a walk, and what moves it on."""

    def __init__(self, legs: Legs, gains: Gains, times: StepTimes) -> None:
        """Stand with the feet together."""
        self.legs, self.gains, self.times = legs, gains, times
        self.reset()

    def reset(self) -> None:
        """Stand, upright, facing ahead."""
        width, ahead = self.legs.hip_width, self.gains.foot_zmp.x
        self.goal = _IN_PLACE._replace(width=width)
        beside = Foot(0.0, -width, 0.0)
        self.state = GaitState(
            phase=STAND,
            side=1.0,
            time=0.0,
            pelvis=Pelvis(ahead, -0.5 * width, 0.0, 0.0),
            pelvis_yaw=0.0,
            lift_off=beside,
            landing=beside,
            zmp=Planar(ahead, -0.5 * width),
            first_zmp=_NOT_YET,
            error=Planar(0.0, 0.0),
            rate=1.0,
        )
        joints = self._pose(self.state)
        found = posture(self.legs, joints)
        com = com_from_pelvis(self.legs, found)
        self._memory = Memory(
            joints=joints,
            next_joints=joints.copy(),
            links=_at_rest(found),
            com=np.array([com[0], com[1], 0.0, 0.0]),
            reaction=np.zeros(2),
            offset=np.zeros(2),
            zmp=np.zeros(2),
        )
        self._senses = Senses(self.legs, self.times.period)
        self.step: Step | None = None

    def snapshot(self) -> Snapshot:
        """Return a copy of the whole state."""
        memory = Memory(*(array.copy() for array in self._memory))
        return Snapshot(self.goal, self.attitude, self.state, memory)

    def restore(self, moment: Snapshot) -> None:
        """Go on from a snapshot."""
        self.goal, self._senses.attitude, self.state, memory = moment
        self._memory = Memory(*(array.copy() for array in memory))

    @property
    def attitude(self) -> Attitude:
        """The trunk's orientation."""
        return self._senses.attitude

    @property
    def view(self) -> View | None:
        """What the latest tick saw; None before the first one."""
        return self._senses.view

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
        )
        return self._pose(upright)

    @property
    def standing(self) -> bool:
        """Whether the robot stands and nothing moves."""
        return self.state.phase == STAND

    @property
    def wants_stride(self) -> bool:
        """Whether the next tick begins a step, so that a goal must be given."""
        state, times = self.state, self.times
        shifted = state.phase == SHIFT and state.time >= times.shift - _SLACK_S
        made = state.phase == DOUBLE and state.time >= times.step - _SLACK_S
        return shifted or (made and self.goal.stops == 0.0)

    def begin_shift(self, left_support: bool) -> None:
        """Leave the stand: shift the weight over the foot that supports first."""
        if left_support != (self.state.side > 0):
            self.state = seen_from(self.state.lift_off, self.state)
        self.state = self.state._replace(phase=SHIFT, time=0.0)
        self._senses.leave_stand()

    def catch(self) -> bool:
        """Step at once where standing feet cannot hold the robot.

        Returns:
            Whether it steps; the next tick then wants a stride.
        """
        if self.state.phase not in (STAND, SETTLE, SHIFT):
            return False
        topples, swing = topples_at(self.legs, self.gains, self.times, self.state)
        if topples:
            if not swing:
                self.state = seen_from(self.state.lift_off, self.state)
            self.state = self.state._replace(phase=SHIFT, time=self.times.shift)
            self._senses.leave_stand()
        return bool(topples)

    def exchange(self, joints: Array) -> Step:
        """Take the landed foot as the support foot; measure the step just made."""
        self.step = Step(*measured_step(self.legs, joints, self.state.side))
        left_over = self.state.time - self.times.step
        landed = seen_from(self.state.landing, self.state)
        self.state = landed._replace(time=max(left_over, 0.0))
        return self.step

    def begin_step(self, goal: Goal) -> None:
        """Lift off towards a goal."""
        self.goal = goal
        self.state = self.state._replace(
            phase=SINGLE,
            time=0.0 if self.state.phase == SHIFT else self.state.time,
            landing=Foot(goal.length, -goal.width, goal.turn),
            first_zmp=_NOT_YET,
            rate=1.0,
        )

    def sense(self, sensors: Sensors) -> None:
        """Take the trunk's orientation from the sensors.

        What is learned while standing still is used while walking.
        """
        self._senses.sense(sensors, self.state, self.gains, self._memory.offset)

    def advance(self, sensors: Sensors) -> Array:
        """Return the servo targets of this control period, (2 n,) [rad]."""
        if self.state.phase == DOUBLE and self.goal.stops > 0.0:
            if self.state.time >= self.times.step - _SLACK_S:
                self.exchange(sensors.joint_position)
                self.state = self.state._replace(phase=SETTLE, time=0.0)
        elif self.state.phase == STAND and self._pushed:
            self.state = self.state._replace(phase=SETTLE, time=0.0)
        elif self.state.phase == SETTLE and self._at_rest():
            still = self.state.pelvis._replace(vx=0.0, vy=0.0)
            self.state = self.state._replace(phase=STAND, pelvis=still)
        senses = self._senses
        self.state, senses.view, targets = tick(
            self.legs,
            self.gains,
            self.times,
            self.goal,
            self.state,
            self.attitude,
            sensors.joint_position,
            sensors.joint_velocity,
            self._memory,
        )
        senses.targets = np.asarray(targets)
        return senses.targets.copy()

    @property
    def _pushed(self) -> bool:
        error, zone = self.state.error, self.gains.far_zone
        return abs(error.x) > zone.x or abs(error.y) > zone.y

    def _at_rest(self) -> bool:
        if self._pushed:
            return False
        pelvis = self.state.pelvis
        slow = math.hypot(pelvis.vx, pelvis.vy) < _AT_REST
        return slow or self.state.time > _LONGEST_SETTLE_S

    def _pose(self, state: GaitState) -> Array:
        """(2 n,) reference joint angles of a state under an upright trunk [rad]."""
        upright = Attitude(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        return np.asarray(
            pose_joints(
                self.legs,
                self.gains,
                self.times,
                self.goal,
                state,
                upright,
                np.zeros(2),
                self.legs.start,
            )
        )


def _at_rest(found: Posture) -> Array:
    """(2, 3, n, 3) links that do not move."""
    links = np.zeros((2, 3, *found.coms.shape[1:]))
    links[:, 0] = found.coms
    return links
