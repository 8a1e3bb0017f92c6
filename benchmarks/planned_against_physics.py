"""How well the planned cost (Eq. 3) ranks gaits against the cost measured in MuJoCo.

Walks random gaits of the default preset and prints Spearman's rank correlation of both
costs, over all steps and over those that did not fall.
"""

import numpy as np
from scipy.stats import spearmanr

from gaitchain.build.rollout import PhysicsCost
from gaitchain.build.workers import available_cores
from gaitchain.chain.sampling import draw_walks
from gaitchain.gait.keypose.cost import PlannedCost
from gaitchain.gait.keypose.feasibility import feasible_edges
from gaitchain.gait.keypose.presets import draw_candidates
from gaitchain.gait.motion import Timing
from gaitchain.robot.box_robot import load_box_robot

WALKS, STEPS, SEED = 100, 6, 5


def main() -> None:
    rng = np.random.default_rng(SEED)
    timing = Timing()
    poses = draw_candidates(load_box_robot("res"), "default", rng, timing)
    walks = draw_walks(feasible_edges(poses, timing), WALKS, STEPS, rng)
    gaits = np.stack(walks)
    physics = PhysicsCost(poses, timing, seed=SEED, workers=available_cores())
    planned, measured = PlannedCost(poses, timing)(gaits), physics(gaits)
    known = ~np.isnan(measured)
    upright = known & (measured < 1.0)
    for name, rows in (("all steps", known), ("steps that held", upright)):
        rank = spearmanr(planned[rows], measured[rows]).statistic
        print(f"{name:>16}: {rows.sum():4d} steps, rank correlation {rank:+.2f}")


if __name__ == "__main__":
    main()
