"""Search for a robot's step time, crouch, swing and gains by walks in physics.

It is the cross-entropy method [Rubinstein99]: draw shapes around the current mean, walk
each in different worlds, move the mean to that of the best quarter, and repeat. Ours.
"""

import math
import time
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gaitchain.build.jobs import run_jobs
from gaitchain.build.search_walks import (
    FAST,
    PUSH,
    WALKS,
    draw_worlds,
    fits,
    steps_held,
)
from gaitchain.build.shape_start import (
    PACE,
    Plan,
    Rhythm,
    narrowest,
    plan_of,
    stances,
)
from gaitchain.build.workers import Crew
from gaitchain.errors import LibraryError
from gaitchain.gait.stride.shape import StrideShape
from gaitchain.messages import Array
from gaitchain.robot.robot import Robot
from gaitchain.sim.disturbance import Span
from gaitchain.sim.world import World

GENERATIONS = 6
STAGE = "searching the step's shape"
_DRAWN, _KEPT = 16, 4  # shapes walked and selected in a generation
_TRIED = 4  # times as many are drawn: the plan rules out many at first
# The found shape must be better in new worlds: rounds of them, fewer where the gain is
# that many standard errors away from what it has to be.
_FINALS, _BETTER, _SURE = 4, 0.01, 2.0
_SPREAD, _LEAST_SPREAD, _RENEWED = 0.2, 0.05, 0.8
# Range of each number that is searched; gains are factors on those of the start, the
# plan gives the hips' heights. A reference that follows faster walks faster as long as
# no waist gives way.
_RANGES: Mapping[str, Span] = {
    "step_s": (0.3, 0.5),
    "lift": (0.045, 0.09),
    "share": (0.38, 0.56),
    "share_rate": (1.0, 1.7),
    "trunk": (0.6, 1.5),
    "ankle": (0.5, 2.0),
    "follow": (0.4, 1.3),
    "swing_tilt": (0.7, 1.4),
    "dead_zone": (0.2, 1.2),
    "inertia": (0.2, 1.3),
}
_STANCE = 0.15  # the same for a stance other than the file's, around its start
_OF_SHAPE = ("step_s", "hip_height", "stance", "lift", "share", "share_rate")
# Heats of a generation: shapes that are left, and the walks that they make, each in the
# same world as the others.
_HEATS = ((_DRAWN, range(4)), (9, range(4, 8)), (6, range(8, len(WALKS))))
# Walks of each shape that may be begun with, and the part of them that feet closer
# together than in the file have to hold more.
_FIRST, _CLEAR = 8, 0.15
# The pace is the speed / sqrt(g leg) of which the walks ahead are made; it goes up or
# down with the part of their steps that the selected shapes hold. So do hard pushes:
# what all shapes hold, or none, tells nothing of them.
_SLOWER = 4  # paces to begin with
_UP, _DOWN, _FAR_DOWN = (0.7, 1.12), (0.5, 0.87), (0.25, 0.7)
_HELD = 0.6  # part of the walks that is held where the pace neither goes up nor down


class Found(NamedTuple):
    """What a search found."""

    shape: StrideShape
    """The best shape."""
    pace: float
    """Speed / sqrt(g leg) that it just held; infinite if nothing was walked."""
    others: tuple[StrideShape, ...] = ()
    """What to try, in this order, where that one walks badly for long."""


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
) -> Found:
    """Search for the shape with which a robot makes most steps without a fall.

    The result does not depend on the workers; it depends on the machine's speed only if
    the time limit is reached. It begins with what the plan allows (`shape_start`), and
    keeps that unless the found shape is clearly better in new worlds.

    Args:
        robot: the robot.
        rng: source of randomness.
        crew: processes and worlds.
        start: the shape to begin with, as far as the robot's legs allow it.
        generations: rounds of the search; with 0 the shape is `start`.
        seconds: time after which no further generation begins [s].
        rhythm: gives the step times for a shape, `StrideShape.timing` by default; T is
            searched only if it changes with the shape.

    Returns:
        The shape, the pace that it just held, and what else may be tried.

    Raises:
        LibraryError: the plan can make no walk in the file's stance.
    """
    if not generations:
        return Found(start, math.inf)
    end_s = time.monotonic() + seconds
    task = _Task(robot, crew, rhythm or partial(StrideShape.timing, robot=robot))
    search = _Search(task, rng, generations)
    plan, *others = search.best_starts(start)
    begun = plan.at(search.pace)
    space = _Space(begun, _ranges(task, start, begun, plan.hips(search.pace)))
    mean, spread = space.point(begun), np.full(len(space.names), _SPREAD)
    for _ in range(generations):
        if time.monotonic() > end_s:
            break
        drawn = rng.normal(mean, spread, (_TRIED * _DRAWN, len(mean)))
        drawn[0] = mean
        kept = _select(np.clip(drawn, 0.0, 1.0), space, search)
        mean = mean + _RENEWED * (kept.mean(axis=0) - mean)
        found = spread + _RENEWED * (kept.std(axis=0) - spread)
        spread = np.maximum(found, _LEAST_SPREAD)
    best = space.shape(np.clip(mean, 0.0, 1.0))
    unlike = [another.at(search.pace) for another in others]
    if search.is_better(best, begun):
        return Found(best, search.pace, (begun, *unlike))
    untried = [best] if best != space.shape(space.point(begun)) else []
    return Found(begun, search.pace, (*untried, *unlike))


def _ranges(
    task: _Task, start: StrideShape, begun: StrideShape, hips: Span
) -> Mapping[str, Span]:
    """Return the range of each number that is searched for this robot."""
    ranges = {**_RANGES, "hip_height": hips}
    if begun.stance != start.stance:
        least = max(narrowest(task.robot), begun.stance - _STANCE)
        ranges["stance"] = min(least, begun.stance), begun.stance + _STANCE
    ends_s = [replace(begun, step_s=end) for end in ranges["step_s"]]
    if len({task.rhythm(end).step for end in ends_s}) == 1:
        del ranges["step_s"]
    return ranges


class _Space:
    """The shapes that are searched, as points of a unit cube."""

    def __init__(self, start: StrideShape, ranges: Mapping[str, Span]) -> None:
        self._start, self.names = start, list(ranges)
        self._low, high = np.array(list(ranges.values())).T
        self._size = high - self._low

    def point(self, shape: StrideShape) -> Array:
        """Return where a shape is that has the gains of the start."""
        own = [float(getattr(shape, n)) if n in _OF_SHAPE else 1.0 for n in self.names]
        at = (np.array(own) - self._low) / self._size
        return np.asarray(np.clip(at, 0.0, 1.0))

    def shape(self, point: Array) -> StrideShape:
        """Return the shape of a point."""
        numbers = np.round(self._low + point * self._size, 4).tolist()
        named = dict(zip(self.names, numbers, strict=True))
        own: dict[str, Any] = {n: named.pop(n) for n in _OF_SHAPE if n in named}
        old = self._start.balance
        gains = {name: old.get(name, 1.0) * named[name] for name in named}
        return replace(self._start, **own, balance={**old, **gains})


def _select(points: Array, space: _Space, search: "_Search") -> Array:
    """Walk the shapes of points, (N, D), and return the best of the points."""
    shapes = [space.shape(point) for point in points]
    taken = search.to_walk(shapes)
    return np.asarray(points[taken][search.best([shapes[i] for i in taken])])


def _best(held: Array, number: int) -> NDArray[np.int64]:
    """Return the indices of the best rows (K, W) of parts held, the best first."""
    return np.argsort(-held.sum(axis=1), kind="stable")[:number]


def _step(part: float) -> float:
    """Return by what to make walks harder of which that part is held."""
    if part > _UP[0]:
        return _UP[1]
    if part < _FAR_DOWN[0]:
        return _FAR_DOWN[1]
    return _DOWN[1] if part < _DOWN[0] else 1.0


class _Search:
    """Compares shapes by walks at the pace that they can just hold."""

    def __init__(self, task: _Task, rng: np.random.Generator, generations: int) -> None:
        self._task, self._rng, self.pace, self.push = task, rng, PACE, PUSH
        each = sum(shapes * len(walks) for shapes, walks in _HEATS)
        self._finals = 2 * _FINALS * len(WALKS)
        self._done = 0
        self._total = generations * each + self._finals

    def best_starts(self, start: StrideShape) -> list[Plan]:
        """Return the plan that holds most of the first walks, and the best unlike it.

        Gains are those of the start, or the derived ones. The first has the file's
        stance unless one with the feet closer together holds clearly more. The second,
        if there is one, has another stance: short walks tell stances badly apart.

        Raises:
            LibraryError: the plan can make no walk.
        """
        plans = self._plans(start)
        self.pace = max(plan.pace for plan in plans) / _FAR_DOWN[1]
        held = np.zeros(len(plans))
        for _ in range(_SLOWER):
            self.pace *= _FAR_DOWN[1]
            self._total += _FIRST * len(plans)
            shapes = [plan.at(self.pace) for plan in plans]
            held = self._held(shapes, range(_FIRST), self._draw()).mean(axis=1)
            if held.max() >= _HELD:
                break
        worth = [
            part - _CLEAR * (plan.usual.stance != start.stance)
            for part, plan in zip(held, plans, strict=True)
        ]
        order = [plans[i] for i in np.argsort(-np.array(worth), kind="stable")]
        stance = order[0].usual.stance
        unlike = [plan for plan in order if plan.usual.stance != stance]
        return [order[0], *unlike[:1]]

    def _plans(self, start: StrideShape) -> list[Plan]:
        """Return what may be begun with; the file's stance and the start's gains first.

        Raises:
            LibraryError: the plan can make no walk in the file's stance.
        """
        plans: list[Plan] = []
        for shape in stances(self._task.robot, start):
            try:
                plan = self._plan(shape)
            except LibraryError:
                if shape == start:
                    raise
                break  # feet even closer together are no easier
            plans += [plan, plan.with_derived_gains()] if start.balance else [plan]
        return plans

    def _plan(self, shape: StrideShape) -> Plan:
        robot, rhythm, crew = self._task.robot, self._task.rhythm, self._task.crew
        limit = crew.worlds.speed_limit_deg_s
        return plan_of(robot, shape, rhythm, limit, crew.workers)

    def to_walk(self, shapes: list[StrideShape]) -> list[int]:
        """Return the shapes to walk: first those whose steps are feasible at the pace.

        What a limit of a joint rules out need not be walked.
        """
        robot, rhythm, walk = self._task.robot, self._task.rhythm, WALKS[0]
        limit = self._task.crew.worlds.speed_limit_deg_s
        jobs = [
            (robot, shape, rhythm(shape), walk, self.pace, limit) for shape in shapes
        ]
        fit = list(run_jobs(fits, jobs, bool, self._task.crew.workers))
        return sorted(range(len(shapes)), key=lambda i: not fit[i])[:_DRAWN]

    def best(self, shapes: list[StrideShape]) -> list[int]:
        """Return the best shapes of a generation, and adapt the pace to them."""
        worlds, left = self._draw(), np.arange(len(shapes))
        held = np.zeros((len(shapes), 0))
        for number, walks in _HEATS:
            best = _best(held, number)
            left = left[best]
            more = self._held([shapes[i] for i in left], walks, worlds)
            held = np.concatenate([held[best], more], axis=1)
        best = _best(held, _KEPT)
        self._adapt(held[best])
        return [int(i) for i in left[best]]

    def is_better(self, found: StrideShape, start: StrideShape) -> bool:
        """Return whether a shape is clearly better than another one in new worlds."""
        self._done = self._total - self._finals
        gains = np.zeros(0)
        for _ in range(_FINALS):
            held = self._held([found, start], range(len(WALKS)), self._draw())
            gains = np.append(gains, held[0] - held[1])
            error = gains.std() / math.sqrt(len(gains))
            if abs(gains.mean() - _BETTER) > _SURE * error:
                break
        self._task.crew.progress(STAGE, self._total, self._total)
        return bool(gains.mean() > _BETTER)

    def _adapt(self, held: Array) -> None:
        """Set pace and pushes by the parts (K, W) of walks that the best ones held."""
        fast = [walk.ahead > FAST for walk in WALKS]
        self.pace *= _step(float(held[:, fast].mean()))
        pushed = [walk.pushed for walk in WALKS]
        self.push *= _step(float(held[:, pushed].mean()))

    def _draw(self) -> list[World]:
        task = self._task
        return draw_worlds(task.robot, task.crew.worlds, self.push, self._rng)

    def _held(
        self, shapes: list[StrideShape], walks: range, worlds: list[World]
    ) -> Array:
        """Return the part of its steps before a fall, for each shape and walk."""
        robot, rhythm = self._task.robot, self._task.rhythm
        jobs = [
            (robot, shape, rhythm(shape), WALKS[i], self.pace, worlds[i])
            for shape in shapes
            for i in walks
        ]
        parts = []
        for part in run_jobs(steps_held, jobs, float, self._task.crew.workers):
            parts.append(part)
            self._done += 1
            self._task.crew.progress(STAGE, self._done, self._total)
        return np.array(parts).reshape(len(shapes), len(walks))
