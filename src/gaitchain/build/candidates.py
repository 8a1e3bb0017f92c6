"""What a build may walk: candidate poses of a robot, their rhythm, what fits."""

import math
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from gaitchain.build.config import BuildConfig
from gaitchain.build.qualify import Crew
from gaitchain.build.shape_search import GENERATIONS, search_shape
from gaitchain.build.stride_feasibility import (
    feasible_pairs,
    first_fault,
    joint_speeds,
    longest_strides,
)
from gaitchain.chain.sampling import Mask
from gaitchain.errors import CommandError, LibraryError
from gaitchain.gait.keypose.feasibility import feasible_edges
from gaitchain.gait.keypose.key_poses import STAND, KeyPoses
from gaitchain.gait.keypose.presets import draw_candidates
from gaitchain.gait.motion import Timing
from gaitchain.gait.stride.preset import COUNTS as BRISK_COUNTS
from gaitchain.gait.stride.preset import LONGEST, draw_brisk
from gaitchain.gait.stride.shape import BOX_SHAPE, MODEL_SHAPE, StrideShape
from gaitchain.gait.stride.strides import StridePoses
from gaitchain.robot.reduced_biped import Biped
from gaitchain.sim.world_range import training_worlds


class Candidates(NamedTuple):
    """What can be walked at all."""

    poses: KeyPoses | StridePoses
    timing: Timing
    edges: tuple[Mask, ...]
    """Three masks (N_i, N_{i+1})."""
    pairs: Mask | None
    """(N_1, N_4); None where edges say it all."""


def draw_all(
    config: BuildConfig,
    biped: Biped,
    rngs: tuple[np.random.Generator, np.random.Generator],
    crew: Crew,
) -> Candidates:
    """Search for the step's shape where the config asks for it, and draw candidates.

    Args:
        config: what to build.
        biped: the robot.
        rngs: sources of randomness, of the poses and of the search.
        crew: who does the physics.

    Raises:
        GaitchainError: preset and robot do not fit, or the preset makes no walk.
    """
    draws, searches = rngs
    shape = _search(config, biped, searches, crew)
    timing = config.timing(biped, shape)
    if config.dynamic:
        return _draw_strides(config, biped, shape, timing, draws)
    poses = _key_poses(config, biped, timing, draws)
    return Candidates(poses, timing, feasible_edges(poses, timing), None)


def _search(
    config: BuildConfig, biped: Biped, rng: np.random.Generator, crew: Crew
) -> StrideShape:
    """Search for how the robot steps best, where the config asks for it."""
    generations = config.search
    if generations is None:
        generations = 0 if biped.anatomy is None else GENERATIONS
    start = MODEL_SHAPE if biped.anatomy else BOX_SHAPE
    if not (config.dynamic and generations):
        return start
    poses = draw_brisk(biped, (2, 1, 1, 2), rng)
    given = config.step_s, config.rise_s, config.fall_s
    return search_shape(
        biped,
        rng,
        replace(crew, worlds=training_worlds(poses, config.speed_limit_deg_s)),
        start=start,
        generations=generations,
        seconds=math.inf if config.search_s is None else config.search_s,
        rhythm=None if given == (None,) * 3 else partial(config.timing, biped),
    )


def _draw_strides(
    config: BuildConfig,
    biped: Biped,
    shape: StrideShape,
    timing: Timing,
    rng: np.random.Generator,
) -> Candidates:
    """Draw strides as long as the robot can make them, and see which go together."""
    counts = config.poses_per_layer or BRISK_COUNTS
    speed = joint_speeds(biped, config.speed_limit_deg_s)
    longest = longest_strides(biped, shape, timing, speed, LONGEST)
    poses = draw_brisk(biped, counts, rng, shape, longest)
    sizes = pairwise(poses.counts)
    edges = tuple(np.ones(size, dtype=np.bool_) for size in sizes)
    pairs = feasible_pairs(poses, timing, speed)
    if not pairs[STAND].any():
        fault = first_fault(poses, timing, speed)
        raise LibraryError(
            f"{biped.name} can make no step from a stand: {fault}; `gaitchain inspect "
            "FILE` shows its legs as they were found"
        )
    return Candidates(poses, timing, edges, pairs)


def _key_poses(
    config: BuildConfig, biped: Biped, timing: Timing, rng: np.random.Generator
) -> KeyPoses:
    if biped.anatomy is not None:
        raise CommandError(
            f"preset {config.preset!r} walks the boxes of a reduced biped; for "
            f"{biped.name}, which was read from a robot's model, give preset 'brisk'"
        )
    poses = draw_candidates(
        biped, str(config.preset), rng, timing, config.poses_per_layer
    )
    if not poses.closed:
        raise LibraryError(
            f"preset {config.preset!r} is not closed: kp_4 is not the next step's "
            "kp_1, so no walk can be made of it; use 'default'"
        )
    return poses
