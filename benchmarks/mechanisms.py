"""What each mechanism of the balance, and each choice of the chain, is worth.

Usage: python benchmarks/mechanisms.py LIBRARY [--disturbed once] [--push 0.25]
[--vx 0.6] [--runs 24] [--seed 77] [--only [NAME ...]] [--against OTHER]. Every variant,
and the OTHER library, walks in the same worlds. By default it is pushed once, in 8
directions for each run; `--disturbed` names walks of 20 s over blocks, with a push each
second, with punches, on a slippery floor, with late servos or a loose waist. The table
gives the part of the walks that hold, and the difference to the whole one with its 95 %
interval, by bootstrap over the runs.
"""

import argparse
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from gaitchain.analysis.simulated_walk import run_unrecorded
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.build.jobs import run_jobs
from gaitchain.build.push import impulse_unit_ns
from gaitchain.build.trial import draw_world, without_caution
from gaitchain.build.workers import available_cores
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.library_file import load_library
from gaitchain.gait.schedule import Segment
from gaitchain.gait.stride.strides import StridePoses
from gaitchain.messages import Command
from gaitchain.sim.push import Punches, Push
from gaitchain.walker.stride_setup import make_walk
from gaitchain.walker.walker import Walker

DIRECTIONS = 8
BEFORE_S, AFTER_S = 4.0, 4.0  # of walking
RESAMPLES = 2000
WALK_S, BLOCKS = 20.0, 0.034  # s; leg
PUSHED, PUNCHED = 0.16, 0.25  # m sqrt(g h): each second, and at most each 5 s
SLIPPERY, LATE_S = 0.4, 0.04  # friction; delay of the servos' targets
LOOSE = 4.0  # stiffness of the waist over m g h
NEVER = 1e9
# Factors on the gains that take a mechanism out.
WITHOUT: dict[str, dict[str, float]] = {
    "the reference follows the robot": {"follow": 0.0},
    "ankles": {"ankle": 0.0},
    "landing is moved": {"landing_reach": 0.0},
    "touch-down sooner or later": {"sooner": NEVER, "later": NEVER},
    "early touch-down, landing as it is": {"pushed": NEVER},
    "hips at touch-down as they are": {"sag_reach": 0.0},
    "trunk's tilt corrected by the hip": {"trunk": 0.0},
    "half of that on both feet": {"settled_trunk": 2.0},
    "swing foot corrected for the tilt": {"swing_tilt": 0.0},
    "hind foot lifts its heel": {"stretched": NEVER},
    "CoM offset learned": {"learning": 0.0},
    "angular momentum in the DCM": {"turning": 0.0},
}


class Variant(NamedTuple):
    """A controller that is compared."""

    name: str
    library: GaitLibrary


def variants(library: GaitLibrary) -> list[Variant]:
    """Return the whole controller first, then what differs in one thing."""
    gains = make_walk(library.poses_as(StridePoses), library.timing).gains
    unseen = np.full_like(library.pair_slip, NEVER)
    beside = {"feet cross": {"across": -gains.narrowest / gains.across}}
    return [
        Variant("everything", library),
        Variant("nearest stride", without_caution(equal_costs(library))),
        Variant("strides' costs all alike", equal_costs(library)),
        Variant("steps as commanded", without_caution(library)),
        Variant("slip not seen", replace(library, pair_slip=unseen)),
        *(
            Variant(f"without: {name}", with_gains(library, factors))
            for name, factors in {**WITHOUT, **beside}.items()
        ),
    ]


def equal_costs(library: GaitLibrary) -> GaitLibrary:
    """Return a library whose chain prefers nothing: all its costs are 0."""

    def level(costs: tuple[np.ndarray, ...]) -> tuple[np.ndarray, ...]:
        return tuple(np.where(np.isfinite(c), 0.0, np.inf) for c in costs)

    return replace(
        library,
        edge_costs=level(library.edge_costs),
        path_costs=level(library.path_costs),
    )


def with_gains(library: GaitLibrary, factors: dict[str, float]) -> GaitLibrary:
    """Return a library with factors on gains, on top of its own."""
    poses = library.poses_as(StridePoses)
    own = dict(poses.balance)
    for name, factor in factors.items():
        own[name] = own.get(name, 1.0) * factor
    return replace(library, poses=replace(poses, balance=own))


def held_walk(
    variant: Variant, run: tuple[int, int], kind: str, vx: float
) -> list[bool]:
    """Return whether a walk of 20 s holds.

    Args:
        variant: the controller.
        run: seed and number of the run, which give the world.
        kind: as `--disturbed`.
        vx: speed over the fastest one.
    """
    library, rng = variant.library, np.random.default_rng(run)
    scale_ns, leg = impulse_unit_ns(library), library.robot.reduced.leg_length
    disturbed: dict[str, Any] = {
        "blocks": {"blocks_m": BLOCKS * leg},
        "punches": {"punches": Punches(PUNCHED * scale_ns)},
        "slippery": {"friction": SLIPPERY},
        "late": {"delay_s": LATE_S},
        "loose": {"waist": LOOSE},
        "pushes": {
            "push": tuple(
                Push(PUSHED * scale_ns, float(rng.uniform(-180.0, 180.0)), at_s)
                for at_s in np.arange(2.0, WALK_S).tolist()
            )
        },
    }
    world = draw_world(library, run, rng, fixed=disturbed[kind])
    walker = Walker(library, require_qualified=False)
    speed = Command(vx * library.command_range.vx[1])
    backend = MujocoBackend(library.robot, world)
    walked = run_unrecorded(walker, backend, (Segment(speed, WALK_S),))
    return [walked.fell_at_s is None]


def held(variant: Variant, run: tuple[int, int], part: float, vx: float) -> list[bool]:
    """Return for each direction whether a walk holds its push.

    Args:
        variant: the controller.
        run: seed and number of the run, which give world and moment.
        part: impulse over m sqrt(g h).
        vx: speed over the fastest one.
    """
    library, rng = variant.library, np.random.default_rng(run)
    world = draw_world(library, run, rng)
    at_s = round(BEFORE_S + float(rng.uniform(0.0, 2.0)) * library.timing.step, 2)
    impulse_ns = part * impulse_unit_ns(library)
    speed = Command(vx * library.command_range.vx[1])
    walker = Walker(library, require_qualified=False)
    found = []
    for side in np.arange(DIRECTIONS) * 360.0 / DIRECTIONS:
        push = (Push(impulse_ns, float(side), at_s),)
        backend = MujocoBackend(library.robot, replace(world, push=push))
        walker.reset()
        ahead = (Segment(speed, at_s + AFTER_S),)
        found.append(run_unrecorded(walker, backend, ahead).fell_at_s is None)
    return found


def interval(change: np.ndarray) -> tuple[float, float]:
    """Return the 95 % interval of the mean over the runs, by bootstrap.

    Args:
        change: (runs,) difference of each run's part that holds.
    """
    drawn = np.random.default_rng(0).choice(change, (RESAMPLES, len(change)))
    low, high = np.quantile(drawn.mean(axis=1), (0.025, 0.975)).tolist()
    return low, high


def compare(options: argparse.Namespace, show: Callable[[str], None]) -> None:
    """Walk every variant; show one row of the table for each."""
    runs = [(options.seed, i) for i in range(options.runs)]
    show("| variant | holds | difference | 95 % interval |")
    show("|---|---|---|---|")
    whole = np.full(len(runs), math.nan)
    library = load_library(options.library)
    shown = variants(library)
    if options.only is not None:
        names = ("everything", *options.only)
        shown = [variant for variant in shown if variant.name in names]
    if options.against:
        shown.append(Variant(options.against, load_library(options.against)))
    for variant in shown:
        once = options.disturbed == "once"
        how = options.push if once else options.disturbed
        jobs = [(variant, run, how, options.vx) for run in runs]
        found = run_jobs(held if once else held_walk, jobs, list, available_cores())
        parts = np.array([np.mean(walks) for walks in found])
        if variant.name == "everything":
            whole = parts
        change = parts - whole
        low, high = interval(change)
        mean = f"{parts.mean():.3f} | {change.mean():+.3f} | {low:+.3f} to {high:+.3f}"
        show(f"| {variant.name} | {mean} |")


def main() -> None:
    """Read the options, and print the table row by row."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("library")
    kinds = ("once", "blocks", "pushes", "punches", "slippery", "late", "loose")
    parser.add_argument("--disturbed", choices=kinds, default="once")
    parser.add_argument("--push", type=float, default=0.25, help="over m sqrt(g h)")
    parser.add_argument("--vx", type=float, default=0.6, help="of the fastest")
    parser.add_argument("--runs", type=int, default=24)
    parser.add_argument("--seed", type=int, default=77)
    parser.add_argument("--against", help="another library, walked in the same worlds")
    parser.add_argument("--only", nargs="*", help="names of the variants to walk")
    compare(parser.parse_args(), lambda row: print(row, flush=True))


if __name__ == "__main__":
    main()
