"""Measurement of the terms of a step's cost, the same for both families. Ours."""

import math
from typing import NamedTuple

import numpy as np

from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.messages import Array
from gaitchain.robot.robot import Robot

_TRACKING, _TURN = np.radians(3.0), np.radians(15.0)
_IN_THE_AIR = 4.0  # without ground contact, as for a ZMP one sole's length off


class StepTerms(NamedTuple):
    """Measurements of each step of a walk; from the step of a fall on incomplete."""

    terms: Array
    """(S, 4) means of the cost's terms, 1 at their scale, in the order of
    `rollout.Weights`."""
    advance: Array
    """(S,) forward motion of the base [m]."""
    error: Array
    """(S,) largest DCM error [m]; 0 for a gait that has none."""
    slip: Array
    """(S,) how far the support foot turned on the ground in single support [rad]."""
    fell_in: int | None
    """Index of the step in which the robot fell; None if it did not."""


class StepCounter:
    """Counts the steps of a walk, where only its fall matters."""

    step = -1
    """Index of the latest step; -1 before the first."""

    def begin(self) -> int:
        """Begin the next step; return its index."""
        self.step += 1
        return self.step

    def add(self, reference: Array, *, single: bool, error: float = 0.0) -> None:
        """Measure nothing, see `StepMeter.add`."""


class StepMeter(StepCounter):
    """Sums the terms of the cost, step by step; the left leg supports first."""

    def __init__(self, robot: Robot, backend: MujocoBackend, steps: int) -> None:
        """Start before the first step.

        Args:
            robot: the robot.
            backend: the simulator in which it walks.
            steps: number of steps of the walk.
        """
        self._backend = backend
        self._sums = np.zeros((steps, 4))
        self._ticks = np.zeros((steps, 2))
        self._start_x = np.full(steps + 1, np.nan)
        self._error, self._slip = np.zeros(steps), np.zeros(steps)
        self._half_torque = 0.5 * robot.legs.torque_limit  # of each joint
        self._half_sole, self._sole_offset = (
            0.5 * robot.reduced.sole_length,
            robot.reduced.sole_offset,
        )
        self._yaw = 0.0

    def begin(self) -> int:
        """Begin the next step; return its index."""
        super().begin()
        self._start_x[self.step] = self._backend.data.qpos[0]
        self._yaw = float(self._backend.foot_yaws()[self._side])
        return self.step

    def add(self, reference: Array, *, single: bool, error: float = 0.0) -> None:
        """Add one control period of the latest step.

        Args:
            reference: (2 n,) planned joint angles of this period [rad].
            single: whether the step is in single support.
            error: largest DCM error of the step until now [m].
        """
        self._error[self.step] = error
        data, sums = self._backend.data, self._sums[self.step]
        self._ticks[self.step] += single, 1
        off = self._backend.joints - reference
        sums[1] += np.mean(off**2) / _TRACKING**2
        sums[2] += np.mean((data.actuator_force / self._half_torque) ** 2)
        if single:
            yaw = float(self._backend.foot_yaws()[self._side])
            sums[0] += self._zmp_off(yaw)
            slip = abs(math.remainder(yaw - self._yaw, math.tau))
            self._slip[self.step], sums[3] = slip, (slip / _TURN) ** 2

    def result(self, fell_in: int | None) -> StepTerms:
        """Return the means of all steps.

        Args:
            fell_in: index of the step in which the robot fell, if any.
        """
        self._start_x[-1] = self._backend.data.qpos[0]
        single, both = np.maximum(self._ticks, 1.0).T
        ones = np.ones_like(single)
        terms = self._sums / np.stack([single, both, both, ones], axis=1)
        advance = np.diff(self._start_x)
        return StepTerms(terms, advance, self._error, self._slip, fell_in)

    @property
    def _side(self) -> int:
        """Index of the support foot: 0 left, 1 right."""
        return self.step % 2

    def _zmp_off(self, yaw: float) -> float:
        """Return the squared distance of the ZMP from the sole's centre, 1 at its end.

        Without ground contact it is `_IN_THE_AIR`.
        """
        ankle = self._backend.foot_positions()[self._side, :2]
        ahead = np.array([math.cos(yaw), math.sin(yaw)]) * self._sole_offset
        off = self._backend.zmp() - ankle - ahead
        square = float(off @ off) / self._half_sole**2
        return _IN_THE_AIR if math.isnan(square) else square
