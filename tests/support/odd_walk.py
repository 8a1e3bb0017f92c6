"""Walk a library in physics, and fail if machine code is made or loaded on the way.

    python odd_walk.py LIBRARY

A script of its own: in a process that has walked before, everything is compiled.
"""

import sys
from dataclasses import replace

import numpy as np

from gaitchain import Command, MujocoBackend, Walker
from gaitchain.sim.world import World

TICKS = 1600
PUSHED = (50, 700)
ARRAYS = ("joint_position", "joint_velocity", "angular_velocity", "acceleration")
MANNERS = (np.float32, np.ndarray.tolist, lambda values: np.repeat(values, 2)[::2])


def signatures():
    """Kinds of arguments for which each compiled function has machine code."""
    modules = [m for name, m in sys.modules.items() if name.startswith("gaitchain.")]
    values = [value for module in modules for value in vars(module).values()]
    compiled = [f for f in values if hasattr(f, "nopython_signatures")]
    return {f.py_func.__qualname__: len(f.signatures) for f in compiled}


def main():
    walker = Walker.load(sys.argv[1])
    before = signatures()
    assert sum(before.values()) > 3, before  # the constructor made them
    robot = MujocoBackend(walker.library.robot, World(foot_sensors=True, noise=1.0))
    robot.connect(walker.stand)
    span = walker.command_range
    ends = zip(span.vx, span.vy, span.yaw_rate, strict=True)
    commands = [*(Command(*np.multiply(end, 0.5)) for end in ends), Command()]
    for tick in range(TICKS):
        if tick % 400 == 100:
            walker.command(commands[tick // 400 % len(commands)])
        if tick in PUSHED:
            robot.push(0.05 * walker.library.robot.reduced.mass, 90.0)
        sensors, manner = robot.read(), MANNERS[tick % len(MANNERS)]
        odd = {name: manner(getattr(sensors, name)) for name in ARRAYS}
        robot.write(walker.step(replace(sensors, **odd)).position)
    assert walker.gait.steps > 3
    after = signatures()
    new = {name: n for name, n in after.items() if n != before.get(name, 0)}
    assert not new, new


if __name__ == "__main__":
    main()
