"""Build a gait library: the one place where body and chain meet."""

import math
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from gaitchain.biped import Biped
from gaitchain.brisk import COUNTS as BRISK_COUNTS
from gaitchain.brisk import draw_brisk
from gaitchain.build_config import BuildConfig
from gaitchain.chain import FloatArray, IntArray, LayeredChain
from gaitchain.choice_gain import ChoiceGain, choice_gain
from gaitchain.cost import PlannedCost
from gaitchain.errors import CommandError, LibraryError
from gaitchain.expectation import expected_costs, path_costs, pose_costs
from gaitchain.feasibility import feasible_edges
from gaitchain.library import GaitLibrary
from gaitchain.physics import PhysicsCost
from gaitchain.planned_regret import planned_regret
from gaitchain.policy import Regret, forbid
from gaitchain.poses import KeyPoses
from gaitchain.presets import draw_candidates
from gaitchain.pruning import (
    independent_gaits,
    pose_distances,
    prune,
)
from gaitchain.qualify import Crew, Progress, gate, qualify_steps
from gaitchain.robot.body import load_body
from gaitchain.sampling import Mask, draw_walks
from gaitchain.steady import hold_steady
from gaitchain.stride_feasibility import feasible_pairs
from gaitchain.stride_poses import StridePoses
from gaitchain.training import train_batch, train_sequential
from gaitchain.worlds import training_worlds


@dataclass(frozen=True)
class BuildReport:
    """What building found; none of it is needed to walk."""

    candidates: tuple[int, ...]
    kept: tuple[int, ...]
    mean_cost: float
    """Mean training cost of a step."""
    falls: int
    """Training walks that fell."""
    independent_gaits: int
    """Size of the zeta independent gait group, zeta = epsilon."""
    regret: Regret | None
    """Of both policies on the planned cost, against all gaits; None for strides, whose
    cost is measured only."""
    pairs: int
    """Steps between two poses that physics walked and never fell on."""
    gate_passed: int
    gate_runs: int
    gate_rounds: int
    choice: ChoiceGain
    """What pruning cost and what looking ahead gained, in expected cost."""


def build_library(
    config: BuildConfig,
    progress: Progress | None = None,
    workers: int = 1,
    biped: Biped | None = None,
) -> tuple[GaitLibrary, BuildReport]:
    """Draw candidates, train, prune and qualify.

    The result depends on the config alone: not on the workers, not on the clock.

    Args:
        config: what to build.
        progress: told about every finished piece of work.
        workers: processes for the physics.
        biped: the robot, if it is loaded already.

    Returns:
        The library, qualified or not, and the report.

    Raises:
        GaitchainError: the robot, the preset or a number is not usable.
    """
    seeds = np.random.SeedSequence(config.seed).spawn(3)
    draws, walks, tests = (np.random.default_rng(s) for s in seeds)
    poses = _candidates(
        config, biped or load_body(config.robot, config.profile).biped, draws
    )
    ways = _feasible(config, poses)
    worlds = training_worlds(poses, config.speed_limit_deg_s)
    crew = Crew(workers, progress or (lambda stage, done, total: None), worlds)
    samples = _sample(config, poses, ways, walks, crew)
    draft = _learn(config, poses, ways.edges, samples)
    tested = qualify_steps(
        draft,
        (config.cover_walks, config.steps_per_walk),
        tests,
        crew,
        ways.pairs,
    )
    steady = hold_steady(tested, crew)
    library = gate(steady, config.gate_runs, config.gate_share, config.seed, crew)
    return library, _report(config, poses, ways, samples, drafts=(draft, library))


class _Ways(NamedTuple):
    """What can be walked at all."""

    edges: tuple[Mask, ...]
    """Three masks (N_i, N_{i+1})."""
    pairs: Mask | None
    """(N_1, N_4); None where edges say it all."""


def _feasible(config: BuildConfig, poses: KeyPoses | StridePoses) -> _Ways:
    if isinstance(poses, KeyPoses):
        return _Ways(feasible_edges(poses, config.timing(poses.biped)), None)
    limit = config.speed_limit_deg_s
    speed = poses.biped.joint_speed_limit if limit is None else math.radians(limit)
    sizes = pairwise(poses.counts)
    edges = tuple(np.ones(size, dtype=np.bool_) for size in sizes)
    return _Ways(edges, feasible_pairs(poses, config.timing(poses.biped), speed))


def _report(
    config: BuildConfig,
    poses: KeyPoses | StridePoses,
    ways: _Ways,
    samples: "_Samples",
    *,
    drafts: tuple[GaitLibrary, GaitLibrary],
) -> BuildReport:
    draft, library = drafts
    full = path_costs(poses.counts, samples.gaits, samples.costs)
    gain = choice_gain(
        forbid(full, ways.edges),
        draft.path_costs,
        draft.edge_costs,
        library.allowed_pairs,
    )
    return BuildReport(
        candidates=poses.counts,
        kept=library.poses.counts,
        mean_cost=float(samples.costs.mean()),
        falls=samples.falls,
        independent_gaits=_gait_group_size(draft, config.least_distance),
        regret=None
        if isinstance(poses, StridePoses)
        else planned_regret(poses, config.timing(poses.biped), ways.edges, config.seed),
        pairs=int(library.allowed_pairs.sum()),
        gate_passed=int(library.qualification["schedules_survived"]),
        gate_runs=config.gate_runs,
        gate_rounds=int(library.qualification["rounds"]),
        choice=gain,
    )


class _Samples(NamedTuple):
    """What training learns from."""

    gaits: IntArray
    """(G, 4) pose indices."""
    costs: FloatArray
    """(G,) f of each gait."""
    falls: int
    """Walks that fell."""


def _candidates(
    config: BuildConfig, biped: Biped, rng: np.random.Generator
) -> KeyPoses | StridePoses:
    if config.dynamic:
        counts = config.poses_per_layer or BRISK_COUNTS
        return draw_brisk(biped, counts, rng)
    if biped.anatomy is not None:
        raise CommandError(
            f"preset {config.preset!r} walks the boxes of a reduced biped; for "
            f"{biped.name}, which was read from a robot's model, give preset 'brisk'"
        )
    poses = draw_candidates(
        biped, config.preset, rng, config.timing(biped), config.poses_per_layer
    )
    if not poses.closed:
        raise LibraryError(
            f"preset {config.preset!r} is not closed: kp_4 is not the next step's "
            "kp_1, so no walk can be made of it; use 'default'"
        )
    return poses


def _sample(
    config: BuildConfig,
    poses: KeyPoses | StridePoses,
    ways: _Ways,
    rng: np.random.Generator,
    crew: Crew,
) -> _Samples:
    walks = draw_walks(ways.edges, config.walks, config.steps_per_walk, rng, ways.pairs)
    gaits = np.concatenate(walks)
    if config.cost == "planned":
        if isinstance(poses, StridePoses):
            raise CommandError(
                "cost = 'planned': strides are planned with the ZMP in the sole, so "
                "their cost is measured; give physics"
            )
        return _Samples(gaits, PlannedCost(poses, config.timing(poses.biped))(gaits), 0)
    seed = int(rng.integers(2**31))
    source = PhysicsCost(
        poses,
        config.timing(poses.biped),
        worlds=crew.worlds,
        seed=seed,
        workers=crew.workers,
    )
    walked = source.walk_all(walks)
    results = list(crew.told("training in physics", walked, len(walks)))
    costs = np.concatenate([r.cost for r in results])
    known = ~np.isnan(costs)  # steps after a fall were never made
    return _Samples(gaits[known], costs[known], sum(r.fell for r in results))


def _learn(
    config: BuildConfig,
    poses: KeyPoses | StridePoses,
    allowed: tuple[Mask, ...],
    samples: _Samples,
) -> GaitLibrary:
    """Train the chain, prune it, and keep the expected costs of what is left."""
    gaits, costs, _ = samples
    if config.training == "sequential":
        chain = train_sequential(LayeredChain.uniform(poses.counts), gaits, costs)
    else:
        chain = train_batch(poses.counts, gaits, costs)
    learned = expected_costs(poses.counts, gaits, costs)
    ahead = path_costs(poses.counts, gaits, costs)
    pruned = prune(
        chain,
        pose_costs(learned),
        config.least_distance,
        layers=[1, 2],
        classes=_landing_classes(poses, allowed),
    )
    kept = pruned.kept
    pairs = len(kept[0]), len(kept[3])
    return GaitLibrary(
        poses=poses.keep(kept),
        timing=config.timing(poses.biped),
        chain=pruned.chain,
        edge_costs=_keep_edges(forbid(learned.cost, allowed), kept),
        path_costs=_keep_edges(forbid(ahead, allowed), kept),
        pair_advance=np.zeros(pairs),
        pair_runs=np.zeros(pairs, dtype=np.int64),
        pair_passes=np.zeros(pairs, dtype=np.int64),
        config=asdict(config),
        qualification={},
    )


def _landing_classes(
    poses: KeyPoses | StridePoses, allowed: tuple[Mask, ...]
) -> list[IntArray]:
    """Label kp_3 by where it can land: each serves speeds of its own."""
    classes = [np.zeros(n, dtype=np.int64) for n in poses.counts]
    classes[2] = np.unique(allowed[2], axis=0, return_inverse=True)[1].reshape(-1)
    return classes


def _keep_edges(
    costs: tuple[FloatArray, ...], kept: tuple[IntArray, ...]
) -> tuple[FloatArray, ...]:
    return tuple(c[np.ix_(kept[i], kept[i + 1])] for i, c in enumerate(costs))


def _gait_group_size(draft: GaitLibrary, zeta: float) -> int:
    gaits = draft.gait_of.reshape(-1, 4)
    gaits = gaits[gaits[:, 0] >= 0]
    costs = sum(c[gaits[:, i], gaits[:, i + 1]] for i, c in enumerate(draft.path_costs))
    distances = pose_distances(draft.chain)
    return len(independent_gaits(gaits, distances, np.asarray(costs), zeta))
