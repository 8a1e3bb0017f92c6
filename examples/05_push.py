# /// script
# dependencies = ["gaitchain"]
# ///
"""Walk at speed, push the robot from the side, and ask what broke.

1. The library of strides that comes with gaitchain walks with balance.
2. A `World` holds what happens to the robot: here a push of 0.1 s on the trunk.
3. `explain` names the first rule that broke before a fall, and what to try.
"""

from importlib.resources import files

from gaitchain import MujocoBackend, Walker
from gaitchain.analysis.fall_cause import explain
from gaitchain.analysis.simulated_walk import run_schedule
from gaitchain.gait.schedule import parse_schedule
from gaitchain.sim.push import Push
from gaitchain.sim.world import World

walker = Walker.load(files("gaitchain") / "data" / "res.gait")
most = walker.command_range
print(f"walks {most.vx[0]:.2f} to {most.vx[1]:.2f} m/s")

schedule = parse_schedule("0.2,0,0@6")  # m/s ahead, to the left, rad/s, for 6 s
for impulse_ns in (0.0, 8.0, 60.0):
    push = Push(impulse_ns, direction_deg=90.0, at_s=3.0)  # to the left
    walker.reset()
    robot = MujocoBackend(walker.library.robot, World(push=(push,)))
    record = run_schedule(walker, robot, schedule)
    print(f"{impulse_ns:g} N s:", explain(walker.library.robot, record).sentence)
