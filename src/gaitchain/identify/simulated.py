"""Exercises in the simulator: of a hidden robot, and replays for the fit. Ours."""

import math
from dataclasses import replace
from typing import Any

import numpy as np

from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.errors import BackendError
from gaitchain.identify.log import ExerciseLog, Measured, MotionLog
from gaitchain.live.exercise import Motion, exercise
from gaitchain.messages import CONTROL_PERIOD_S, GRAVITY, Array
from gaitchain.robot.robot import Robot
from gaitchain.sim.hidden_robot import draw_hidden_robot
from gaitchain.sim.world import World
from gaitchain.walker.mounting import turned

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
    """
    held = motion.support == "held"
    backend = MujocoBackend(robot, replace(world or World(), held=held))
    if held:
        upright = turned(np.array([*lean, 0.0])).T @ [0.0, 0.0, GRAVITY]
        backend.model.opt.gravity = -upright
    backend.connect(motion.targets[0])
    for _ in range(round(_SETTLE_S / CONTROL_PERIOD_S)):
        backend.write(motion.targets[0])
    rows: list[tuple[Any, ...]] = []
    for target in motion.targets:
        seen = backend.read()
        rows.append((seen.joint_position, seen.angular_velocity, seen.acceleration))
        backend.write(target)
        if backend.fallen and not held:
            break
    return Measured(*(np.array(column) for column in zip(*rows, strict=True)))
