# /// script
# dependencies = ["gaitchain"]
# ///
"""Build a small library, walk it in physics, and ask why each pose was chosen.

1. `build_library` draws, trains, prunes and qualifies; small numbers keep it short.
2. A `Walker` turns a commanded speed into servo targets, period by period.
3. Each decision names the runners-up and their costs.
"""

from gaitchain import BuildConfig, Command, MujocoBackend, Walker, build_library

config = BuildConfig(
    poses_per_layer=(5, 10, 10, 5), walks=10, qualification_walks=20, gate_runs=2
)
library, report = build_library(config)
low, high = library.speed_range
print(f"kept {report.kept} poses; walks {low:.3f} to {high:.3f} m/s")

walker = Walker(library)
robot = MujocoBackend(library.robot)
robot.connect(walker.stand)
print("carried out:", walker.command(Command(vx=0.06)))

seen = None
for _ in range(900):  # 9 s at 100 Hz
    robot.write(walker.step(robot.read()).position)
    if walker.decision is not seen:
        seen = walker.decision
        others = ", ".join(f"{n}: {cost:.2f}" for n, cost in seen.runners_up[:3])
        print(f"kp_{seen.layer + 1}: pose {seen.pose}, cost {seen.cost:.2f} ({others})")
print(f"walked {robot.data.qpos[0]:.2f} m")
