"""Walks that are pushed, tripped and shaken, and what they teach about recovery. Ours.

After a disturbance each walk steps at sizes of its own, drawn at random, so that what
the sizes do can be told from what the disturbances do; two thirds of the walks at sizes
that the earlier ones leave likely to be best.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from gaitchain.analysis.simulated_walk import run_unrecorded
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.build.jobs import run_jobs
from gaitchain.build.push import impulse_unit_ns
from gaitchain.build.workers import Crew, in_round
from gaitchain.chain.layered_chain import FloatArray
from gaitchain.chain.recovery import (
    Lessons,
    Option,
    draw_sizes,
    learn_recovery,
    row_of,
)
from gaitchain.gait.command_range import CommandRange
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.schedule import Schedule, Segment
from gaitchain.sim.push import Push
from gaitchain.sim.world import World
from gaitchain.walker.step_size import StepSize
from gaitchain.walker.stride_gait import StrideGait
from gaitchain.walker.walker import Walker

_ROUNDS = 3  # from the second on the sizes are those that may be best
_SECONDS, _SEGMENTS = 20.0, 5
_LEAST = 0.8  # of the range that a command uses
_STRAIGHT = 0.6  # of the commands, straight ahead
_BLOCKS = (0.015, 0.045)  # legs
_PUSHES, _EVERY_S = (0.05, 0.2), (0.6, 1.4)  # parts of m sqrt(g h)
_WAIST = (4.0, 12.0)  # stiffness over m g h
_KINDS = ((True, False), (False, True), (True, True), (False, False))
_OFTEN = 0.25  # how many carry a load, swing their arms, have late servos
_PAYLOAD, _LATE_S = (0.0, 0.2), (0.0, 0.04)


def recover(
    library: GaitLibrary, walks: int, rng: np.random.Generator, crew: Crew
) -> GaitLibrary:
    """Learn how far to step after a disturbance, from walks in physics.

    Args:
        library: with its verdicts on steps, and its range of commands.
        walks: their number; with 0 nothing is learned.
        rng: source of randomness.
        crew: processes and worlds.

    Returns:
        The library with its `recovery`.
    """
    if not walks:
        return library
    scale_ns = impulse_unit_ns(library)
    seed, walked = int(rng.integers(2**31)), list[_Lesson]()
    for number, part in enumerate(np.array_split(np.arange(walks), _ROUNDS)):
        sizes = draw_sizes(len(part), rng, _lessons(walked))
        jobs = [
            (library, _draw_world(crew, library, scale_ns, (seed, i)), own, (seed, i))
            for i, own in zip(part.tolist(), sizes, strict=True)
        ]
        found = run_jobs(_walk_on, jobs, _Lesson, crew.workers)
        stage = in_round("walking on after disturbances", number)
        walked += crew.track(stage, found, len(jobs))
    lessons = _lessons(walked)
    assert lessons is not None
    return replace(library, recovery=learn_recovery(lessons))


def _lessons(walked: Sequence["_Lesson"]) -> Lessons | None:
    if not walked:
        return None
    columns = (np.array(column, dtype=float) for column in zip(*walked, strict=True))
    return Lessons(*columns)


class _Lesson(NamedTuple):
    """One walk, a row of `Lessons`."""

    sizes: list[float]
    steps: int
    lost: float
    fell: bool


def _draw_world(
    crew: Crew, library: GaitLibrary, scale_ns: float, seed: tuple[int, int]
) -> World:
    """Draw a world of training with blocks, pushes, both, or a waist that gives way.

    The last is another robot than ours: many of its steps are off by more than usual,
    few of them end in a fall, so that a robot that is too careful loses way there. Some
    carry a load, swing their arms, or have servos that get their targets late.
    """
    rng = np.random.default_rng(seed)
    world = crew.worlds.but(push_ns=0.0).draw(rng)
    tripped, pushed = _KINDS[int(rng.integers(len(_KINDS)))]
    if tripped:
        blocks_m = float(rng.uniform(*_BLOCKS)) * library.robot.reduced.leg_length
        world = replace(world, blocks_m=blocks_m)
    if pushed:
        world = replace(world, push=tuple(_draw_pushes(rng, scale_ns)))
    if not (tripped or pushed):
        world = replace(world, waist=float(rng.uniform(*_WAIST)))
    if rng.random() < _OFTEN:
        world = replace(world, payload=float(rng.uniform(*_PAYLOAD)))
    if rng.random() < _OFTEN:
        world = replace(world, arms="random")
    if rng.random() < _OFTEN:
        world = replace(world, delay_s=float(rng.uniform(*_LATE_S)))
    return world


def _draw_pushes(rng: np.random.Generator, scale_ns: float) -> list[Push]:
    pushes, at_s = [], float(rng.uniform(1.0, 2.0))
    while at_s < _SECONDS:
        direction_deg = float(rng.uniform(-180.0, 180.0))
        impulse_ns = float(rng.uniform(*_PUSHES)) * scale_ns
        pushes.append(Push(impulse_ns, direction_deg, at_s))
        at_s += float(rng.uniform(*_EVERY_S))
    return pushes


def _walk_on(
    library: GaitLibrary, world: World, sizes: FloatArray, seed: tuple[int, int]
) -> _Lesson:
    """Walk in a disturbed world, with steps of these sizes at the levels of unrest."""
    walker = Walker(library, require_qualified=False)
    gait = walker.gait
    assert isinstance(gait, StrideGait)
    noted = gait.step_size = _NotedSize(_Given(sizes), gait.step_size.errors)
    rng = np.random.default_rng((*seed, 1))
    schedule = _draw_schedule(library.command_range, rng)
    walked = run_unrecorded(walker, MujocoBackend(library.robot, world), schedule)
    steps, fell = max(noted.steps, 1), walked.fell_at_s is not None
    return _Lesson(sizes.tolist(), steps, noted.lost / steps, fell)


def _draw_schedule(most: CommandRange, rng: np.random.Generator) -> Schedule:
    """Draw commands that use much of the range."""
    segments = []
    for _ in range(_SEGMENTS):
        parts = rng.dirichlet(np.ones(3)) * rng.choice([-1.0, 1.0], 3)
        if rng.random() < _STRAIGHT:
            parts = np.array([1.0, 0.0, 0.0])
        command = most.at((rng.uniform(_LEAST, 1.0) * parts).tolist())
        segments.append(Segment(command, _SECONDS / _SEGMENTS))
    return tuple(segments)


class _Given:
    """Chooses a given size at each level of unrest."""

    def __init__(self, sizes: FloatArray) -> None:
        self._sizes = sizes

    def options(self, unrest: float, most: float) -> list[Option]:
        """Return the size that is given, if the command asks for as much."""
        return [Option(min(float(self._sizes[row_of(unrest)]), most), 0.0)]


class _NotedSize(StepSize):
    """Notes how many steps were made, and what was left out of the commands."""

    def __init__(self, choice: _Given, errors: tuple[float, ...]) -> None:
        super().__init__(choice, errors)
        self.steps, self.lost = 0, 0.0

    def following(self, off: float, most: float) -> float:
        size = super().following(off, most)
        self.steps += 1
        self.lost += most - size
        return size
