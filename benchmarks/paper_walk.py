"""The paper's walk in twenty worlds: who falls, and how well each segment is met.

Usage: python benchmarks/paper_walk.py LIBRARY [SEED]. Friction 0.6 to 1.0, servo gain
+-10 %, mass +-5 %; the first world is the nominal one.
"""

import sys

import numpy as np

from gaitchain.analysis.simulated_walk import run_schedule
from gaitchain.analysis.walk_metrics import WalkSummary, summarise
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.build.rollout import WorldRange
from gaitchain.gait.library_file import load_library
from gaitchain.gait.schedule import PAPER_WALK, parse_schedule
from gaitchain.sim.model import World
from gaitchain.walker.walker import Walker

WORLDS = 20


def walk(path: str, seed: int) -> list[WalkSummary]:
    library, rng = load_library(path), np.random.default_rng(seed)
    schedule = parse_schedule(PAPER_WALK)
    worlds = [World(), *(WorldRange().draw(rng) for _ in range(WORLDS - 1))]
    summaries = []
    for world in worlds:
        backend = MujocoBackend(library.robot, world)
        record = run_schedule(Walker(library, feedback=False), backend, schedule)
        summaries.append(summarise(library.robot, record, schedule))
    return summaries


def main() -> None:
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else 1000
    summaries = walk(sys.argv[1], seed)
    held = [s for s in summaries if not s.fell]
    print(f"{len(held)} of {len(summaries)} worlds without a fall")
    for i, commanded in enumerate(s.commanded_mps for s in summaries[0].segments):
        achieved = np.array([s.segments[i].achieved_mps for s in held])
        off = 100.0 * (achieved / commanded - 1.0)
        print(
            f"{commanded:.2f} m/s: mean {achieved.mean():.4f}, off by "
            f"{off.min():+.0f} to {off.max():+.0f} %, nominal world {off[0]:+.0f} %"
        )
    print(
        f"joints at most {max(s.max_joint_angle_deg for s in held):.0f} deg, "
        f"{max(s.max_joint_speed_deg_s for s in held):.0f} deg/s; ZMP inside "
        f"{np.mean([s.zmp_inside_support for s in held]):.0%}"
    )


if __name__ == "__main__":
    main()
