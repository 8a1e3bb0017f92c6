"""An exercise on a real robot, period by period; torque off at its end. Ours."""

import math
from collections.abc import Callable

import numpy as np

from gaitchain.backends.base import Backend
from gaitchain.errors import BackendError
from gaitchain.identify.exercise import Motion, Support, exercise
from gaitchain.identify.log import ExerciseLog, Measured, MotionLog
from gaitchain.live.clock import Clock, Pacer
from gaitchain.live.joint_motion import JointLimiter, SmoothMove
from gaitchain.messages import CONTROL_PERIOD_S, GRAVITY, Array, Sensors
from gaitchain.robot.robot import Robot

_MOST_LEAN_DEG = 25.0  # of a robot that stands
_FOLLOW = 0.05  # of the difference in each period: 0.2 s, longer than a knock
_SILENT_S = 0.25  # without an answer of a joint, after which the exercise ends

Ready = Callable[[Support], None]
"""Waits until a person has brought the robot into place."""
Tell = Callable[[str, int, int], None]


def exercise_servos(
    robot: Robot,
    backend: Backend,
    ready: Ready,
    tell: Tell,
    clock: Clock | None = None,
) -> ExerciseLog:
    """Let a robot do its exercise.

    The torque is off before each motion, and after the last one, whatever happens.

    Args:
        robot: as in its file.
        backend: the robot's servos; connected here.
        ready: called before each motion, with the torque off.
        tell: called with what is done, how far it is, and of how much.
        clock: the computer's by default.

    Raises:
        BackendError: a servo failed or did not answer, or the robot leaned too far.
    """
    clock, parts = clock or Clock(), []
    backend.connect(np.asarray(robot.legs.stand))
    try:
        for motion in exercise(robot):
            backend.release()
            ready(motion.support)
            parts.append(_Runner(robot, backend, motion, clock).run(tell))
    finally:
        backend.release()
        backend.close()
    names = robot.legs.joint_names
    return ExerciseLog(
        robot.name, robot.fingerprint, names, CONTROL_PERIOD_S, tuple(parts)
    )


class _Runner:
    """One motion on one robot."""

    def __init__(
        self, robot: Robot, backend: Backend, motion: Motion, clock: Clock
    ) -> None:
        self._names, self._backend = robot.legs.joint_names, backend
        self._motion, self._clock = motion, clock
        self._limiter = JointLimiter(robot.legs, CONTROL_PERIOD_S)
        self._seen: list[Sensors] = []
        self._heard_s = np.zeros(len(self._names))
        self._up = np.array([0.0, 0.0, GRAVITY])
        self._pacer = Pacer(clock, CONTROL_PERIOD_S)

    def run(self, tell: Tell) -> MotionLog:
        """Go to the motion's begin slowly, and carry it out."""
        backend, targets = self._backend, self._motion.targets
        target = self._where()
        backend.engage()
        move, moved_s = SmoothMove(target, targets[0]), 0.0
        self._pacer = Pacer(self._clock, CONTROL_PERIOD_S)
        self._heard_s[:] = self._clock.now()
        while not move.done(moved_s):
            moved_s += CONTROL_PERIOD_S
            target = self._send(move.at(moved_s), target)
        self._seen.clear()
        stage = {"held": "swinging hung legs", "standing": "swaying on both feet"}
        for i, wanted in enumerate(targets):
            tell(stage[self._motion.support], i + 1, len(targets))
            target = self._send(wanted, target)
        return MotionLog(self._motion, _measured(self._seen, imu=backend.has_imu))

    def _where(self) -> Array:
        """Return where all joints are."""
        begin = self._clock.now()
        while self._clock.now() < begin + _SILENT_S:
            seen = self._backend.read().joint_position
            if np.isfinite(seen).all():
                return np.array(seen)
        missing = [n for n, q in zip(self._names, seen, strict=True) if np.isnan(q)]
        raise BackendError(f"{', '.join(missing)}: no answer; check cables and power")

    def _send(self, wanted: Array, before: Array) -> Array:
        """Wait for the next period, measure and send; return what was sent."""
        self._pacer.wait()
        seen = self._backend.read()
        self._check(seen)
        self._seen.append(seen)
        target, _ = self._limiter.limit(wanted, before)
        self._backend.write(target)
        return target

    def _check(self, seen: Sensors) -> None:
        fault = self._backend.health().fault
        if fault:
            raise BackendError(f"the exercise ended: {fault}")
        now_s, heard = self._clock.now(), np.isfinite(seen.joint_position)
        self._heard_s[heard] = now_s
        silent = now_s - self._heard_s > _SILENT_S
        if silent.any():
            name = self._names[int(np.argmax(silent))]
            raise BackendError(
                f"the exercise ended: {name} has not answered for 0.25 s"
            )
        if self._motion.support == "standing" and self._backend.has_imu:
            self._up += _FOLLOW * (seen.acceleration - self._up)
            lean_deg = math.degrees(math.acos(_level(self._up)))
            if lean_deg > _MOST_LEAN_DEG:
                raise BackendError(
                    f"the exercise ended: the robot leans by {lean_deg:.0f} deg, at "
                    f"most {_MOST_LEAN_DEG:.0f}; stand it up, or mend its zeros first"
                )


def _level(up: Array) -> float:
    """Return the cosine of the angle between the trunk's axis and gravity."""
    return float(np.clip(up[2] / max(float(np.linalg.norm(up)), 1e-6), -1.0, 1.0))


def _measured(seen: list[Sensors], *, imu: bool) -> Measured:
    """Return all rows; where a joint did not answer, its last angle; no IMU as NaN."""
    joints = np.array([s.joint_position for s in seen])
    for row in range(1, len(joints)):
        joints[row] = np.where(np.isnan(joints[row]), joints[row - 1], joints[row])
    gyro = np.array([s.angular_velocity for s in seen])
    felt = np.array([s.acceleration for s in seen])
    gone = np.full_like(gyro, np.nan)
    return Measured(joints, gyro if imu else gone, felt if imu else gone)
