"""What a step is usually off in walks without a push: DCM error, slip, slide. Ours.

Walks that cover all pairs of poses tell how steps differ. But most of their steps speed
up or turn, and a sway that needs many equal steps to grow does not show in them: so
walks that keep on with one command are counted, too.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from gaitchain.analysis.simulated_walk import run_unrecorded
from gaitchain.analysis.walked_way import Ways, walk_measured
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.build.families import build_of
from gaitchain.build.jobs import run_jobs
from gaitchain.build.rollout import WalkResult
from gaitchain.build.trial import without_caution
from gaitchain.build.usual_slide import learn_slides
from gaitchain.build.workers import Crew
from gaitchain.chain.effects import estimate_effects
from gaitchain.chain.layered_chain import FloatArray, IntArray
from gaitchain.chain.recovery import AHEAD, own_after
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.schedule import Segment
from gaitchain.messages import Command
from gaitchain.sim.world import World
from gaitchain.walker.gait import EndedStep
from gaitchain.walker.walker import Walker

_COUNTED = 0.95  # of the steps
_ORDINARY = 0.9  # of them, of robots with faults, beyond their own
_UNKNOWN = 3  # first steps, in which a walker learns what its own are
_USUAL = 1.645  # deviations: what 19 of 20 steps stay below
_OF_SIZE = math.sqrt(0.5 * math.pi)  # a normal deviation over a residual's mean size
_LEAST_OFF = 1e-3  # m, rad; and of the logarithm
_PARTS = 1.0, 0.5, 0.02  # of each end of the range; the last is nearly in place
# Walks of each command, each in a world of its own; fewer of robots with faults, which
# tell one number, not one of each pair.
_RUNS, _RUNS_OFF, _SECONDS = 10, 5, 6.0
_Job = tuple[GaitLibrary, Segment, World]


class StepErrors(NamedTuple):
    """What steps were off."""

    pairs: IntArray
    """(S, 2) first and last pose."""
    error: FloatArray
    """(S,) largest DCM error [m]."""
    slip: FloatArray
    """(S,) turn of the support foot on the ground [rad]."""

    def and_of(self, other: "StepErrors") -> "StepErrors":
        """Return these steps and others."""
        return StepErrors(
            np.concatenate([self.pairs, other.pairs]),
            np.concatenate([self.error, other.error]),
            np.concatenate([self.slip, other.slip]),
        )

    def usual(self, pairs: tuple[int, int]) -> tuple[FloatArray, FloatArray]:
        """Return what each step's error and slip usually stay below, (N_1, N_4) each.

        19 of 20 of its steps do: the logarithm's mean and 1.645 of its deviation, both
        by the first and the last pose and, as far as few walks of each show it, by the
        pair. All is 0 where there is no step.

        Args:
            pairs: (N_1, N_4).
        """
        return self._usual(self.error, pairs), self._usual(self.slip, pairs)

    def _usual(self, values: FloatArray, pairs: tuple[int, int]) -> FloatArray:
        if not values.size:
            return np.zeros(pairs)
        groups = self.pairs[:, 0], self.pairs[:, 1]
        logs = np.log(np.maximum(values, _LEAST_OFF))
        middle = _of_pairs(groups, pairs, logs)
        off = _of_pairs(groups, pairs, np.abs(logs - middle[groups]))
        spread = _OF_SIZE * np.maximum(off, _LEAST_OFF)
        return np.asarray(np.exp(middle + _USUAL * spread))


def errors_of(plan: Sequence[IntArray], results: Sequence[WalkResult]) -> StepErrors:
    """Return what the steps of walks without a push were off, up to a fall.

    Args:
        plan: (S, 4) gaits of each walk.
        results: what was measured in it.
    """
    error = np.concatenate([r.error * (not r.pushed) for r in results])
    slip = np.concatenate([r.slip for r in results])
    held = error > 0.0  # not NaN, begun, and not pushed
    return StepErrors(np.concatenate(plan)[held][:, [0, 3]], error[held], slip[held])


def learn_usual(
    library: GaitLibrary, covered: StepErrors, rng: np.random.Generator, crew: Crew
) -> GaitLibrary:
    """Walk on at the ends of the range, half of them, and hardly at all.

    Args:
        library: with its range of commands.
        covered: what the steps of walks that cover all pairs were off.
        rng: source of randomness.
        crew: processes and worlds; nothing pushes.

    Returns:
        The library with its `pair_error` and `pair_slip` by all steps, and `slides`.
    """
    jobs = _jobs(library, _RUNS, rng, crew)
    walks = _walk_on("learning what is usual", _walk_measured, jobs, crew)
    if not walks:
        return library
    found = covered.and_of(_errors_in(walks))
    pair_error, pair_slip = found.usual(library.pair_error.shape)
    slides = learn_slides(_straight_ways(jobs, walks))
    return replace(library, pair_error=pair_error, pair_slip=pair_slip, slides=slides)


def _straight_ways(jobs: Sequence[_Job], walks: Sequence["_Steps"]) -> list[Ways]:
    """Return the ways of walks that do not turn.

    Feet are measured somewhat ahead or behind of where they are: as a robot turns, that
    turns with it, and looks like a slide.
    """
    return [
        walk.ways
        for (_, segment, _), walk in zip(jobs, walks, strict=True)
        if walk.ways is not None and not segment.command.yaw_rate
    ]


def learn_usual_off(
    library: GaitLibrary, rng: np.random.Generator, crew: Crew
) -> GaitLibrary:
    """Walk on in the same way as robots with faults of servos and sensors.

    Their steps are off by more than is usual of sound ones, without a disturbance. How
    much of that is usual of one robot, the walker learns by itself (`own_after`).

    Args:
        library: with what is usual of sound robots.
        rng: source of randomness.
        crew: processes, and worlds with faults; nothing pushes.

    Returns:
        The library with its `usual_off` and `usual_spread`.
    """
    jobs = _jobs(library, _RUNS_OFF, rng, crew)
    walks = _walk_on("learning what is usual with faults", _walk, jobs, crew)
    off = [_off(library, walk) for walk in walks]
    if not any(each.size for each in off):
        return library
    most = _below(_COUNTED, off)
    spread = _below(_ORDINARY, [_beyond_own(each, most)[_UNKNOWN:] for each in off])
    return replace(library, usual_off=most, usual_spread=spread)


def _off(library: GaitLibrary, walk: "_Steps") -> FloatArray:
    """Return what each step was off beyond the usual of sound robots [legs]."""
    walked = _errors_in([walk])
    of = walked.pairs[:, 0], walked.pairs[:, 1]
    error = (walked.error - library.pair_error[of]) / library.robot.reduced.leg_length
    return np.maximum(error, AHEAD * (walked.slip - library.pair_slip[of]))


def _beyond_own(off: FloatArray, most: float) -> FloatArray:
    """Return what each step of a walk was off beyond its robot's own [legs]."""
    own, beyond = 0.0, np.empty_like(off)
    for number, each in enumerate(off.tolist()):
        beyond[number] = each - own
        own = own_after(own, each, most, number + 1)
    return beyond


def _below(part: float, walks: Sequence[FloatArray]) -> float:
    """Return what a part of all steps stay below, at least 0; 0 of none."""
    values = np.concatenate([[], *walks])
    return max(float(np.quantile(values, part)), 0.0) if values.size else 0.0


class _Steps(NamedTuple):
    """What the steps of a walk were off; none of one that fell, which is not usual."""

    ended: list[EndedStep]
    ways: Ways | None = None


def _jobs(
    library: GaitLibrary, runs: int, rng: np.random.Generator, crew: Crew
) -> list[_Job]:
    """Return walks that keep on with one command each."""
    calm, worlds = without_caution(library), crew.worlds.but(push_ns=0.0)
    return [
        (calm, Segment(command, _SECONDS), worlds.draw(rng))
        for command in _commands(library)
        for _ in range(runs)
    ]


def _walk_on(
    stage: str,
    walk: Callable[[GaitLibrary, Segment, World], _Steps],
    jobs: list[_Job],
    crew: Crew,
) -> list[_Steps]:
    """Walk on with one command each."""
    if not jobs:
        return []
    walks = run_jobs(walk, jobs, _Steps, crew.workers)
    return list(crew.track(stage, walks, len(jobs)))


def _errors_in(walks: Sequence[_Steps]) -> StepErrors:
    rows = [step for walk in walks for step in walk.ended]
    first, last, error, slip = np.array(rows, dtype=float).reshape(-1, 4).T
    pairs = np.stack([first, last], axis=1).astype(np.int64)
    return StepErrors(pairs, error, slip)


def _commands(library: GaitLibrary) -> list[Command]:
    most, sides = library.command_range, np.eye(3)
    return [
        most.at((part * (1.0 if end else -1.0) * sides[axis]).tolist())
        for axis, end in build_of(library.poses).steady_ends(most)
        for part in _PARTS
    ]


def _walk_measured(library: GaitLibrary, segment: Segment, world: World) -> _Steps:
    """Walk, and measure the way."""
    walked, ways = walk_measured(*_robot(library, world), segment)
    fell = walked.fell_at_s is not None
    return _Steps([]) if fell else _Steps(list(walked.ended), ways)


def _walk(library: GaitLibrary, segment: Segment, world: World) -> _Steps:
    """Walk without odometry, which takes a quarter of the time."""
    walked = run_unrecorded(*_robot(library, world), (segment,))
    return _Steps([] if walked.fell_at_s is not None else list(walked.ended))


def _robot(library: GaitLibrary, world: World) -> tuple[Walker, MujocoBackend]:
    walker = Walker(library, require_qualified=False)
    return walker, MujocoBackend(library.robot, world)


def _of_pairs(
    groups: tuple[IntArray, IntArray], pairs: tuple[int, int], values: FloatArray
) -> FloatArray:
    """Estimate the mean of each pair of first and last pose, (N_1, N_4).

    Args:
        groups: first and last pose of each sample.
        pairs: (N_1, N_4).
        values: the samples.
    """
    first, last = groups
    pair, widths = first * pairs[1] + last, (*pairs, pairs[0] * pairs[1])
    fit = estimate_effects([first, last, pair], widths, values)
    of_first, of_last, of_pair = fit.means
    found = fit.mean + of_first[:, None] + of_last + of_pair.reshape(pairs)
    return np.asarray(found)
