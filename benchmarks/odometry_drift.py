"""How far the odometry of a walk drifts: ten metres straight on, and a square.

Usage: python benchmarks/odometry_drift.py LIBRARY [--runs 20] [--seed 41] [--ways
straight square] [--each]. Worlds are those of `gaitchain trial` without pushes: each
has its own friction, servos, noise and IMU. The robot steers by its own steps; what
counts is where its odometry has the trunk at the end, and where the simulator has it,
both from where it stood. Drift is the distance between the two over the way's ten
metres; the trunk's own way is longer, as it sways.
"""

import argparse
import math
from typing import NamedTuple

import mujoco
import numpy as np
from waypoint_walks import stand_still

from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.build.jobs import run_jobs
from gaitchain.build.trial import draw_world
from gaitchain.build.workers import available_cores
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.library_file import load_library
from gaitchain.messages import CONTROL_PERIOD_S, Command
from gaitchain.walker.place import Place
from gaitchain.walker.walker import Walker
from gaitchain.walker.waypoints import near_of, steer

WAYS = {
    "straight": (Place(10.0),),
    "square": (
        Place(2.5, 0.0, math.radians(90.0)),
        Place(2.5, 2.5, math.radians(180.0)),
        Place(0.0, 2.5, math.radians(270.0)),
        Place(0.0, 0.0, math.radians(360.0)),
    ),
}
LENGTH = 10.0  # of each way [m]
LOOK = 10  # control periods between two looks at the way
SECONDS = 60.0  # for each way point


class Drift(NamedTuple):
    """One walk."""

    way: str
    off: Place
    """The odometry's place of the trunk, from where the trunk is."""
    sigma: float
    """The odometry's error over its standard deviation, as Mahalanobis distance."""
    speed: float
    """Root mean square of the velocity's error [m/s]."""
    fell: bool


def walk(library: GaitLibrary, way: str, run: tuple[int, int]) -> Drift:
    """Walk one way in one world."""
    world = draw_world(library, run, np.random.default_rng(run), fixed={})
    walker = Walker(library)
    walker.keep_odometry()
    backend = MujocoBackend(library.robot, world)
    stand_still(walker, backend)
    near, slow_s = near_of(library), 2 * library.timing.step
    start, began = true_place(backend), by_odometry(walker)
    square, ticks = 0.0, 0
    for goal in WAYS[way]:
        until = ticks + round(SECONDS / CONTROL_PERIOD_S)
        while ticks < until and not backend.fallen:
            if ticks % LOOK == 0:
                place = walker.place or Place()
                there = near.holds(goal.seen_from(place))
                if there and walker.standing:
                    break
                off = goal.seen_from(place)
                walker.command(
                    Command() if there else steer(off, walker.command_range, slow_s)
                )
            backend.write(walker.step(backend.read()).position)
            square += speed_error(walker, backend)
            ticks += 1
    real = true_place(backend).seen_from(start)
    told = by_odometry(walker).seen_from(began)
    return Drift(
        way,
        told.seen_from(real),
        spread(walker, told, real),
        math.sqrt(square / ticks),
        backend.fallen,
    )


def true_place(backend: MujocoBackend) -> Place:
    """Return where the simulator has the trunk."""
    x, y = backend.data.qpos[:2].tolist()
    return Place(x, y, backend.heading)


def by_odometry(walker: Walker) -> Place:
    """Return where the odometry has the trunk."""
    found = walker.odometry
    assert found is not None
    return Place(found.place[0], found.place[1], found.attitude[2])


def speed_error(walker: Walker, backend: MujocoBackend) -> float:
    """Return the squared error of the horizontal velocity ahead and to the left."""
    found = walker.odometry
    assert found is not None
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, backend.data.qpos[3:7])
    real = turn.reshape(3, 3).T @ backend.data.qvel[:3]
    return float(((np.array(found.velocity) - real)[:2] ** 2).sum())


def spread(walker: Walker, told: Place, real: Place) -> float:
    """Return the Mahalanobis distance of the error."""
    found = walker.odometry
    assert found is not None
    xx, xy, yy, xt, yt, tt = found.covariance
    covariance = np.array([[xx, xy, xt], [xy, yy, yt], [xt, yt, tt]])
    turn = math.remainder(told.yaw - real.yaw, math.tau)
    error = np.array([told.x - real.x, told.y - real.y, turn])
    return float(np.sqrt(error @ np.linalg.pinv(covariance) @ error))


def main() -> None:
    """Read the options, walk, and print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("library")
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--seed", type=int, default=41)
    parser.add_argument("--ways", nargs="+", choices=tuple(WAYS), default=list(WAYS))
    parser.add_argument("--each", action="store_true", help="print each walk")
    options = parser.parse_args()
    library = load_library(options.library)
    jobs = [
        (library, way, (options.seed, i))
        for way in options.ways
        for i in range(options.runs)
    ]
    found = list(run_jobs(walk, jobs, Drift, available_cores()))
    for way in options.ways:
        show([drift for drift in found if drift.way == way], each=options.each)


def show(found: list[Drift], *, each: bool) -> None:
    """Print the figures of one way."""
    if each:
        for d in found:
            print(
                f"  {d.off.x:+.3f}, {d.off.y:+.3f} m, "
                f"{math.degrees(d.off.yaw):+.2f} deg, {d.sigma:.1f} sigma"
                f"{', fell' if d.fell else ''}"
            )
    stood = [d for d in found if not d.fell]
    part = [100.0 * math.hypot(d.off.x, d.off.y) / LENGTH for d in stood]
    turn = [abs(math.degrees(d.off.yaw)) for d in stood]
    print(f"{found[0].way}: {len(stood)} of {len(found)} walked its {LENGTH:g} m")
    for name, values, unit in (("drift", part, "%"), ("heading", turn, "deg")):
        print(
            f"  {name}: mean {np.mean(values):.2f} {unit}, "
            f"median {np.median(values):.2f} {unit}, worst {np.max(values):.2f} {unit}"
        )
    sigma = np.array([d.sigma for d in stood])
    print(
        f"  error over covariance: rms {np.sqrt((sigma**2).mean() / 3.0):.2f} a "
        f"dimension; velocity: rms {np.mean([d.speed for d in stood]):.3f} m/s"
    )


if __name__ == "__main__":
    main()
