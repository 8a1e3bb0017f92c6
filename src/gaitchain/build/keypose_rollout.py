"""Rollout of key poses in physics: cost and forward motion of each step."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.build.step_meter import StepMeter, StepTerms
from gaitchain.gait.family import STAND
from gaitchain.gait.keypose.key_poses import KeyPoses
from gaitchain.gait.motion import StepMotion, Timing
from gaitchain.messages import CONTROL_PERIOD_S, Array
from gaitchain.robot.joint_angles import joint_angles
from gaitchain.sim.world import World

_BEFORE_S, _AFTER_S = 0.5, 1.0  # standing still before and after the steps


def walk_key_poses(
    poses: KeyPoses, timing: Timing, gaits: NDArray[np.int64], world: World
) -> StepTerms:
    """Walk linked gaits in open loop, so that the cost is that of the plan.

    Arguments are those of `GaitBuild.roll_out`.
    """
    backend = MujocoBackend(poses.robot, world)
    steps, ticks = len(gaits), round(timing.step / CONTROL_PERIOD_S)
    single = round((timing.rise + timing.fall) / CONTROL_PERIOD_S)
    meter = StepMeter(poses.robot, backend, steps)
    targets = walk_targets(poses, timing, gaits)
    backend.connect(targets[0])
    for tick, target in enumerate(targets, -round(_BEFORE_S / CONTROL_PERIOD_S)):
        step, phase = divmod(tick, ticks)
        if 0 <= step < steps:
            if phase == 0:
                meter.begin()
            meter.add(target, single=phase < single)
        backend.write(target)
        if backend.fallen:
            return meter.result(fell_in=min(max(step, 0), steps - 1))
    return meter.result(fell_in=None)


def walk_targets(poses: KeyPoses, timing: Timing, gaits: NDArray[np.int64]) -> Array:
    """Return the servo targets of a walk, standing before and after it.

    Args:
        poses: the candidates.
        timing: the step's times.
        gaits: (S, 4) pose indices; the left leg supports first.

    Returns:
        (N, 12) joint angles, one row per control period [rad].
    """
    stand = joint_angles(poses.q[0][STAND], left_support=True)
    before, after = (
        np.tile(stand, (round(rest_s / CONTROL_PERIOD_S), 1))
        for rest_s in (_BEFORE_S, _AFTER_S)
    )
    return np.concatenate([before, *_steps(poses, timing, gaits), after])


def _steps(
    poses: KeyPoses, timing: Timing, gaits: NDArray[np.int64]
) -> Iterator[Array]:
    ticks = round(timing.step / CONTROL_PERIOD_S)
    time_s: Array = np.arange(ticks, dtype=np.float64) * CONTROL_PERIOD_S
    for step, gait in enumerate(gaits):
        q = np.stack([poses.q[layer][n] for layer, n in enumerate(gait)])
        dq = np.stack([poses.dq[layer][n] for layer, n in enumerate(gait)])
        q_t = StepMotion(timing.key_times, q, dq).at(time_s).q
        yield joint_angles(q_t, left_support=step % 2 == 0)
