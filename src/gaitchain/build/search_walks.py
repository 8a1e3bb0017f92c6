"""The walks in physics by which shapes of a step are compared. Ours."""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gaitchain.build.stride_feasibility import feasible_walk, joint_speeds
from gaitchain.build.stride_rollout import find_fall
from gaitchain.gait.motion import Timing
from gaitchain.gait.stride.draw import shaped_poses
from gaitchain.gait.stride.shape import StrideShape
from gaitchain.gait.stride.strides import StridePoses
from gaitchain.messages import GRAVITY
from gaitchain.robot.robot import Robot
from gaitchain.sim.push import Push
from gaitchain.sim.world import World
from gaitchain.sim.world_range import WorldRange

FAST = 0.8
"""Part of the pace: walks that are faster tell whether it is held."""
PUSH = 0.25
"""Impulse over m sqrt(g leg) of the hard pushes with which a search begins."""
LOOSE = 4.0
"""Stiffness of a waist over m g h; 22 is G1, 3.4 G1 with soft servos."""
_LONG, _SHORT = 40, 20  # steps of a walk ahead, where a sway has to grow, and of others
_CHECKED = 11  # steps that the plan makes: begin, three cycles, and end
_FALL = 0.5  # what a walk is worth that ends with a fall, at most
_SLIPPERY, _LATE_S = 0.4, 0.04  # friction; delay of the servos' targets
_SMALLER = (1.0, 0.75, 0.5, 0.25)  # parts of a walk that the plan cannot make


class Walk(NamedTuple):
    """A walk of the search."""

    ahead: float
    """Speed, part of the pace."""
    outward: float = 0.0
    """In every second step, part of the leg."""
    turn: float = 0.0
    """The same [rad]."""
    pushed: bool = False
    """Whether it is pushed hard; the others as the world is."""
    slippery: bool = False
    """Whether the floor is: a foot slips on with every step."""
    delayed: bool = False
    """Whether the servos get their targets late."""
    loose: bool = False
    """Whether the waist gives way."""

    @property
    def steps(self) -> int:
        """Number of steps."""
        in_place = not (self.ahead or self.outward)
        slow_to_show = self.slippery or self.loose or in_place
        return _LONG if self.ahead > FAST or slow_to_show else _SHORT

    def times(self, part: float) -> "Walk":
        """Return the same walk with steps of a part of their size."""
        ahead, outward, turn = self.ahead, self.outward, self.turn
        return self._replace(
            ahead=part * ahead, outward=part * outward, turn=part * turn
        )


# The first ones tell shapes apart best. In place a robot sways most.
WALKS = (
    Walk(1.0),
    Walk(1.2),
    Walk(0.5, pushed=True),
    Walk(0.65, slippery=True),
    Walk(0.6, loose=True),
    Walk(0.85, delayed=True),
    Walk(0.0),
    Walk(1.1),
    Walk(1.35),
    *2 * (Walk(0.5, pushed=True),),
    Walk(0.65, slippery=True),
    Walk(-0.45),
    Walk(0.0, outward=0.25),
    Walk(0.3, turn=0.3, delayed=True),
    Walk(0.9, loose=True),
)


def draw_worlds(
    robot: Robot, worlds: WorldRange, push: float, rng: np.random.Generator
) -> list[World]:
    """Draw a world for each of the `WALKS`.

    Args:
        robot: the robot.
        worlds: those of training.
        push: impulse over m sqrt(g leg) of the hard pushes.
        rng: source of randomness.
    """
    hard = worlds.harder()
    scale = robot.reduced.mass * math.sqrt(GRAVITY * robot.reduced.leg_length)
    drawn = []
    for walk in WALKS:
        world = hard.draw(rng)
        if walk.pushed:
            direction = float(rng.uniform(-180.0, 180.0))
            hard_push = Push(push * scale, direction, float(rng.uniform(2.0, 4.0)))
            world = replace(world, push=(hard_push,))
        if walk.slippery:
            world = replace(world, friction=_SLIPPERY)
        if walk.delayed:
            world = replace(world, delay_s=_LATE_S)
        if walk.loose:
            world = replace(world, waist=LOOSE)
        drawn.append(world)
    return drawn


def steps_held(
    robot: Robot,
    shape: StrideShape,
    timing: Timing,
    walk: Walk,
    pace: float,
    world: World,
) -> float:
    """Return the part of a walk's steps before a fall.

    Of a walk whose steps the plan cannot make, the largest part that it can is walked,
    and counts as much: so a search is told which way to go.

    Args:
        robot: the robot.
        shape: of its steps.
        timing: of its steps [s].
        walk: what is walked.
        pace: speed ahead that counts as 1, over sqrt(g leg).
        world: the world.

    Returns:
        0 to 1; a walk with a fall is worth half of that part.
    """
    for part in _SMALLER:
        less = walk.times(part)
        if fits(robot, shape, timing, less, pace, world.speed_limit_deg_s):
            poses, gaits = walk_of(robot, shape, timing.step, less, pace)
            fell_in = find_fall(poses, timing, gaits, world)
            return part * (1.0 if fell_in is None else _FALL * fell_in / len(gaits))
    return 0.0


def fits(
    robot: Robot,
    shape: StrideShape,
    timing: Timing,
    walk: Walk,
    pace: float,
    speed_limit_deg_s: float | None,
) -> bool:
    """Return whether the plan can make a walk's steps, of equal ones the first.

    Arguments are those of `steps_held`, and the joints' speed limit [deg/s]; None for
    the robot's own.
    """
    poses, gaits = walk_of(robot, shape, timing.step, walk, pace, _CHECKED)
    speed = joint_speeds(robot, speed_limit_deg_s)
    return feasible_walk(poses, timing, gaits, speed)


def walk_of(
    robot: Robot,
    shape: StrideShape,
    step_s: float,
    walk: Walk,
    pace: float,
    steps: int | None = None,
) -> tuple[StridePoses, NDArray[np.int64]]:
    """Return the strides and the gaits of a walk from standing to standing.

    The strides are standing, one and two thirds of the length, with which it begins and
    ends, and the two of a cycle: the first one may go outward and turn, the second one
    follows.

    Args:
        robot: the robot.
        shape: of its steps.
        step_s: time of a step [s].
        walk: what is walked.
        pace: speed ahead that counts as 1, over sqrt(g leg).
        steps: number of steps; as many as the walk asks for by default.

    Returns:
        The strides, and (steps, 4) poses of each step by layer.
    """
    leg = robot.reduced.leg_length
    length = walk.ahead * pace * math.sqrt(GRAVITY * leg) * step_s
    strides = np.array(
        [
            (0.0, 0.0, 0.0),
            (length / 3, 0.0, 0.0),
            (length / 1.5, 0.0, 0.0),
            (length, walk.outward * leg, walk.turn),
            (length, 0.0, 0.0),
        ]
    )
    poses = shaped_poses(robot, shape, strides)
    return poses, _there_and_back(steps or walk.steps)


def _there_and_back(steps: int) -> NDArray[np.int64]:
    """Return the gaits of a walk that begins, cycles between two strides, and ends."""
    lasts = [1, 2, *(3 + i % 2 for i in range(steps - 5)), 2, 1, 0]
    gaits = [
        (first, 0, 0, last) for first, last in zip([0, *lasts], lasts, strict=False)
    ]
    return np.array(gaits, dtype=np.int64)
