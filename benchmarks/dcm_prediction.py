"""Which DCM the pendulum predicts better: that of the CoM's speed, or of the turning.

Usage: python benchmarks/dcm_prediction.py LIBRARY [--vx 0.5 0.9] [--runs 8]. Walks
straight at parts of the top speed. In each step the pendulum goes from 0.35 to 0.8 of
it, over the ZMP that the simulator's contact forces have; the table says how far it
ends off the robot's true DCM, in legs along the support foot. xi = c + c' / w, or
xi = c + L / (m z w) with L the angular momentum about the foot [Gong22].
"""

import argparse
from collections.abc import Iterator

import mujoco
import numpy as np

from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.balance.state import SINGLE
from gaitchain.build.jobs import run_jobs
from gaitchain.build.trial import draw_world
from gaitchain.build.workers import available_cores
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.library_file import load_library
from gaitchain.messages import CONTROL_PERIOD_S, Command
from gaitchain.walker.stride_gait import StrideGait
from gaitchain.walker.walker import Walker

FIRST, LAST = 0.35, 0.8  # of the step
SECONDS, RUN_IN_S = 12.0, 3.0
KINDS = "CoM's speed", "angular momentum"


def walk(library: GaitLibrary, run: tuple[int, int], vx: float) -> list[np.ndarray]:
    """Return for each step the errors of both predictions, (2, 2) [legs]."""
    world = draw_world(library, run, np.random.default_rng(run))
    walker = Walker(library, require_qualified=False)
    backend, gait = MujocoBackend(library.robot, world), walker.gait
    assert isinstance(gait, StrideGait)
    controller = gait._walk
    backend.connect(walker.stand)
    steps: list[list[np.ndarray]] = []
    start = round(gait.rest_s / CONTROL_PERIOD_S)
    for tick in range(round(SECONDS / CONTROL_PERIOD_S)):
        if tick == start:
            walker.command(Command(vx))
        backend.write(walker.step(backend.read()).position)
        if backend.fallen:
            break
        part = controller.time / controller.times.step
        if tick * CONTROL_PERIOD_S < RUN_IN_S or controller.phase != SINGLE:
            continue
        if part < FIRST:
            steps.append([])
        elif steps and part <= LAST:
            steps[-1].append(truth(backend, controller.times.omega, controller.side))
    omega, leg = controller.times.omega, library.robot.reduced.leg_length
    return [error / leg for error in errors(steps, omega)]


def truth(backend: MujocoBackend, omega: float, side: float) -> np.ndarray:
    """Return both DCMs, the ZMP, and the support foot's axis ahead, (4, 2)."""
    model, data = backend.model, backend.data
    mujoco.mj_subtreeVel(model, data)
    com, speed = data.subtree_com[1], data.subtree_linvel[1]
    turning = data.subtree_angmom[1] / (model.body_mass.sum() * com[2])
    dcm = com[:2] + speed[:2] / omega
    turned = dcm + np.array([turning[1], -turning[0]]) / omega
    yaw = backend.foot_yaws()[0 if side > 0 else 1]
    return np.array([dcm, turned, backend.zmp(), [np.cos(yaw), np.sin(yaw)]])


def errors(steps: list[list[np.ndarray]], omega: float) -> Iterator[np.ndarray]:
    """Yield what each step's predictions missed at its end, (2, 2) [m]."""
    for rows in map(np.array, steps):
        if len(rows) < 5 or np.isnan(rows).any():
            continue
        dcm, (c, s) = rows[0, :2], rows[0, 3]
        for zmp in rows[:-1, 2]:
            dcm = zmp + (dcm - zmp) * np.exp(omega * CONTROL_PERIOD_S)
        yield (rows[-1, :2] - dcm) @ np.array([[c, -s], [s, c]])


def main() -> None:
    """Read the options, walk, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("library")
    parser.add_argument("--vx", type=float, nargs="+", default=[0.5, 0.9])
    parser.add_argument("--runs", type=int, default=8)
    parser.add_argument("--seed", type=int, default=77)
    options = parser.parse_args()
    library = load_library(options.library)
    print("| of the top speed | DCM by | rms ahead [legs] | rms aside [legs] | steps |")
    print("|---|---|---|---|---|")
    for part in options.vx:
        vx = part * library.command_range.vx[1]
        jobs = [(library, (options.seed, i), vx) for i in range(options.runs)]
        walks = run_jobs(walk, jobs, list, available_cores())
        found = np.array([error for errors in walks for error in errors])
        rms = np.sqrt((found**2).mean(axis=0))
        for kind, (ahead, aside) in zip(KINDS, rms, strict=True):
            print(f"| {part:g} | {kind} | {ahead:.3f} | {aside:.3f} | {len(found)} |")


if __name__ == "__main__":
    main()
