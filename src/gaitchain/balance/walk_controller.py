"""Walk strides: what the chain chose becomes motion, one control period after another.

Between control steps this is plain Python: standing, the first weight shift, taking the
next stride at the end of each step, and coming to a stand. No clock, no I/O.
"""

import math
from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

import numpy as np

from gaitchain.balance.control_step import control_step
from gaitchain.balance.feedforward import Effort
from gaitchain.balance.gains import Gains, open_loop
from gaitchain.balance.leg_kinematics import Legs
from gaitchain.balance.packed_state import OfRow, Row, new_row, part
from gaitchain.balance.reference_pose import standing_joints
from gaitchain.balance.standing import (
    memory_at_rest,
    standing_balance,
    standing_state,
)
from gaitchain.balance.state import (
    DOUBLE,
    NOT_YET,
    SETTLE,
    SHIFT,
    SINGLE,
    STAND,
    Attitude,
    Foot,
    GaitState,
    Memory,
    Pelvis,
    Planar,
    SoleLoads,
    StepTimes,
    View,
    seen_from,
)
from gaitchain.balance.state_estimation import StateEstimator
from gaitchain.balance.support_foot import measured_step
from gaitchain.gait.step_target import Step, StepTarget
from gaitchain.messages import GRAVITY, Array, Sensors

_SLACK_S = 1e-6
_AT_REST = 0.01  # m/s: a pelvis slower than this stands
_LONGEST_SETTLE_S = 2.0
_NOT_MEASURED = SoleLoads()
_IN_PLACE = StepTarget(0.0, 0.0, 0.0, 0.5, 1.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


NextTarget = Callable[[Step | None], StepTarget]
"""Chooses the next step; takes the one just made, or None before the first."""


class Snapshot(NamedTuple):
    """A walk at one moment, to be taken up again."""

    numbers: Row
    """(1,) row of the walk."""
    memory: Memory


class WalkController(OfRow):
    """The state of a walk, and what moves it on.

    `drive` is a control period in one call. Its parts, for callers that act in between:
    `exchange` and `begin_step` where it `wants_stride`, then `advance`.
    """

    attitude: Attitude = part("attitude")
    """The trunk's orientation."""
    crouch: float = part("state", "crouch_asked")
    """How far the hips are to go lower [m]."""
    phase: int = part("state", "phase")
    side: float = part("state", "side")
    """+1 while the left foot supports, else -1."""
    state: GaitState = part("state")
    """Where the walk is."""
    target: StepTarget = part("target")
    """What the chain chose for this step."""
    time: float = part("state", "time")
    """Since the phase's step began [s]."""
    view: View = part("measured")
    """The base as the latest control step measured it; 0 before the first one."""
    _com: Pelvis = part("com")
    _error: Planar = part("state", "error")
    _heel: float = part("state", "heel")
    _load: SoleLoads = part("load")
    _sole_zmp: Planar = part("sole_zmp")

    def __init__(
        self, legs: Legs, gains: Gains, times: StepTimes, *, feedback: bool = True
    ) -> None:
        """Stand with the feet together.

        Args:
            legs: the robot.
            gains: of the balance.
            times: the rhythm.
            feedback: whether to balance; else the plan alone is walked.
        """
        self.legs, self.times, self.feedback = legs, times, feedback
        self.gains = gains if feedback else open_loop(gains)
        self.numbers = new_row(self.gains, times)
        self._estimator = StateEstimator(legs, self.gains, times, self.numbers)
        self.reset()
        self._stand_targets = self._bearing()

    def reset(self) -> None:
        """Stand, upright, facing ahead."""
        self.numbers[:] = new_row(self.gains, self.times)
        width = self.legs.hip_width
        self.target = _IN_PLACE._replace(width=width, next_width=width)
        self.state = standing_state(self.legs, self.gains)
        self._stand = np.asarray(standing_joints(self.legs, self.numbers))
        self._memory, self._com = memory_at_rest(self.legs, self._stand.copy())
        self._load = _NOT_MEASURED
        self._load_known = False
        self._estimator.reset()
        self.step: Step | None = None

    def snapshot(self) -> Snapshot:
        """Return a copy of plan and reference, without what was estimated."""
        memory = Memory(*(array.copy() for array in self._memory))
        return Snapshot(self.numbers.copy(), memory)

    def restore(self, moment: Snapshot) -> None:
        """Go on from a snapshot."""
        self.numbers[:], memory = moment
        self._memory = Memory(*(array.copy() for array in memory))

    @property
    def effort(self) -> Effort:
        """What the latest reference needs beside its angles."""
        return Effort(self._memory.rates.copy(), self._memory.torques.copy())

    @property
    def gyro_bias(self) -> Array:
        """(3,) of the gyro, as stands and support feet showed it [rad/s]."""
        return self._estimator.gyro_bias

    @property
    def support_heading(self) -> float:
        """Heading of the support foot by gyro and joints, to the left [rad]."""
        return self.attitude.yaw + self.view.foot_yaw

    @property
    def zmp(self) -> Array:
        """(2,) ZMP that the latest targets are to produce, step frame [m]."""
        return np.array(self._sole_zmp)

    @property
    def reference(self) -> Array:
        """(2 n,) reference joint angles of the latest control step [rad]."""
        return self._memory.joints.copy()

    @property
    def stand(self) -> Array:
        """(2 n,) joint angles of the standing pose [rad]."""
        return self._stand.copy()

    @property
    def stand_targets(self) -> Array:
        """(2 n,) servo targets that keep `stand` under the robot's weight [rad]."""
        return self._stand_targets.copy()

    def _bearing(self) -> Array:
        """Return the targets of a robot that stands as planned, which bear its weight.

        Under the angles alone its knees would give way, and it would lean back.
        """
        memory = Memory(*(array.copy() for array in self._memory))
        still, numbers = np.zeros_like(self._stand), self.numbers.copy()
        targets = control_step(self.legs, numbers, self._stand, still, memory)
        return np.clip(targets, self.legs.lower, self.legs.upper)

    @property
    def standing(self) -> bool:
        """Whether the robot stands and nothing moves."""
        return self.phase == STAND

    @property
    def wants_stride(self) -> bool:
        """Whether this control period begins a step, so that a target must be given."""
        phase = self.phase
        if phase == SHIFT:
            return self.time >= self.times.shift - _SLACK_S
        return phase == DOUBLE and self._step_made and self.target.stops == 0.0

    @property
    def _step_made(self) -> bool:
        return self.time >= self.times.step - _SLACK_S

    def begin_shift(self, left_support: bool) -> None:
        """Leave the stand: shift the weight over the foot that supports first."""
        if left_support != (self.side > 0):
            self.state = seen_from(self.state.lift_off, self.state)
        self.state = self.state._replace(phase=SHIFT, time=0.0, worst=0.0, slip=0.0)
        self._estimator.leave_stand()

    def catch(self) -> bool:
        """Step at once where standing feet cannot hold the robot.

        Returns:
            Whether it steps; this control period then wants a stride.
        """
        if self.phase not in (STAND, SETTLE, SHIFT):
            return False
        balance = standing_balance(self.legs, self.numbers[0])
        if balance.is_capturable:
            return False
        if not balance.swing_steps:
            self.state = seen_from(self.state.lift_off, self.state)
        self.state = self.state._replace(phase=SHIFT, time=self.times.shift)
        self._estimator.leave_stand()
        return True

    def exchange(self, joints: Array) -> Step:
        """Take the landed foot as the support foot; measure the step just made.

        Args:
            joints: (2 n,) measured [rad].
        """
        self.step = Step(*measured_step(self.legs, joints, self.side, self._heel))
        left_over = self.time - self.times.step
        landed = seen_from(self.state.landing, self.state)
        self.state = landed._replace(time=max(left_over, 0.0))
        return self.step

    def begin_step(self, target: StepTarget) -> None:
        """Lift off towards a target."""
        self.target = target
        self.state = self.state._replace(
            phase=SINGLE,
            time=0.0 if self.phase == SHIFT else self.time,
            landing=Foot(target.length, -target.width, target.turn),
            first_zmp=NOT_YET,
            rate=1.0,
            worst=0.0,
            heading=math.nan,
            slip=0.0,
        )

    def sense(self, sensors: Sensors) -> None:
        """Take the trunk's orientation from the sensors.

        What is learned while standing still is used while walking.
        """
        self._estimator.update(sensors)
        if sensors.foot_load is not None:
            self._load = SoleLoads(*sensors.foot_load)
            self._load_known = True
        elif self._load_known:
            self._load = _NOT_MEASURED
            self._load_known = False

    def drive(self, sensors: Sensors, next_target: NextTarget) -> Array:
        """Return the servo targets of this control period, (2 n,) [rad].

        Args:
            sensors: of this control period; `sense` comes before, where there is an
                IMU.
            next_target: asked where a step begins, after the feet were exchanged. It
                takes the step just made, by the encoders or, without feedback, by the
                plan.
        """
        if self.wants_stride:
            measured = sensors.joint_position if self.feedback else self.reference
            made = self.exchange(measured) if self.phase == DOUBLE else None
            self.begin_step(next_target(made))
        return self.advance(sensors)

    def advance(self, sensors: Sensors) -> Array:
        """Return the servo targets of this period within a step, (2 n,) [rad]."""
        self._change_phase(sensors)
        targets = control_step(
            self.legs,
            self.numbers,
            sensors.joint_position,
            sensors.joint_velocity,
            self._memory,
        )
        self._estimator.targets = targets
        return targets.copy()

    def _change_phase(self, sensors: Sensors) -> None:
        """Come to a stand, or leave it for a push."""
        phase = self.phase
        if phase == DOUBLE:
            if self._step_made and self.target.stops > 0.0:
                self.exchange(sensors.joint_position)
                self.state = self.state._replace(phase=SETTLE, time=0.0)
        elif phase == STAND and self._pushed:
            self.state = self.state._replace(phase=SETTLE, time=0.0)
        elif phase == SETTLE and self._at_rest():
            still = self.state.pelvis._replace(vx=0.0, vy=0.0)
            self.state = self.state._replace(phase=STAND, pelvis=still)

    @property
    def _pushed(self) -> bool:
        error, zone = self._error, self.gains.far_zone
        return abs(error.x) > zone.x or abs(error.y) > zone.y

    def _at_rest(self) -> bool:
        if self._pushed:
            return False
        pelvis = self.state.pelvis
        slow = math.hypot(pelvis.vx, pelvis.vy) < _AT_REST
        return slow or self.time > _LONGEST_SETTLE_S


def rehearse(walk: WalkController, targets: Iterable[StepTarget]) -> Iterator[Array]:
    """Walk the plan alone: the sensors report the reference, without a robot.

    Begins where the walk is, in a weight shift or at the end of a step; ends where it
    comes to rest, or wants a stride after the last target.

    Args:
        walk: moved on by one control period for each item.
        targets: of the steps to make.

    Yields:
        (2 n,) reference joint angles before the period [rad].
    """
    coming = list(targets)
    still, upright = np.zeros(3), np.array([0.0, 0.0, GRAVITY])
    before = walk.reference
    while walk.phase not in (STAND, SETTLE) and (coming or not walk.wants_stride):
        joints = walk.reference
        rates = (joints - before) / walk.times.period
        sensors = Sensors(0.0, joints, rates, still, upright)
        walk.drive(sensors, lambda _: coming.pop(0))
        yield joints
        before = joints
