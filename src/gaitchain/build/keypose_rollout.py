"""Rollout of key poses in physics: cost and forward motion of each step."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.balance.pose_joints import PoseJoints
from gaitchain.build.step_meter import StepMeter, StepTerms
from gaitchain.gait.family import STAND
from gaitchain.gait.keypose.key_poses import KeyPoses
from gaitchain.gait.motion import Timing
from gaitchain.messages import CONTROL_PERIOD_S, Array
from gaitchain.sim.world import World
from gaitchain.walker.keypose_feedback import make_balance

_BEFORE_S, _AFTER_S = 0.5, 1.0  # standing still before and after the steps


def walk_key_poses(
    poses: KeyPoses, timing: Timing, gaits: NDArray[np.int64], world: World
) -> StepTerms:
    """Walk linked gaits: boxes in open loop, so that the cost is that of the plan.

    A robot that was read from a file balances, as narrow soles do not stand otherwise.
    Arguments are those of `GaitBuild.roll_out`.
    """
    backend = MujocoBackend(poses.robot, world)
    steps, ticks = len(gaits), round(timing.step / CONTROL_PERIOD_S)
    single = round((timing.rise + timing.fall) / CONTROL_PERIOD_S)
    meter = StepMeter(poses.robot, backend, steps)
    planned = walk_targets(poses, timing, gaits)
    servos = _Servos(poses, planned[0], backend)
    backend.connect(planned[0])
    for tick, angles in enumerate(planned, -round(_BEFORE_S / CONTROL_PERIOD_S)):
        step, phase = divmod(tick, ticks)
        walking, step = 0 <= step < steps, min(max(step, 0), steps - 1)
        if walking:
            if phase == 0:
                meter.begin()
            meter.add(angles, single=phase < single)
        alone = walking and phase < single
        servos.write(angles, left=step % 2 == 0, single=alone, still=not walking)
        if backend.fallen:
            return meter.result(fell_in=step)
    return meter.result(fell_in=None)


class _Servos:
    """Sends a plan to the servos, with balance if the robot was read from a file."""

    def __init__(self, poses: KeyPoses, stand: Array, backend: MujocoBackend) -> None:
        self._backend, robot = backend, poses.robot
        height = float(poses.parameters[0][STAND][1])
        self._balance = (
            None
            if robot.of_boxes
            else make_balance(robot, height, CONTROL_PERIOD_S, stand)
        )

    def write(self, planned: Array, *, left: bool, single: bool, still: bool) -> None:
        """Send the targets of one control period."""
        if self._balance is not None:
            planned = self._balance.correct(
                planned, self._backend.read(), left=left, single=single, still=still
            )
        self._backend.write(planned)


def walk_targets(poses: KeyPoses, timing: Timing, gaits: NDArray[np.int64]) -> Array:
    """Return the planned joint angles of a walk, standing before and after it.

    Args:
        poses: the candidates.
        timing: the step's times.
        gaits: (S, 4) pose indices; the left leg supports first.

    Returns:
        (N, 2 n) joint angles, one row per control period [rad].
    """
    joints = PoseJoints(poses.robot)
    stand = joints.angles(poses.q[0][STAND], left_support=True)
    before, after = (
        np.tile(stand, (round(rest_s / CONTROL_PERIOD_S), 1))
        for rest_s in (_BEFORE_S, _AFTER_S)
    )
    return np.concatenate([before, *_steps(poses, joints, timing, gaits), after])


def _steps(
    poses: KeyPoses, joints: PoseJoints, timing: Timing, gaits: NDArray[np.int64]
) -> Iterator[Array]:
    ticks = round(timing.step / CONTROL_PERIOD_S)
    time_s: Array = np.arange(ticks, dtype=np.float64) * CONTROL_PERIOD_S
    for step, gait in enumerate(gaits):
        q_t = poses.motion(gait, timing).at(time_s).q
        yield joints.angles(q_t, left_support=step % 2 == 0)
