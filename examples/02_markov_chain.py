# /// script
# dependencies = ["gaitchain"]
# ///
"""Train the paper's chain on Table I and cut it to an independent group.

1. Draw candidates from the printed ranges: 5, 10, 10, 5 poses.
2. Cost random gaits by their planned ZMP (Eq. 3), train by Eq. 5-6.
3. Cut poses that are closer than epsilon (Eq. 2), and choose gaits with what is left.
"""

import numpy as np

from gaitchain.chain.expectation import expected_costs, pose_costs
from gaitchain.chain.layered_chain import LayeredChain, draw_gaits
from gaitchain.chain.policy import greedy, look_ahead
from gaitchain.chain.pruning import prune
from gaitchain.chain.training import train_sequential
from gaitchain.gait.keypose.cost import PlannedCost
from gaitchain.gait.keypose.presets import draw_candidates
from gaitchain.gait.motion import Timing
from gaitchain.robot.box_robot import load_box_robot

rng = np.random.default_rng(0)
poses = draw_candidates(load_box_robot("res"), "table1", rng)
cost = PlannedCost(poses, Timing())

gaits = draw_gaits(poses.counts, 100, rng)
costs = cost(gaits)
chain = train_sequential(LayeredChain.uniform(poses.counts, cyclic=False), gaits, costs)
learned = expected_costs(poses.counts, gaits, costs)
pruned = prune(chain, pose_costs(learned), epsilon=2.5)

print("mean cost of random gaits:", costs.mean().round(3))
print("poses kept per layer:", [len(kept) for kept in pruned.kept])
for policy in (greedy, look_ahead):
    gait = policy(learned.cost, 0)
    print(f"{policy.__name__:>10} from pose 0: {gait}, cost {cost(gait[None])[0]:.3f}")
