"""A library's robot in its vendor's own model, beside the model that it was built in.

    python benchmarks/vendor_model.py ROBOT.xml LIBRARY [--seconds 20]

Walks straight ahead at half, 0.7 and all of the library's speed, once with every joint,
actuator and contact of the vendor's file and once in our model, where all but the legs
is rigid, and prints both speeds over the walk's second half.
"""

import argparse
from pathlib import Path

import mujoco
import numpy as np

from gaitchain.backends.model import ModelBackend
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.library_file import load_library
from gaitchain.messages import Command
from gaitchain.walker.walker import Walker

_SECOND = 100


def main() -> None:
    """Walk in both models, and print a row for each speed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("robot", type=Path)
    parser.add_argument("library", type=Path)
    parser.add_argument("--seconds", type=int, default=20)
    asked = parser.parse_args()
    library = load_library(asked.library)
    print(f"{'commanded':>9} {'vendor':>10} {'ours':>10}  [m/s]")
    for part in (0.5, 0.7, 1.0):
        speed = part * library.command_range.vx[1]
        row = (
            spoken(in_vendors_model, asked.robot, library, speed, asked.seconds),
            spoken(in_our_model, library, speed, asked.seconds),
        )
        print(f"{speed:9.3f} {row[0]:>10} {row[1]:>10}", flush=True)


def spoken(walk, *args) -> str:
    """The speed of a walk, or when it fell."""
    speed, fell = walk(*args)
    return f"{speed:.3f}" if fell is None else f"fell {fell:.1f} s"


def in_vendors_model(path: Path, library: GaitLibrary, speed: float, seconds: int):
    spec = mujoco.MjSpec.from_file(str(path))
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 0.1])
    robot = ModelBackend(spec.compile(), library)
    walker = Walker(library, joint_names=robot.joint_names)
    return walked(walker, robot, speed, seconds)


def in_our_model(library: GaitLibrary, speed: float, seconds: int):
    walker = Walker(library)
    return walked(walker, MujocoBackend(library.robot), speed, seconds)


def walked(walker: Walker, robot, speed: float, seconds: int):
    """(speed [m/s] over the second half, second of the fall or None)."""
    robot.connect(walker.stand)
    for _ in range(_SECOND):
        robot.write(walker.step(robot.read()).position)
    walker.command(Command(speed))
    places = []
    for tick in range(seconds * _SECOND):
        robot.write(walker.step(robot.read()).position)
        places.append(robot.data.qpos[:2].copy())
        if robot.fallen:
            return float("nan"), tick / _SECOND
    half = len(places) // 2
    moved = np.hypot(*(places[-1] - places[half]))
    return moved / (len(places) - half) * _SECOND, None


if __name__ == "__main__":
    main()
