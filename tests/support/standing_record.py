"""A record of a robot that stands, to be changed by hand."""

import math

import numpy as np

from gaitchain.analysis.record import WalkRecord
from gaitchain.gait.zmp import sole_corners
from gaitchain.messages import GRAVITY
from gaitchain.robot.box_robot import load_box_robot

RES = load_box_robot("res")


PERIOD = 0.01


TICKS = 100  # per step, in these records


LEFT, RIGHT = (0.0, 0.1, 0.0), (0.0, -0.1, 0.0)


def record(x, *, fell_at_s=None, **changes):
    """Standing still in all but x, both feet side by side under the hips."""
    rows, planned = len(x), (0, TICKS, 2 * TICKS, 3 * TICKS)
    qpos = np.zeros((rows, 19))
    qpos[:, 0], qpos[:, 2], qpos[:, 3] = x, 0.6, 1.0
    values = {
        "time_s": PERIOD * np.arange(rows),
        "target": np.zeros((rows, 12)),
        "joint_position": np.zeros((rows, 12)),
        "joint_velocity": np.zeros((rows, 12)),
        "torque": np.zeros((rows, 12)),
        "qpos": qpos,
        "zmp": np.zeros((rows, 2)),
        "planned_zmp": np.full((rows, 2), math.nan),
        "feet": np.tile([LEFT, RIGHT], (rows, 1, 1)),
        "soles": np.tile(
            [sole_corners(RES, f[:2]) for f in (LEFT, RIGHT)], (rows, 1, 1, 1)
        ),
        "foot_load": np.full((rows, 2), 0.5 * RES.reduced.mass * GRAVITY),
        "foot_height": np.zeros((rows, 2)),
        "foot_speed": np.zeros((rows, 2)),
        "touch_down": np.zeros((rows, 2), dtype=bool),
        "tilt": np.zeros((rows, 2)),
        "estimated_tilt": np.full((rows, 2), math.nan),
        "self_contact": np.zeros(rows, dtype=bool),
        "support": np.full(rows, "stand"),
        "key_pose": np.zeros((rows, 2), dtype=np.int64),
        "step_ticks": tuple(t for t in planned if fell_at_s is not None or t <= rows),
        "fell_at_s": fell_at_s,
    }
    return WalkRecord(**{**values, **changes})
