"""Rollout of strides in physics in closed loop: cost and advance of each step."""

import numpy as np
from numpy.typing import NDArray

from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.balance.state import DOUBLE, SINGLE
from gaitchain.build.step_meter import StepCounter, StepMeter, StepTerms
from gaitchain.gait.motion import Timing
from gaitchain.gait.step_target import Step, StepTarget
from gaitchain.gait.stride.strides import StridePoses
from gaitchain.messages import CONTROL_PERIOD_S
from gaitchain.sim.world import World
from gaitchain.walker.stride_setup import make_walk

_BEFORE_S, _AFTER_S = 0.3, 1.5  # standing still before and after the steps
_LONGEST = 3.0  # of the planned time: limit for a walk that never ends its last step


def walk_strides(
    poses: StridePoses, timing: Timing, gaits: NDArray[np.int64], world: World
) -> StepTerms:
    """Walk linked gaits with balance, heading free; see `GaitBuild.roll_out`."""
    backend = MujocoBackend(poses.robot, world)
    meter = StepMeter(poses.robot, backend, len(gaits))
    return meter.result(_walk(poses, timing, gaits, backend, meter))


def find_fall(
    poses: StridePoses, timing: Timing, gaits: NDArray[np.int64], world: World
) -> int | None:
    """Walk as `walk_strides`; return the index of the step with a fall, if any."""
    backend = MujocoBackend(poses.robot, world)
    return _walk(poses, timing, gaits, backend, StepCounter())


def _walk(
    poses: StridePoses,
    timing: Timing,
    gaits: NDArray[np.int64],
    backend: MujocoBackend,
    meter: StepCounter,
) -> int | None:
    """Walk and tell the meter of each step; return the step of a fall."""
    walk = make_walk(poses, timing)
    backend.connect(walk.stand)
    backend.stop_clock()
    planned_s = len(gaits) * timing.step + walk.times.shift
    ticks = round((_BEFORE_S + _LONGEST * planned_s) / CONTROL_PERIOD_S)

    goals = poses.step_targets(gaits[:, 1:].tolist())

    def next_target(_: Step | None) -> StepTarget:
        return goals[meter.begin()]

    after = 0
    for tick in range(ticks):
        sensors = backend.read()
        walk.sense(sensors)
        if tick == round(_BEFORE_S / CONTROL_PERIOD_S):
            walk.begin_shift(left_support=True)
            backend.start_clock()
        backend.write(walk.drive(sensors, next_target))
        if meter.step >= 0 and walk.phase in (SINGLE, DOUBLE):
            meter.add(
                walk.reference, single=walk.phase == SINGLE, error=walk.state.worst
            )
        if backend.fallen:
            return max(meter.step, 0)
        after += walk.standing and meter.step == len(gaits) - 1
        if after > _AFTER_S / CONTROL_PERIOD_S:
            break
    return None
