"""How many walks between random way points a robot completes, and how near it comes.

Usage: python benchmarks/waypoint_walks.py LIBRARY [--punches 20] [--runs 100]
[--seed 900] [--seconds 90]. Every 5 s there is a new way point: within 1 m of the last
one, in any direction, its heading within 90 deg of the last one's. Arms swing at random
in every walk; each 5 s a punch of up to so many N s hits a random body from a random
direction in space for 0.08 s. Worlds are those of `gaitchain trial`. What a robot
missed at the end of each 5 s is that of the walks until they fall.
"""

import argparse
import math
from typing import Any, NamedTuple

import numpy as np

from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.build.jobs import run_jobs
from gaitchain.build.trial import draw_world
from gaitchain.build.workers import available_cores
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.library_file import load_library
from gaitchain.messages import CONTROL_PERIOD_S, Command
from gaitchain.sim.push import Punches
from gaitchain.walker.place import Place
from gaitchain.walker.walker import Walker
from gaitchain.walker.waypoints import near_of, steer

EVERY_S, FAR, TURN = 5.0, 1.0, math.radians(90.0)
LOOK_S = 0.1  # between two looks at the way


class Result(NamedTuple):
    """One walk."""

    held_s: float
    """Until the fall, or all of the time [s]."""
    missed: list[tuple[float, float]]
    """Distance [m] and turn [rad] from each way point at the end of its time."""


def walk(
    library: GaitLibrary, run: tuple[int, int], punch_ns: float, seconds: float
) -> Result:
    """Walk from way point to way point.

    Args:
        library: of strides.
        run: seed and number of the run, which give the world and the way points.
        punch_ns: largest punch; 0 for none.
        seconds: length of the walk.
    """
    rng = np.random.default_rng(run)
    fixed: dict[str, Any] = {"arms": "random"}
    if punch_ns:
        fixed["punches"] = Punches(punch_ns, EVERY_S)
    world = draw_world(library, run, rng, fixed=fixed)
    walker, backend = Walker(library), MujocoBackend(library.robot, world)
    stand_still(walker, backend)
    near = near_of(library)
    slow_s, goal, start = 2.0 * library.timing.step, Place(), place_of(backend)
    missed: list[tuple[float, float]] = []
    look, change = (round(s / CONTROL_PERIOD_S) for s in (LOOK_S, EVERY_S))
    for tick in range(round(seconds / CONTROL_PERIOD_S)):
        if tick % change == 0:
            if tick:
                off = goal.seen_from(place_of(backend).seen_from(start))
                missed.append((math.hypot(off.x, off.y), abs(off.yaw)))
            goal = next_goal(goal, rng)
        if tick % look == 0:
            off = goal.seen_from(walker.place or Place())
            there = near.holds(off)
            way = Command() if there else steer(off, walker.command_range, slow_s)
            walker.command(way)
        backend.write(walker.step(backend.read()).position)
        if backend.fallen:
            return Result(tick * CONTROL_PERIOD_S, missed)
    return Result(seconds, missed)


def stand_still(walker: Walker, backend: MujocoBackend) -> None:
    """Let the robot stand for a second and learn its IMU's bias; start the pushes."""
    backend.connect(walker.stand)
    backend.stop_clock()
    for _ in range(round(walker.gait.rest_s / CONTROL_PERIOD_S)):
        backend.write(walker.step(backend.read()).position)
    backend.start_clock()


def next_goal(last: Place, rng: np.random.Generator) -> Place:
    """Draw a way point from the last one."""
    distance, bearing = FAR * math.sqrt(rng.random()), rng.uniform(0.0, math.tau)
    goal = last.moved(distance * math.cos(bearing), distance * math.sin(bearing))
    return goal._replace(yaw=last.yaw + float(rng.uniform(-TURN, TURN)))


def place_of(backend: MujocoBackend) -> Place:
    """Return where the robot really is: between its feet, with its trunk's heading."""
    x, y, _ = backend.foot_positions().mean(axis=0).tolist()
    return Place(x, y, backend.heading)


def main() -> None:
    """Read the options, walk, and print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("library")
    parser.add_argument("--punches", type=float, default=0.0, help="at most [N s]")
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--seed", type=int, default=900)
    parser.add_argument("--seconds", type=float, default=90.0)
    options = parser.parse_args()
    library = load_library(options.library)
    jobs = [
        (library, (options.seed, i), options.punches, options.seconds)
        for i in range(options.runs)
    ]
    found = list(run_jobs(walk, jobs, Result, available_cores()))
    held_s = np.array([result.held_s for result in found])
    done = int((held_s >= options.seconds).sum())
    missed = np.array([off for result in found for off in result.missed])
    print(f"completed {done} of {len(found)}; mean time {held_s.mean():.1f} s")
    if missed.size:
        middle, late = np.quantile(missed, (0.5, 0.95), axis=0)
        for name, (metres, turn) in {"median": middle, "95 %": late}.items():
            print(f"missed, {name}: {metres:.2f} m, {math.degrees(turn):.1f} deg")


if __name__ == "__main__":
    main()
