"""How near `Walker.go_to` brings a robot to places all around it.

Usage: python benchmarks/go_to.py LIBRARY [--runs 20] [--seed 51] [--far 1.0] [--each].
Each run goes to a place a metre away, in any direction, with any heading, and stands
there. Worlds are those of `gaitchain trial`: each has its own friction, servos, noise
and IMU; `--nominal` leaves the robot as its file has it. What counts is where the
simulator has the middle between the feet and their heading, from where they stood.
"""

import argparse
import math
from typing import NamedTuple

import numpy as np
from waypoint_walks import stand_still

from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.build.jobs import run_jobs
from gaitchain.build.trial import draw_world
from gaitchain.build.workers import available_cores
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.library_file import load_library
from gaitchain.messages import CONTROL_PERIOD_S
from gaitchain.sim.world import World
from gaitchain.walker.place import Place
from gaitchain.walker.walker import Walker

SECONDS = 60.0  # at most
NEAR_M, NEAR_DEG = 0.03, 3.0


class Missed(NamedTuple):
    """One run."""

    metres: float
    degrees: float
    own_metres: float
    """By the robot's own steps."""
    seconds: float
    fell: bool

    @property
    def good(self) -> bool:
        """Whether it stood there, near enough."""
        return not self.fell and self.metres <= NEAR_M and self.degrees <= NEAR_DEG


def go(library: GaitLibrary, run: tuple[int, int], far: float, nominal: bool) -> Missed:
    """Go to one place in one world."""
    rng = np.random.default_rng(run)
    world = World() if nominal else draw_world(library, run, rng, fixed={})
    walker, backend = Walker(library), MujocoBackend(library.robot, world)
    stand_still(walker, backend)
    bearing, yaw = rng.uniform(-math.pi, math.pi, 2)
    goal = Place(far * math.cos(bearing), far * math.sin(bearing), yaw)
    start, ticks = by_feet(backend), 0
    walker.go_to(goal)
    while not backend.fallen and ticks * CONTROL_PERIOD_S < SECONDS:
        backend.write(walker.step(backend.read()).position)
        ticks += 1
        if walker.arrived:
            break
    off = goal.seen_from(by_feet(backend).seen_from(start))
    own = goal.seen_from(walker.place or Place())
    return Missed(
        math.hypot(off.x, off.y),
        abs(math.degrees(math.remainder(off.yaw, math.tau))),
        math.hypot(own.x, own.y),
        ticks * CONTROL_PERIOD_S,
        backend.fallen,
    )


def by_feet(backend: MujocoBackend) -> Place:
    """Return the middle between the feet and the mean of their headings."""
    x, y, _ = backend.foot_positions().mean(axis=0).tolist()
    ahead = backend.data.xmat[backend.feet].reshape(2, 3, 3)[:, :, 0].sum(axis=0)
    return Place(x, y, math.atan2(ahead[1], ahead[0]))


def main() -> None:
    """Read the options, go, and print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("library")
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--seed", type=int, default=51)
    parser.add_argument("--far", type=float, default=1.0, help="distance [m]")
    parser.add_argument("--nominal", action="store_true", help="nothing drawn")
    parser.add_argument("--each", action="store_true", help="print each run")
    options = parser.parse_args()
    library = load_library(options.library)
    jobs = [
        (library, (options.seed, i), options.far, options.nominal)
        for i in range(options.runs)
    ]
    found = list(run_jobs(go, jobs, Missed, available_cores()))
    if options.each:
        for m in found:
            print(
                f"  {100 * m.metres:.1f} cm ({100 * m.own_metres:.1f} by its steps), "
                f"{m.degrees:.1f} deg, {m.seconds:.1f} s{', fell' if m.fell else ''}"
            )
    good, fell = sum(m.good for m in found), sum(m.fell for m in found)
    print(
        f"within {100 * NEAR_M:g} cm and {NEAR_DEG:g} deg: {good} of {len(found)}; "
        f"{fell} fell"
    )
    for name, unit, values in (
        ("missed", "cm", [100 * m.metres for m in found]),
        ("heading", "deg", [m.degrees for m in found]),
        ("time", "s", [m.seconds for m in found]),
    ):
        print(
            f"  {name}: median {np.median(values):.1f}, worst {max(values):.1f} {unit}"
        )


if __name__ == "__main__":
    main()
