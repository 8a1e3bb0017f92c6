"""An exercise on a real robot, period by period; torque off at its end. Ours."""

from collections.abc import Callable

import numpy as np

from gaitchain.backends.base import Backend
from gaitchain.build.progress import Progress
from gaitchain.identify.log import ExerciseLog, Measured, MotionLog
from gaitchain.live.clock import Clock
from gaitchain.live.exercise import Motion, Support, exercise
from gaitchain.live.joint_mover import JointMover
from gaitchain.live.servo_ranges import within_servos
from gaitchain.messages import CONTROL_PERIOD_S, Array
from gaitchain.robot.robot import Robot

_STAGES: dict[Support, str] = {
    "held": "swinging hung legs",
    "standing": "swaying on both feet",
}

Ready = Callable[[Motion], None]
"""Waits until a person has brought the robot into place for a motion."""
Sent = Callable[[Array], None]
"""Is told each target (2 n,) [rad] after it was sent."""


def exercise_servos(
    robot: Robot,
    backend: Backend,
    ready: Ready,
    progress: Progress,
    clock: Clock | None = None,
    sent: Sent | None = None,
    write_s: float = 0.0,
) -> ExerciseLog:
    """Let a robot do its exercise, as far as its servos may turn.

    What a servo left out because of its limits would be taken for play or a weak gain.
    The torque is off before each motion, and after the last one, whatever happens.

    Args:
        robot: as in its file.
        backend: the robot's servos; connected here.
        ready: called before each motion, with the torque off.
        progress: called with what is done, how far it is, and of how much.
        clock: the computer's by default.
        sent: told each target, if given.
        write_s: time that the targets take on the line after they were written [s].

    Raises:
        BackendError: a servo failed or did not answer, or the robot leaned too far.
    """
    clock, parts = clock or Clock(), []
    try:
        backend.connect(np.asarray(robot.legs.stand))
        able = within_servos(robot, backend)
        for motion in exercise(able):
            backend.release()
            ready(motion)
            mover = JointMover(
                able,
                backend,
                clock,
                CONTROL_PERIOD_S,
                what="the exercise",
                upright=motion.support == "standing",
                sent=sent,
            )
            moved = _run(mover, motion, progress)
            seen = _measured(mover, len(moved.targets), write_s, imu=backend.has_imu)
            parts.append(MotionLog(moved, seen))
    finally:
        backend.release()
        backend.close()
    names = robot.legs.joint_names
    return ExerciseLog(
        robot.name, robot.fingerprint, names, CONTROL_PERIOD_S, tuple(parts)
    )


def _run(mover: JointMover, motion: Motion, progress: Progress) -> Motion:
    """Go to a motion's begin slowly, and carry it out; return what was sent."""
    mover.begin()
    mover.go(motion.targets[0])
    sent = np.empty_like(motion.targets)
    for i, wanted in enumerate(motion.targets):
        progress(_STAGES[motion.support], i + 1, len(motion.targets))
        sent[i] = mover.send(wanted)
    return Motion(motion.support, sent)


def _measured(mover: JointMover, count: int, write_s: float, *, imu: bool) -> Measured:
    """Return the last rows; NaN where a joint did not answer, and without an IMU."""
    last = mover.seen[-count:]
    joints = np.array([s.joint_position for s in last])
    felt = np.array([(s.angular_velocity, s.acceleration) for s in last])
    gyro, acceleration = np.moveaxis(felt if imu else np.full_like(felt, np.nan), 1, 0)
    times_s = np.array([s.time for s in last])
    turnarounds_s = write_s + np.array(mover.turnarounds_s[-count:])
    return Measured(joints, gyro, acceleration, times_s, turnarounds_s)
