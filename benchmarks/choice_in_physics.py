"""Whether the chain's choices and its pruning matter: walked in the same worlds.

Usage: python benchmarks/choice_in_physics.py [--walks 40] [--sets 4] [--seed 601].
Trains the paper's gait of RES as a build does, several times over the same candidates,
and walks held-out sequences of step lengths in held-out worlds. Every rule walks the
same sequences in the same worlds; only the poses in between are its own. A step that
fell, or was not made after a fall, costs 1.
"""

import argparse
from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np

from gaitchain.build.gait_build import Candidates, Draw
from gaitchain.build.jobs import run_jobs
from gaitchain.build.keypose import KEY_POSE_BUILD
from gaitchain.build.rollout import PhysicsCost, WalkResult
from gaitchain.build.training_walks import Samples, walk_gaits
from gaitchain.build.workers import Crew, available_cores
from gaitchain.chain.expectation import expected_costs, path_costs, pose_costs
from gaitchain.chain.layered_chain import FloatArray, IntArray, LayeredChain
from gaitchain.chain.policy import cost_to_go, forbid, greedy, look_ahead
from gaitchain.chain.pruning import prune
from gaitchain.chain.sampling import Mask, draw_walks
from gaitchain.chain.training import train_by_cost
from gaitchain.gait.build_config import BuildConfig
from gaitchain.robot.box_robot import load_box_robot
from gaitchain.sim.world_range import WorldRange

Costs = Sequence[FloatArray]
Choose = Callable[[int, int], IntArray]
STEPS, EPSILON = 6, 1.0
ALL = "look ahead"


def ahead(paths: Costs, allowed: Sequence[Mask]) -> Choose:
    costs = forbid(paths, allowed)
    return lambda first, last: look_ahead(costs, first, [last])


def greedily(edges: Costs, allowed: Sequence[Mask]) -> Choose:
    """The paper's rule; edges from which the step cannot end there are closed."""
    ways = forbid([np.zeros(mask.shape) for mask in allowed], allowed)

    def choose(first: int, last: int) -> IntArray:
        end = np.full(allowed[-1].shape[1], np.inf)
        end[last] = 0.0
        left = cost_to_go(ways, end)
        layers = enumerate(zip(edges, ways, strict=True))
        open_edges = [
            np.where(np.isfinite(way + left[i + 1]), cost, np.inf)
            for i, (cost, way) in layers
        ]
        return greedy(open_edges, first, [last])

    return choose


def at_random(allowed: Sequence[Mask], rng: np.random.Generator) -> Choose:
    def choose(first: int, last: int) -> IntArray:
        noise = [rng.random(mask.shape) for mask in allowed]
        return ahead(noise, allowed)(first, last)

    return choose


def kept_poses(drawn: Candidates, chain: LayeredChain, costs: Costs) -> list[Mask]:
    """Allowed edges between the poses that pruning keeps."""
    landings = np.unique(drawn.edges[2], axis=0, return_inverse=True)[1].reshape(-1)
    classes = [np.zeros(n, np.int64) for n in drawn.poses.counts]
    classes[2] = landings
    kept = prune(chain, costs, EPSILON, layers=[1, 2], classes=classes).kept
    masks = [
        np.isin(np.arange(n), k) for n, k in zip(drawn.poses.counts, kept, strict=True)
    ]
    return [
        edges & one[:, None] & other
        for edges, (one, other) in zip(drawn.edges, pairwise(masks), strict=True)
    ]


def rules(
    drawn: Candidates, taught: Samples, uniform: Samples, rng: np.random.Generator
) -> dict[str, tuple[Choose, Sequence[Mask]]]:
    """Every rule of one training, and the edges that it needs."""
    sizes, allowed = drawn.poses.counts, drawn.edges
    edges = expected_costs(sizes, *taught[:2], shrink=None)
    paths = path_costs(sizes, *taught[:2], shrink=None)
    fixed = path_costs(sizes, *uniform[:2])
    even = path_costs(sizes, *uniform[:2], shrink=None)
    chain, costs = train_by_cost(edges.cost), pose_costs(edges)
    cheap = kept_poses(drawn, chain, costs)
    dear = kept_poses(drawn, chain, [-c for c in costs])
    lucky = kept_poses(drawn, chain, [rng.random(n) for n in sizes])
    return {
        ALL: (ahead(paths, allowed), allowed),
        "greedy": (greedily(edges.cost, allowed), allowed),
        "look ahead, uniform walks": (ahead(even, allowed), allowed),
        "and shrunk by one gait": (ahead(fixed, allowed), allowed),
        "at random": (at_random(allowed, rng), allowed),
        "costliest": (ahead([-p for p in paths], allowed), allowed),
        "pruned, cheapest kept": (ahead(paths, cheap), cheap),
        "pruned, any kept": (ahead(paths, lucky), lucky),
        "pruned, costliest kept": (ahead(paths, dear), dear),
    }


def walked(source: PhysicsCost, walk: IntArray, seed: tuple[int, ...]) -> WalkResult:
    return source.measure(walk, WorldRange().draw(np.random.default_rng(seed)))


def main() -> None:
    parser = argparse.ArgumentParser()
    for name, default in (("walks", 40), ("sets", 4), ("seed", 601)):
        parser.add_argument(f"--{name}", type=int, default=default)
    asked = parser.parse_args()
    workers = max(available_cores() - 1, 1)
    crew = Crew(workers, lambda *news: None, WorldRange())
    config, rng = BuildConfig(), np.random.default_rng(asked.seed)
    robot = load_box_robot("res")
    drawn = KEY_POSE_BUILD.draw(
        Draw(config, robot, np.random.default_rng(0), rng, crew)
    )
    sets = [
        rules(
            drawn,
            *(walk_gaits(config, drawn, rng, crew, directed=d) for d in (True, False)),
            rng,
        )
        for _ in range(asked.sets)
    ]
    needed = [masks for rule in sets for _, masks in rule.values()]
    joined = np.all([np.linalg.multi_dot([*map(np.int64, m)]) > 0 for m in needed], 0)
    ends = draw_walks(drawn.edges, asked.walks, STEPS, rng, joined)
    source = PhysicsCost(drawn.poses, drawn.timing)
    found = {}
    for name in sets[0]:
        jobs = [
            (
                source,
                np.stack([rule[name][0](a, b) for a, *_, b in walk.tolist()]),
                (asked.seed, i),
            )
            for rule in sets
            for i, walk in enumerate(ends)
        ]
        results = list(run_jobs(walked, jobs, WalkResult, workers))
        costs = np.array([np.nan_to_num(r.cost, nan=1.0).mean() for r in results])
        found[name] = costs.reshape(len(sets), -1).mean(axis=0)
        off = found[name] - found[ALL]
        wide = 1.96 * off.std(ddof=1) / np.sqrt(len(off))
        print(
            f"{name:>26}: cost {found[name].mean():.4f}, over {ALL!r} "
            f"{off.mean():+.4f} +- {wide:.4f}, falls "
            f"{sum(r.fell for r in results)} of {len(results)}",
            flush=True,
        )


if __name__ == "__main__":
    main()
