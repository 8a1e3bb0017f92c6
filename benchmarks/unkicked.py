"""Build RES's library from walks that nobody disturbs.

Usage: python benchmarks/unkicked.py LIBRARY. All is as in `gaitchain build res --preset
brisk`, but without pushes in the training walks, and without blocks, pushes, loads and
moving arms in the walks that teach how far to step after a disturbance. What they are
worth: python benchmarks/mechanisms.py res --disturbed pushes --only --against LIBRARY.
"""

import argparse

import numpy as np

from gaitchain.build import families, recovery_walks
from gaitchain.build.pipeline import build_library
from gaitchain.build.stride import StrideBuild
from gaitchain.build.workers import Crew, available_cores
from gaitchain.gait.build_config import BuildConfig
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.library_file import save_library
from gaitchain.gait.stride.family import STRIDES
from gaitchain.gait.stride.strides import StridePoses
from gaitchain.sim.world import World
from gaitchain.sim.world_range import WorldRange


class Unkicked(StrideBuild):
    """Trains strides without pushes."""

    def training_worlds(
        self, poses: StridePoses, speed_limit: float | None
    ) -> WorldRange:
        """Return the usual worlds without their pushes."""
        return super().training_worlds(poses, speed_limit).but(push_ns=0.0)


def draw_calm(
    crew: Crew, library: GaitLibrary, scale_ns: float, seed: tuple[int, int]
) -> World:
    """Draw a world of training, in place of a disturbed one."""
    del library, scale_ns
    return crew.worlds.draw(np.random.default_rng(seed))


def main() -> None:
    """Build and save it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("library")
    asked = parser.parse_args()
    families._BUILDS[STRIDES] = Unkicked()
    recovery_walks._draw_world = draw_calm
    config = BuildConfig(robot="res", preset="brisk")
    library, report = build_library(config, workers=available_cores())
    save_library(library, asked.library)
    print(report)


if __name__ == "__main__":
    main()
