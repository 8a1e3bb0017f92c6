"""Strides walked in physics in closed loop: what each step cost and how far it went."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gaitchain.backends.mujoco import CONTROL_PERIOD_S, MujocoBackend
from gaitchain.balance.state import DOUBLE, SINGLE
from gaitchain.balance.walk_controller import Step, WalkController
from gaitchain.gait.motion import Timing
from gaitchain.gait.step_target import StepTarget
from gaitchain.gait.stride.strides import StridePoses
from gaitchain.messages import Array
from gaitchain.sim.world import World
from gaitchain.walker.stride_setup import make_walk

_BEFORE_S, _AFTER_S = 0.3, 1.5  # standing still before and after the steps
_LONGEST = 3.0  # of the planned time: a walk that takes longer hangs


class StepSums(NamedTuple):
    """What physics measured on each step of a walk; rows after a fall are partial."""

    terms: Array
    """(S, 4) means of the cost's terms, each 1 at its scale: ZMP, tracking, effort,
    and the turn of the support foot."""
    advance: Array
    """(S,) forward motion of the base [m]."""
    fell_in: int | None
    """Step of the fall."""


def walk_strides(
    poses: StridePoses, timing: Timing, gaits: NDArray[np.int64], world: World
) -> StepSums:
    """Walk linked gaits with balance, heading held by no one.

    Args:
        poses: the candidates.
        timing: the step's times.
        gaits: (S, 4) pose indices; the left foot supports first.
        world: the physics.

    Returns:
        The measurements.
    """
    walk, backend = make_walk(poses, timing), MujocoBackend(poses.biped, world)
    backend.connect(walk.stand)
    backend.stop_clock()
    meter = _Meter(poses, backend, len(gaits))
    planned_s = len(gaits) * timing.step + walk.times.shift
    ticks = round((_BEFORE_S + _LONGEST * planned_s) / CONTROL_PERIOD_S)

    def next_target(_: Step | None) -> StepTarget:
        passing, landing, stride = gaits[meter.begin(), 1:].tolist()
        return poses.goal(passing, landing, stride)

    after = 0
    for tick in range(ticks):
        sensors = backend.read()
        walk.sense(sensors)
        if tick == round(_BEFORE_S / CONTROL_PERIOD_S):
            walk.begin_shift(left_support=True)
            backend.start_clock()
        backend.write(walk.drive(sensors, next_target))
        meter.add(walk)
        if backend.fallen:
            return meter.result(fell_in=max(meter.step, 0))
        after += walk.standing and meter.step == len(gaits) - 1
        if after > _AFTER_S / CONTROL_PERIOD_S:
            break
    return meter.result(fell_in=None)


class _Meter:
    """Sums of the cost's terms, step by step."""

    def __init__(self, poses: StridePoses, backend: MujocoBackend, steps: int) -> None:
        biped = poses.biped
        self._backend = backend
        self._sums = np.zeros((steps, 4))
        self._ticks = np.zeros((steps, 2))
        self._start_x = np.full(steps + 1, np.nan)
        self._half_torque = 0.5 * biped.joint_torque_limit
        self._half_sole = 0.5 * biped.sole_length
        self._offset = np.array([biped.sole_offset, 0.0])
        self._yaw = 0.0
        self.step = -1
        """The latest step; -1 before the first."""

    def begin(self) -> int:
        """Begin the next step; return its number."""
        self.step += 1
        self._start_x[self.step] = self._backend.data.qpos[0]
        self._yaw = float(self._backend.foot_yaws()[self._support])
        return self.step

    def add(self, walk: WalkController) -> None:
        step, phase = self.step, walk.phase
        if step < 0 or phase not in (SINGLE, DOUBLE):
            return
        data, sums = self._backend.data, self._sums[step]
        self._ticks[step, 1] += 1
        error = data.qpos[7:] - walk.reference
        sums[1] += np.mean(error**2) / np.radians(3.0) ** 2
        sums[2] += np.mean((data.actuator_force / self._half_torque) ** 2)
        if phase == SINGLE:
            self._ticks[step, 0] += 1
            side = self._support
            yaw = self._backend.foot_yaws()[side]
            ankle = self._backend.foot_positions()[side, :2]
            ahead = np.array([math.cos(yaw), math.sin(yaw)]) * self._offset[0]
            off = self._backend.zmp() - ankle - ahead
            square = float(off @ off) / self._half_sole**2
            # No ground contact is as bad as a ZMP a whole sole away.
            sums[0] += 4.0 if math.isnan(square) else square
            sums[3] = ((yaw - self._yaw) / np.radians(15.0)) ** 2

    def result(self, fell_in: int | None) -> StepSums:
        self._start_x[-1] = self._backend.data.qpos[0]
        single, both = np.maximum(self._ticks, 1.0).T
        ones = np.ones_like(single)
        terms = self._sums / np.stack([single, both, both, ones], axis=1)
        return StepSums(terms, np.diff(self._start_x), fell_in)

    @property
    def _support(self) -> int:
        return self.step % 2
