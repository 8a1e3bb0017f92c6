"""Search for a robot's step time, crouch, step height and gains by walks in physics.

It is the cross-entropy method [Rubinstein99]: draw shapes around the current mean, walk
each in different worlds, move the mean to that of the best quarter, and repeat. Ours.
"""

import math
import time
from collections.abc import Callable
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

Rhythm = Callable[[StrideShape], Timing]
GENERATIONS = 6
STAGE = "searching the step's shape"
_DRAWN, _KEPT = 20, 5  # shapes walked and selected in a generation
_TRIED = 4  # times as many are drawn: the plan rules out many at first
_FINALS, _BETTER = 4, 0.01  # rounds in new worlds, where the found shape must be better
_SPREAD, _LEAST_SPREAD, _RENEWED = 0.2, 0.05, 0.8
# Range of each number that is searched; gains are factors on those of the start. A
# reference that follows faster walks faster as long as no waist gives way.
_RANGES = {
    "step_s": (0.34, 0.5),
    "hip_height": (0.82, 0.94),
    "lift": (0.045, 0.09),
    "trunk": (0.6, 1.5),
    "ankle": (0.5, 2.0),
    "follow": (0.4, 1.3),
    "swing_tilt": (0.7, 1.4),
    "dead_zone": (0.2, 1.2),
    "inertia": (0.2, 1.3),
}
_OF_SHAPE = ("step_s", "hip_height", "lift")
_HARD_PUSH = 0.25  # part of m sqrt(g leg): what about half of the walks hold
_LONG, _SHORT = 40, 20  # steps of a walk ahead, where a sway has to grow, and of others
_HEAT, _LEFT = 5, 10  # walks of all shapes; shapes that make the others, too
# The pace is the speed / sqrt(g leg) of which the walks ahead are made; it goes up or
# down with the part of their steps that the selected shapes hold.
_PACE, _UP, _DOWN = 0.3, (0.7, 1.12), (0.5, 0.87)
_FAST = 0.8  # of the pace: what is faster tells whether it is held
_FALL = 0.5  # what a walk is worth that ends with a fall, at most
_SLIPPERY, _LATE_S = 0.4, 0.04  # friction; delay of the servos' targets
_LOOSE = 4.0  # stiffness of a waist over m g h; 22 is G1, 3.4 G1 with soft servos


class _Walk(NamedTuple):
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
        slow_to_show = self.slippery or self.loose
        return _LONG if self.ahead > _FAST or slow_to_show else _SHORT


# The first ones tell shapes apart best.
_WALKS = (
    _Walk(1.0),
    _Walk(1.2),
    _Walk(0.5, pushed=True),
    _Walk(0.65, slippery=True),
    _Walk(0.6, loose=True),
    _Walk(0.85, delayed=True),
    _Walk(1.1),
    _Walk(1.35),
    *3 * (_Walk(0.5, pushed=True),),
    _Walk(0.65, slippery=True),
    _Walk(-0.45),
    _Walk(0.0, outward=0.25),
    _Walk(0.3, turn=0.3, delayed=True),
    _Walk(0.9, loose=True),
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
    search = _Search(task, rng, generations)
    end_s = time.monotonic() + seconds
    for _ in range(generations):
        if time.monotonic() > end_s:
            break
        drawn = rng.normal(mean, spread, (_TRIED * _DRAWN, len(mean)))
        drawn[0] = mean
        points = np.clip(drawn, 0.0, 1.0)
        shapes = [_shape(start, names, low + p * (high - low)) for p in points]
        taken = search.to_walk(shapes)
        kept = points[taken][search.best([shapes[i] for i in taken])]
        mean = mean + _RENEWED * (kept.mean(axis=0) - mean)
        found = spread + _RENEWED * (kept.std(axis=0) - spread)
        spread = np.maximum(found, _LEAST_SPREAD)
    found_shape = _shape(start, names, low + np.clip(mean, 0.0, 1.0) * (high - low))
    return found_shape if search.is_better(found_shape, start) else start


class _Search:
    """Compares shapes by walks at the pace that they can just hold."""

    def __init__(self, task: _Task, rng: np.random.Generator, generations: int) -> None:
        self._task, self._rng, self._pace = task, rng, _PACE
        heats = _HEAT * (_DRAWN - _LEFT)
        each = heats + _LEFT * len(_WALKS)
        self._finals = 2 * _FINALS * len(_WALKS)
        self._done, self._total = 0, generations * each + self._finals

    def to_walk(self, shapes: list[StrideShape]) -> list[int]:
        """Return the shapes to walk: first those whose steps are feasible at the pace.

        What a limit of a joint rules out need not be walked.
        """
        robot, rhythm, walk = self._task.robot, self._task.rhythm, _WALKS[0]
        limit = self._task.crew.worlds.speed_limit_deg_s
        jobs = [
            (robot, shape, rhythm(shape), walk, self._pace, limit) for shape in shapes
        ]
        fit = list(run_jobs(_fits, jobs, bool, self._task.crew.workers))
        return sorted(range(len(shapes)), key=lambda i: not fit[i])[:_DRAWN]

    def best(self, shapes: list[StrideShape]) -> list[int]:
        """Return the best shapes of a generation, and adapt the pace to them.

        All make the first walks; the better half goes on with the others.
        """
        worlds = self._draw_worlds()
        heat = self._held(shapes, range(_HEAT), worlds)
        left = np.argsort(-heat.mean(axis=1), kind="stable")[:_LEFT]
        rest = range(_HEAT, len(_WALKS))
        more = self._held([shapes[i] for i in left], rest, worlds)
        held = np.concatenate([heat[left], more], axis=1)
        best = np.argsort(-held.mean(axis=1), kind="stable")[:_KEPT]
        self._adapt(held[best])
        return [int(i) for i in left[best]]

    def is_better(self, found: StrideShape, start: StrideShape) -> bool:
        """Return whether a shape is clearly better than another one in new worlds."""
        self._done = self._total - self._finals
        gain = 0.0
        for _ in range(_FINALS):
            worlds = self._draw_worlds()
            held = self._held([found, start], range(len(_WALKS)), worlds)
            gain += float(held[0].mean() - held[1].mean())
        return gain > _FINALS * _BETTER

    def _adapt(self, held: Array) -> None:
        """Set the pace by the parts (K, W) of the walks that the best shapes held."""
        fast = [walk.ahead > _FAST for walk in _WALKS]
        part = float(held[:, fast].mean())
        if part > _UP[0]:
            self._pace *= _UP[1]
        elif part < _DOWN[0]:
            self._pace *= _DOWN[1]

    def _draw_worlds(self) -> list[World]:
        """Draw a world for each walk."""
        robot, rng = self._task.robot, self._rng
        hard = self._task.crew.worlds.harder()
        scale = robot.reduced.mass * math.sqrt(GRAVITY * robot.reduced.leg_length)
        drawn = []
        for walk in _WALKS:
            world = hard.draw(rng)
            if walk.pushed:
                direction = float(rng.uniform(-180.0, 180.0))
                push = Push(_HARD_PUSH * scale, direction, float(rng.uniform(2.0, 4.0)))
                world = replace(world, push=(push,))
            if walk.slippery:
                world = replace(world, friction=_SLIPPERY)
            if walk.delayed:
                world = replace(world, delay_s=_LATE_S)
            if walk.loose:
                world = replace(world, waist=_LOOSE)
            drawn.append(world)
        return drawn

    def _held(
        self, shapes: list[StrideShape], walks: range, worlds: list[World]
    ) -> Array:
        """Return the part of its steps before a fall, for each shape and walk."""
        robot, rhythm = self._task.robot, self._task.rhythm
        jobs = [
            (robot, shape, rhythm(shape), _WALKS[i], self._pace, worlds[i])
            for shape in shapes
            for i in walks
        ]
        parts = []
        for part in run_jobs(_steps_held, jobs, float, self._task.crew.workers):
            parts.append(part)
            self._done += 1
            self._task.crew.tell(STAGE, self._done, self._total)
        return np.array(parts).reshape(len(shapes), len(walks))


def _number(shape: StrideShape, name: str) -> float:
    return float(getattr(shape, name)) if name in _OF_SHAPE else 1.0


def _shape(start: StrideShape, names: list[str], numbers: Array) -> StrideShape:
    named = dict(zip(names, np.round(numbers, 4).tolist(), strict=True))
    own: dict[str, Any] = {n: named.pop(n) for n in _OF_SHAPE if n in named}
    gains = {name: start.balance.get(name, 1.0) * named[name] for name in named}
    return replace(start, **own, balance={**start.balance, **gains})


def _steps_held(
    robot: Robot,
    shape: StrideShape,
    timing: Timing,
    walk: _Walk,
    pace: float,
    world: World,
) -> float:
    """Return the part of a walk's steps before a fall; 0 if a step is not feasible."""
    if not _fits(robot, shape, timing, walk, pace, world.speed_limit_deg_s):
        return 0.0
    poses, gaits = _walk_of(robot, shape, timing.step, walk, pace)
    sums = walk_strides(poses, timing, gaits, world)
    return 1.0 if sums.fell_in is None else _FALL * sums.fell_in / len(gaits)


def _fits(
    robot: Robot,
    shape: StrideShape,
    timing: Timing,
    walk: _Walk,
    pace: float,
    speed_limit_deg_s: float | None,
) -> bool:
    """Return whether the plan can make all steps of a walk."""
    poses, gaits = _walk_of(robot, shape, timing.step, walk, pace)
    speed = joint_speeds(robot, speed_limit_deg_s)
    fits = feasible_pairs(poses, timing, speed)
    return bool(fits[tuple(gaits[:, [0, 3]].T)].all())


def _walk_of(
    robot: Robot, shape: StrideShape, step_s: float, walk: _Walk, pace: float
) -> tuple[StridePoses, NDArray[np.int64]]:
    """Return the strides and the gaits of a walk from standing to standing.

    The strides are standing, half the length, and the two of a cycle: the first one may
    go outward and turn, the second one follows.
    """
    leg = robot.reduced.leg_length
    length = walk.ahead * pace * math.sqrt(GRAVITY * leg) * step_s
    strides = np.array(
        [
            (0.0, 0.0, 0.0),
            (0.5 * length, 0.0, 0.0),
            (length, walk.outward * leg, walk.turn),
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
    lasts = [1, *(2 + i % 2 for i in range(walk.steps - 3)), 1, 0]
    gaits = [
        (first, 0, 0, last) for first, last in zip([0, *lasts], lasts, strict=False)
    ]
    return poses, np.array(gaits, dtype=np.int64)
