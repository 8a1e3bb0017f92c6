"""Logs of exercises that a simulated robot of known numbers made."""

import numpy as np
from servo_bench import RES

from gaitchain.identify.log import ExerciseLog, MotionLog
from gaitchain.identify.simulated import replay
from gaitchain.messages import CONTROL_PERIOD_S
from gaitchain.robot.identified import Identified
from gaitchain.sim.world import World

TRUE = Identified(
    gain=np.tile([0.8, 1.2, 1.3, 0.7, 1.1, 0.9], 2),
    offset=np.zeros(12),
    com=np.zeros(3),
    tilt=np.array([0.02, -0.03, 0.0]),
    delay_s=0.024,
    backlash_deg=np.full(12, 0.6),
)
LEAN = np.array([0.01, 0.02])


def log_of(motion, found=TRUE):
    """Return the log of a motion of RES that differs from its file."""
    robot = RES.as_identified(found)
    seen = replay(robot, motion, LEAN, World(noise=1.0))
    names = RES.legs.joint_names
    part = MotionLog(motion, seen)
    return ExerciseLog(RES.name, RES.fingerprint, names, CONTROL_PERIOD_S, (part,))
