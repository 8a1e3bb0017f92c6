# /// script
# dependencies = ["gaitchain"]
# ///
"""Walk at speed, push the robot from the side, and ask what broke.

1. The preset `brisk` makes a library of strides, walked with balance.
2. A `World` holds what happens to the robot: here a push of 0.1 s on the trunk.
3. `explain` names the first rule that broke before a fall, and what to turn.
"""

from gaitchain import BuildConfig, MujocoBackend, Walker, build_library
from gaitchain.analysis.fall_cause import explain
from gaitchain.analysis.simulated_walk import run_schedule
from gaitchain.gait.schedule import parse_schedule
from gaitchain.sim.world import Push, World

# Small numbers keep it short; leave them out for a library to use.
config = BuildConfig(
    preset="brisk",
    poses_per_layer=(5, 2, 2, 5),
    epsilon=0.0,
    walks=6,
    qualification_walks=15,
    gate_runs=2,
    gate_share=0.5,
)
library, report = build_library(config)
most = library.command_range
print(f"walks {most.vx[0]:.2f} to {most.vx[1]:.2f} m/s")

walker = Walker(library)
schedule = parse_schedule("0.2,0,0@6")  # m/s ahead, to the left, rad/s, for 6 s
for impulse_ns in (0.0, 8.0, 60.0):
    push = Push(impulse_ns, direction_deg=90.0, at_s=3.0)  # to the left
    walker.reset()
    robot = MujocoBackend(library.robot, World(push=(push,)))
    record = run_schedule(walker, robot, schedule)
    print(f"{impulse_ns:g} N s:", explain(library.robot, record).sentence)
