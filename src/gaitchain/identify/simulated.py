"""Exercises in the simulator: of a hidden robot, to look at, and for the fit. Ours."""

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.errors import BackendError
from gaitchain.identify.log import ExerciseLog, Measured, MotionLog
from gaitchain.live.exercise import Motion, exercise
from gaitchain.messages import CONTROL_PERIOD_S, GRAVITY, Array, Sensors
from gaitchain.robot.robot import Robot
from gaitchain.robot.turn import turn_matrix
from gaitchain.sim.hidden_robot import draw_hidden_robot
from gaitchain.sim.world import World

_SWAYS = (1.0, 0.5, 0.25)  # parts of the motion, as a robot that falls tries less
_SETTLE_S = 1.5  # before a log begins
_LEAN_RAD = math.radians(2.0)  # by which a trunk that is held is off level at most


def exercise_hidden(robot: Robot, seed: int) -> ExerciseLog:
    """Let a hidden robot do its exercise; the log is all that is told of it.

    Its trunk is held a little off level, too.

    Args:
        robot: the robot of the file.
        seed: of the hidden robot, see `draw_hidden_robot`.

    Raises:
        BackendError: it fell.
    """
    world = World(**draw_hidden_robot(seed), seed=seed)
    lean = np.random.default_rng((seed, 1)).uniform(-_LEAN_RAD, _LEAN_RAD, 2)
    return run_exercise(robot.nominal, world, lean)


def run_exercise(robot: Robot, world: World, lean: Array) -> ExerciseLog:
    """Let a simulated robot do its exercise.

    Args:
        robot: the robot.
        world: it is held up, or stands, in this one.
        lean: (2,) roll and pitch of its trunk while it is held [rad].

    Raises:
        BackendError: it fell.
    """
    parts = []
    for motion in exercise(robot):
        for sway in _SWAYS:
            less = motion.smaller(sway)
            seen = replay(robot, less, lean, world)
            if len(seen.joint_position) == len(less.targets):
                break
        else:
            raise BackendError(
                f"{robot.name} falls even when it sways by {_SWAYS[-1]:.0%}: its zeros "
                "are off by too much to stand; calibrate it anew"
            )
        parts.append(MotionLog(less, seen))
    legs = robot.legs
    return ExerciseLog(
        robot.name, robot.fingerprint, legs.joint_names, CONTROL_PERIOD_S, tuple(parts)
    )


def replay(
    robot: Robot, motion: Motion, lean: Array, world: World | None = None
) -> Measured:
    """Send the targets of a motion to a simulated robot, up to a fall.

    Args:
        robot: the robot, with what was identified of it.
        motion: the targets.
        lean: (2,) roll and pitch of a trunk that is held [rad].
        world: the nominal one by default; held up or not as the motion needs.

    Returns:
        What was measured; of an IMU that was identified as late, between its rows.
    """
    robot, late_s = _with_prompt_imu(robot)
    backend = _settled(robot, motion, lean, world or World())
    rows = [
        (seen.joint_position, seen.angular_velocity, seen.acceleration, seen.time)
        for seen in _moved(backend, motion)
    ]
    joints, gyro, acceleration, times_s = map(np.array, zip(*rows, strict=True))
    unknown = np.full(len(rows), np.nan)
    seen = Measured(joints, gyro, acceleration, times_s, unknown)
    return _with_late_imu(seen, late_s) if late_s else seen


def _with_prompt_imu(robot: Robot) -> tuple[Robot, float]:
    """Return a robot whose IMU is not late, and how late that of the robot is [s]."""
    found = robot.identified
    if found is None or not found.imu_delay_s:
        return robot, 0.0
    return robot.as_identified(replace(found, imu_delay_s=0.0)), found.imu_delay_s


def _with_late_imu(seen: Measured, late_s: float) -> Measured:
    """Return rows whose gyro and accelerometer are those of a time before.

    Of a world they are late by whole control periods; a fit needs what lies between.
    """
    shown_s = seen.time_s - late_s

    def late(column: Array) -> Array:
        axes = [np.interp(shown_s, seen.time_s, axis) for axis in column.T]
        return np.stack(axes, axis=1)

    return replace(
        seen,
        angular_velocity=late(seen.angular_velocity),
        acceleration=late(seen.acceleration),
    )


class Preview(NamedTuple):
    """An exercise to be drawn, one motion after the other."""

    time_s: Array
    """(N,) [s]."""
    qpos: Array
    """(N, 7 + 2 n) positions in the model of the robot in the nominal world."""


def preview(robot: Robot) -> Preview:
    """Let a robot do its exercise in the nominal world, to be looked at beforehand.

    Args:
        robot: the robot of the file.

    Raises:
        BackendError: it fell, or its legs met.
    """
    rows = []
    for motion in exercise(robot):
        backend = _settled(robot, motion, np.zeros(2), World())
        came = [_apart(backend, robot.name) for _ in _moved(backend, motion)]
        if len(came) < len(motion.targets):
            raise BackendError(
                f"{robot.name} falls {len(came) * CONTROL_PERIOD_S:.1f} s after it "
                f"begins to sway, of {len(motion.targets) * CONTROL_PERIOD_S:.0f} s, "
                "with the file's numbers: no motor has moved, and none should; correct "
                "the file's masses, soles or servos"
            )
        rows += came
    return Preview(CONTROL_PERIOD_S * np.arange(len(rows), dtype=float), np.array(rows))


def _apart(backend: MujocoBackend, name: str) -> Array:
    """Return the positions of a robot whose legs do not touch each other.

    Raises:
        BackendError: they do; in simulation links pass through each other.
    """
    if backend.self_contact:
        raise BackendError(
            f"the legs of {name} meet in the exercise: no motor has moved, and none "
            "should; correct the shapes or the hips' width in the file, or narrow the "
            "limits of hip rolls and yaws in its profile"
        )
    return np.array(backend.truth().qpos)


def _settled(robot: Robot, motion: Motion, lean: Array, world: World) -> MujocoBackend:
    """Return a robot that is held up or stands, at rest where a motion begins."""
    held = motion.support == "held"
    backend = MujocoBackend(robot, replace(world, held=held))
    if held:
        upright = turn_matrix(np.array([*lean, 0.0])).T @ [0.0, 0.0, GRAVITY]
        backend.model.opt.gravity = -upright
    backend.connect(motion.targets[0])
    for _ in range(round(_SETTLE_S / CONTROL_PERIOD_S)):
        backend.write(motion.targets[0])
    return backend


def _moved(backend: MujocoBackend, motion: Motion) -> Iterator[Sensors]:
    """Send the targets, up to a fall; yield what is measured before each."""
    for target in motion.targets:
        yield backend.read()
        backend.write(target)
        if motion.support != "held" and backend.fallen:
            break
