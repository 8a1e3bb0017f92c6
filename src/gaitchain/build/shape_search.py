"""Find a robot's rhythm, crouch, step height and balance by walking it in physics.

The cross-entropy method: draw shapes around the best so far, walk each in worlds that
differ, keep the best quarter, and draw again. Ours; the method is [Rubinstein99].
"""

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from joblib import Parallel, delayed
from numpy.typing import NDArray

from gaitchain.build.stride_feasibility import feasible_pairs, joint_speeds
from gaitchain.build.stride_rollout import walk_strides
from gaitchain.gait.stride.shape import LANDING, StrideShape
from gaitchain.gait.stride.strides import StridePoses
from gaitchain.messages import Array
from gaitchain.robot.reduced_biped import Biped
from gaitchain.sim.world import GRAVITY, Push, World
from gaitchain.sim.world_range import WorldRange

Tell = Callable[[str, int, int], None]
GENERATIONS = 5
STAGE = "searching the step's shape"
_DRAWN, _KEPT = 20, 5  # shapes of a generation
_FINALS, _BETTER = 4, 0.01  # rounds in new worlds, where the found shape must be better
_STEPS = 20  # of a walk
_SPREAD, _LEAST_SPREAD, _RENEWED = 0.2, 0.05, 0.8
# What is searched, with the range; gains as factors on those that it begins with.
_RANGES = {
    "step_s": (0.34, 0.5),
    "hip_height": (0.82, 0.94),
    "lift": (0.045, 0.09),
    "trunk": (0.6, 1.5),
    "ankle": (0.5, 2.0),
    "follow": (0.5, 1.6),
    "swing_tilt": (0.7, 1.4),
}
_OF_SHAPE = ("step_s", "hip_height", "lift")
_HARD_PUSH = 0.17  # of m sqrt(g h)
_PUSHED = 4 * ((0.16, 0.0, 0.0),)
"""Walks that are pushed that hard; the others as the worlds have it."""
# Walks: speed ahead over sqrt(g leg), outward over the leg, turn [rad], each time the
# leading foot steps.
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


def search_shape(
    biped: Biped,
    rng: np.random.Generator,
    worlds: WorldRange,
    *,
    start: StrideShape,
    generations: int = GENERATIONS,
    seconds: float = math.inf,
    workers: int = 1,
    tell: Tell = lambda stage, done, total: None,
) -> StrideShape:
    """Search for the shape with which a robot walks furthest.

    The result depends on robot, randomness and generations, not on the workers; but
    where the time runs out, also on the machine. The shape that was begun with is kept
    if it is about as good in new worlds.

    Args:
        biped: the robot.
        rng: source of randomness.
        worlds: how much the physics varies.
        start: the shape to begin with.
        generations: rounds of the search; none keeps the shape as it is.
        seconds: no generation begins after so long [s].
        workers: processes.
        tell: told about every shape that was walked.

    Returns:
        The best shape.
    """
    low, high = np.array(list(_RANGES.values())).T
    own = np.array([_number(start, name) for name in _RANGES])
    mean, spread = (own - low) / (high - low), np.full(len(low), _SPREAD)
    done, total = 0, generations * _DRAWN + 2 * _FINALS * bool(generations)
    end_s = time.monotonic() + seconds
    with Parallel(n_jobs=workers, return_as="generator") as pool:
        for _ in range(generations):
            if time.monotonic() > end_s:
                break
            points = np.clip(rng.normal(mean, spread, (_DRAWN, len(mean))), 0.0, 1.0)
            points[0] = np.clip(mean, 0.0, 1.0)
            shapes = [_shape(start, low + point * (high - low)) for point in points]
            scores = []
            for score in _score(pool, biped, shapes, worlds, int(rng.integers(2**31))):
                scores.append(score)
                done += 1
                tell(STAGE, done, total)
            kept = points[np.argsort(scores)[::-1][:_KEPT]]
            mean = mean + _RENEWED * (kept.mean(axis=0) - mean)
            found = spread + _RENEWED * (kept.std(axis=0) - spread)
            spread = np.maximum(found, _LEAST_SPREAD)
        if not generations:
            return start
        ends = [start, _shape(start, low + np.clip(mean, 0.0, 1.0) * (high - low))]
        sums, done = np.zeros(2), total - 2 * _FINALS
        for _ in range(_FINALS):
            sums += list(_score(pool, biped, ends, worlds, int(rng.integers(2**31))))
            done += 2
            tell(STAGE, done, total)
    return ends[int(sums[1] > sums[0] + _FINALS * _BETTER)]


def _number(shape: StrideShape, name: str) -> float:
    return float(getattr(shape, name)) if name in _OF_SHAPE else 1.0


def _shape(start: StrideShape, numbers: Array) -> StrideShape:
    named = dict(zip(_RANGES, np.round(numbers, 4).tolist(), strict=True))
    own: dict[str, Any] = {name: named.pop(name) for name in _OF_SHAPE}
    gains = {name: start.balance.get(name, 1.0) * named[name] for name in named}
    return replace(start, **own, balance={**start.balance, **gains})


def _score(
    pool: Any, biped: Biped, shapes: list[StrideShape], worlds: WorldRange, seed: int
) -> Iterator[float]:
    """Mean part of the steps that hold, shape by shape, all in the same worlds."""
    rng = np.random.default_rng(seed)
    drawn = _draw_worlds(biped, worlds, rng)
    jobs = (
        delayed(_steps_held)(biped, shape, walk, world)
        for shape in shapes
        for walk, world in zip(_WALKS, drawn, strict=True)
    )
    parts: list[float] = []
    for part in pool(jobs):
        parts.append(part)
        if len(parts) == len(_WALKS):
            yield float(np.mean(parts))
            parts = []


def _draw_worlds(
    biped: Biped, worlds: WorldRange, rng: np.random.Generator
) -> list[World]:
    """Draw a world for each walk."""
    hard = worlds.harder()
    drawn = [hard.draw(rng) for _ in _WALKS]
    scale = biped.mass * math.sqrt(GRAVITY * biped.leg_length)
    for i in range(len(_WALKS) - len(_PUSHED), len(_WALKS)):
        direction, at_s = (
            float(rng.uniform(-180.0, 180.0)),
            float(rng.uniform(2.0, 4.0)),
        )
        push = Push(_HARD_PUSH * scale, direction, at_s)
        drawn[i] = replace(drawn[i], push=(push,))
    return drawn


def _steps_held(
    biped: Biped, shape: StrideShape, walk: tuple[float, float, float], world: World
) -> float:
    """Part of a walk's steps that hold; none where a joint's limit forbids them."""
    poses, gaits = _walk_of(biped, shape, walk)
    timing = shape.timing(biped)
    speed = joint_speeds(biped, world.speed_limit_deg_s)
    fits = feasible_pairs(poses, timing, speed)
    if not fits[tuple(gaits[:, [0, 3]].T)].all():
        return 0.0
    sums = walk_strides(poses, timing, gaits, replace(world, push=world.push[:1]))
    return 1.0 if sums.fell_in is None else sums.fell_in / len(gaits)


def _walk_of(
    biped: Biped, shape: StrideShape, walk: tuple[float, float, float]
) -> tuple[StridePoses, NDArray[np.int64]]:
    """Return the strides of a walk, from a stand to a stand: half, full, follow."""
    speed, outward, turn = walk
    leg, step_s = biped.leg_length, shape.timing(biped).step
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
        biped,
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
