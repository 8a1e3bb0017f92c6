"""Where the search for a step's shape begins: what the legs allow, without physics.

The plan alone tells how fast a robot can be made to step with its hips at a height:
long strides need bent knees; ankles that bend little and weak knees need straight ones.
Which stance is best, only physics tells: with feet far apart a robot sways. Ours.
"""

import math
from bisect import bisect
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from gaitchain.build.jobs import run_jobs
from gaitchain.build.knee_load import overload
from gaitchain.build.search_walks import Walk, fits, walk_of
from gaitchain.build.stride_feasibility import first_fault, joint_speeds
from gaitchain.errors import LibraryError
from gaitchain.gait.motion import Timing
from gaitchain.gait.stride.shape import StrideShape
from gaitchain.messages import GRAVITY
from gaitchain.robot.robot import Robot
from gaitchain.sim.disturbance import Span

Rhythm = Callable[[StrideShape], Timing]
"""Gives the step times for a shape."""
PACE = 0.3
"""Speed / sqrt(g leg) with which the search begins, where the plan can make it."""
_HIPS = np.linspace(0.78, 0.98, 11)  # of the leg
_STEPS_S = (0.36, 0.49)  # for a leg of length `LEG`
_STANCES = (1.0, 0.85, 0.7, 0.55)  # of the usual one
_APART = 1.3  # times the width of a sole: the narrowest stance
_PACES = (0.05, 0.1, 0.15, 0.2, 0.25, PACE)
_WORTH = 0.5  # part of a pace that the plan has to make with a hip height
_AHEAD = Walk(1.0)


class Plan(NamedTuple):
    """What the plan can make with a robot's legs."""

    usual: StrideShape
    """The shape to begin with where nothing speaks against it."""
    shapes: tuple[StrideShape, ...]
    """The same with other heights of the hips and step times."""
    paces: tuple[float, ...]
    """The fastest pace of each, up to `PACE`."""

    @property
    def pace(self) -> float:
        """The fastest of all."""
        return max(self.paces)

    def at(self, pace: float) -> StrideShape:
        """Return the shape that makes a pace, or most of it; of several the usual."""
        made = [min(most, pace) for most in self.paces]
        near = [-_off(shape, self.usual) for shape in self.shapes]
        return self.shapes[max(range(len(made)), key=lambda i: (made[i], near[i]))]

    def hips(self, pace: float) -> Span:
        """Return the heights that are worth a try at a pace, parts of the leg."""
        worth = [
            shape.hip_height
            for shape, most in zip(self.shapes, self.paces, strict=True)
            if most >= _WORTH * min(pace, self.pace)
        ]
        between = 0.5 * float(_HIPS[1] - _HIPS[0])  # heights that were tried
        return min(worth) - between, max(worth) + between

    def with_derived_gains(self) -> "Plan":
        """Return the same with all gains as they are derived from the robot."""
        usual, *shapes = (
            replace(shape, balance={}) for shape in (self.usual, *self.shapes)
        )
        return Plan(usual, tuple(shapes), self.paces)


def stances(robot: Robot, usual: StrideShape) -> list[StrideShape]:
    """Return the usual shape with its feet as far apart as usual, and closer.

    Args:
        robot: the robot.
        usual: the shape.
    """
    tried = (replace(usual, stance=part * usual.stance) for part in _STANCES)
    least = narrowest(robot)
    return [shape for shape in tried if shape == usual or shape.stance >= least]


def narrowest(robot: Robot) -> float:
    """Return the narrowest stance, part of that in which the robot's file stands."""
    return _APART * robot.reduced.sole_width / robot.reduced.hip_width


def plan_of(
    robot: Robot,
    usual: StrideShape,
    rhythm: Rhythm,
    speed_limit_deg_s: float | None,
    workers: int,
) -> Plan:
    """Find how fast the plan can walk, by the height of the hips and the step time.

    Args:
        robot: the robot.
        usual: the shape to begin with where nothing speaks against it.
        rhythm: gives the step times for a shape.
        speed_limit_deg_s: limit for all joints; None for those of the robot [deg/s].
        workers: number of processes.

    Raises:
        LibraryError: the plan can make no walk, however slow, at any height.
    """
    shapes = [usual] + [
        replace(usual, hip_height=round(hip, 4), step_s=step_s)
        for hip in _HIPS.tolist()
        for step_s in sorted({usual.step_s, *_STEPS_S})
    ]
    jobs = [(robot, shape, rhythm(shape), speed_limit_deg_s) for shape in shapes]
    paces = tuple(run_jobs(_plan_pace, jobs, float, workers))
    if not any(paces):
        raise LibraryError(_why_none(robot, usual, rhythm, speed_limit_deg_s))
    return Plan(usual, tuple(shapes), paces)


def _plan_pace(
    robot: Robot, shape: StrideShape, timing: Timing, limit: float | None
) -> float:
    """Return the fastest of the paces that the plan can make; 0 for none."""
    if overload(walk_of(robot, shape, timing.step, _AHEAD, 0.0)[0], timing):
        return 0.0

    def fails(pace: float) -> bool:
        return not fits(robot, shape, timing, _AHEAD, pace, limit)

    if not fails(PACE):
        return PACE
    made = bisect(_PACES[:-1], False, key=fails)
    return (0.0, *_PACES)[made]


def _off(shape: StrideShape, usual: StrideShape) -> float:
    """Return how far a shape is from the usual one."""
    hips, time = shape.hip_height - usual.hip_height, shape.step_s - usual.step_s
    return math.hypot(hips, time)


def _why_none(
    robot: Robot, usual: StrideShape, rhythm: Rhythm, limit: float | None
) -> str:
    """Say which limits the slowest walk breaks with the hips low, usual, and high."""
    slowest, speed = _AHEAD.times(_PACES[0]), joint_speeds(robot, limit)
    faults = []
    for hip in (float(_HIPS[0]), usual.hip_height, float(_HIPS[-1])):
        shape = replace(usual, hip_height=hip)
        timing = rhythm(shape)
        poses, _ = walk_of(robot, shape, timing.step, slowest, 1.0)
        fault = overload(poses, timing) or first_fault(poses, timing, speed)
        fault = fault or "its steps do not fit each other"
        faults.append(f"{hip:.2f} legs high, {fault}")
    speed_m_s = _PACES[0] * math.sqrt(GRAVITY * robot.reduced.leg_length)
    return (
        f"{robot.name} can make no walk, not even at {speed_m_s:.2f} m/s: with its "
        f"hips {'; '.join(faults)}. Give those joints more range, speed or torque in "
        "the robot file or its profile, if they have it; `gaitchain inspect FILE` "
        "shows the legs as they were found"
    )
