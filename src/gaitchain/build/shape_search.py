"""Search for a robot's step time, crouch, step height and gains by walks in physics.

It is the cross-entropy method [Rubinstein99]: draw shapes around the current mean, walk
each in different worlds, move the mean to that of the best quarter, and repeat. Ours.
"""

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gaitchain.build.jobs import run_jobs
from gaitchain.build.stride_feasibility import feasible_pairs, joint_speeds
from gaitchain.build.stride_rollout import walk_strides
from gaitchain.build.workers import Crew
from gaitchain.gait.motion import Timing
from gaitchain.gait.stride.shape import LANDING, StrideShape
from gaitchain.gait.stride.strides import StridePoses
from gaitchain.messages import GRAVITY, Array
from gaitchain.robot.robot import Robot
from gaitchain.sim.world import Push, World
from gaitchain.sim.world_range import WorldRange

Rhythm = Callable[[StrideShape], Timing]
_Course = tuple[float, float, float]
GENERATIONS = 5
STAGE = "searching the step's shape"
_DRAWN, _KEPT = 20, 5  # shapes drawn and selected in a generation
_FINALS, _BETTER = 4, 0.01  # rounds in new worlds, where the found shape must be better
_STEPS = 20  # of a walk
_SPREAD, _LEAST_SPREAD, _RENEWED = 0.2, 0.05, 0.8
# Range of each number that is searched; gains are factors on those of the start.
_RANGES = {
    "step_s": (0.34, 0.5),
    "hip_height": (0.82, 0.94),
    "lift": (0.045, 0.09),
    "trunk": (0.6, 1.5),
    "ankle": (0.5, 2.0),
    "follow": (0.5, 1.6),
    "swing_tilt": (0.7, 1.4),
    "dead_zone": (0.2, 1.2),
}
_OF_SHAPE = ("step_s", "hip_height", "lift")
_HARD_PUSH = 0.25  # part of m sqrt(g leg): what about half of the walks hold
_PUSHED = 4 * ((0.16, 0.0, 0.0),)
"""Walks with a push of this size; in the others pushes are those of the world."""
# Walks: speed ahead / sqrt(g leg); in every second step, distance outward / leg and
# turn [rad].
_WALKS = (
    (0.12, 0.0, 0.0),
    (0.2, 0.0, 0.0),
    (0.26, 0.0, 0.0),
    (0.32, 0.0, 0.0),
    (0.38, 0.0, 0.0),
    (-0.14, 0.0, 0.0),
    (0.0, 0.15, 0.0),
    (0.1, 0.0, 0.3),
    *_PUSHED,
)


class _Task(NamedTuple):
    """Data common to all walks of a search."""

    robot: Robot
    crew: Crew
    rhythm: Rhythm


def search_shape(
    robot: Robot,
    rng: np.random.Generator,
    crew: Crew,
    *,
    start: StrideShape,
    generations: int = GENERATIONS,
    seconds: float = math.inf,
    rhythm: Rhythm | None = None,
) -> StrideShape:
    """Search for the shape with which a robot makes most steps without a fall.

    The result does not depend on the workers; it depends on the machine's speed only if
    the time limit is reached. The start shape is kept unless the found one is clearly
    better in new worlds.

    Args:
        robot: the robot.
        rng: source of randomness.
        crew: processes and worlds.
        start: the shape to begin with.
        generations: rounds of the search; 0 returns `start`.
        seconds: time after which no further generation begins [s].
        rhythm: gives the step times for a shape, `StrideShape.timing` by default; T is
            searched only if it changes with the shape.

    Returns:
        The best shape.
    """
    if not generations:
        return start
    task = _Task(robot, crew, rhythm or partial(StrideShape.timing, robot=robot))
    ends_s = [replace(start, step_s=end) for end in _RANGES["step_s"]]
    given = len({task.rhythm(end).step for end in ends_s}) == 1
    names = [n for n in _RANGES if not (given and n == "step_s")]
    low, high = np.array([_RANGES[name] for name in names]).T
    own = np.array([_number(start, name) for name in names])
    mean, spread = (own - low) / (high - low), np.full(len(low), _SPREAD)
    done, total = 0, generations * _DRAWN + 2 * _FINALS
    end_s = time.monotonic() + seconds
    for _ in range(generations):
        if time.monotonic() > end_s:
            break
        points = np.clip(rng.normal(mean, spread, (_DRAWN, len(mean))), 0.0, 1.0)
        points[0] = np.clip(mean, 0.0, 1.0)
        shapes = [_shape(start, names, low + p * (high - low)) for p in points]
        scores = []
        for score in _score(task, shapes, int(rng.integers(2**31))):
            scores.append(score)
            done += 1
            crew.tell(STAGE, done, total)
        kept = points[np.argsort(scores)[::-1][:_KEPT]]
        mean = mean + _RENEWED * (kept.mean(axis=0) - mean)
        found = spread + _RENEWED * (kept.std(axis=0) - spread)
        spread = np.maximum(found, _LEAST_SPREAD)
    ends = [start, _shape(start, names, low + np.clip(mean, 0.0, 1.0) * (high - low))]
    sums, done = np.zeros(2), total - 2 * _FINALS
    for _ in range(_FINALS):
        sums += list(_score(task, ends, int(rng.integers(2**31))))
        done += 2
        crew.tell(STAGE, done, total)
    return ends[int(sums[1] > sums[0] + _FINALS * _BETTER)]


def _number(shape: StrideShape, name: str) -> float:
    return float(getattr(shape, name)) if name in _OF_SHAPE else 1.0


def _shape(start: StrideShape, names: list[str], numbers: Array) -> StrideShape:
    named = dict(zip(names, np.round(numbers, 4).tolist(), strict=True))
    own: dict[str, Any] = {n: named.pop(n) for n in _OF_SHAPE if n in named}
    gains = {name: start.balance.get(name, 1.0) * named[name] for name in named}
    return replace(start, **own, balance={**start.balance, **gains})


def _score(task: _Task, shapes: list[StrideShape], seed: int) -> Iterator[float]:
    """Yield for each shape the mean part of steps before a fall, in the same worlds."""
    rng = np.random.default_rng(seed)
    drawn = _draw_worlds(task.robot, task.crew.worlds, rng)
    jobs = [
        (task.robot, shape, task.rhythm(shape), walk, world)
        for shape in shapes
        for walk, world in zip(_WALKS, drawn, strict=True)
    ]
    parts: list[float] = []
    for part in run_jobs(_steps_held, jobs, float, task.crew.workers):
        parts.append(part)
        if len(parts) == len(_WALKS):
            yield float(np.mean(parts))
            parts = []


def _draw_worlds(
    robot: Robot, worlds: WorldRange, rng: np.random.Generator
) -> list[World]:
    """Draw a world for each walk of `_WALKS`."""
    hard = worlds.harder()
    drawn = [hard.draw(rng) for _ in _WALKS]
    scale = robot.reduced.mass * math.sqrt(GRAVITY * robot.reduced.leg_length)
    for i in range(len(_WALKS) - len(_PUSHED), len(_WALKS)):
        direction, at_s = (
            float(rng.uniform(-180.0, 180.0)),
            float(rng.uniform(2.0, 4.0)),
        )
        push = Push(_HARD_PUSH * scale, direction, at_s)
        drawn[i] = replace(drawn[i], push=(push,))
    return drawn


def _steps_held(
    robot: Robot, shape: StrideShape, timing: Timing, walk: _Course, world: World
) -> float:
    """Return the part of a walk's steps before a fall; 0 if a step is not feasible."""
    poses, gaits = _walk_of(robot, shape, timing.step, walk)
    speed = joint_speeds(robot, world.speed_limit_deg_s)
    fits = feasible_pairs(poses, timing, speed)
    if not fits[tuple(gaits[:, [0, 3]].T)].all():
        return 0.0
    sums = walk_strides(poses, timing, gaits, replace(world, push=world.push[:1]))
    return 1.0 if sums.fell_in is None else sums.fell_in / len(gaits)


def _walk_of(
    robot: Robot, shape: StrideShape, step_s: float, walk: _Course
) -> tuple[StridePoses, NDArray[np.int64]]:
    """Return the strides and the gaits of a walk from standing to standing.

    The strides are standing, half the length, and the two of a cycle: the first one may
    go outward and turn, the second one follows.
    """
    speed, outward, turn = walk
    leg = robot.reduced.leg_length
    length = speed * math.sqrt(GRAVITY * leg) * step_s
    strides = np.array(
        [
            (0.0, 0.0, 0.0),
            (0.5 * length, 0.0, 0.0),
            (length, outward * leg, turn),
            (length, 0.0, 0.0),
        ]
    )
    poses = StridePoses(
        robot,
        shape.hip_height * leg,
        (
            strides,
            np.array([shape.passing(leg)]),
            np.array([LANDING]),
            strides.copy(),
        ),
        shape.balance,
    )
    lasts = [1, *(2 + i % 2 for i in range(_STEPS - 3)), 1, 0]
    gaits = [
        (first, 0, 0, last) for first, last in zip([0, *lasts], lasts, strict=False)
    ]
    return poses, np.array(gaits, dtype=np.int64)
