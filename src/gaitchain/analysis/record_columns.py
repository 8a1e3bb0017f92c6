"""Columns of a walk's record that are computed from the simulator's arrays.

These are pose, speed and load of feet and soles, and the ZMP. The arrays of all rows
come from a recorder or from telemetry.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gaitchain.gait.zmp import LEAST_LOAD, to_world, zmp_of_wrench
from gaitchain.messages import CONTROL_PERIOD_S, GRAVITY, Array
from gaitchain.robot.robot import Robot

_AIR_S = 0.05  # least time off the ground before a landing


def columns_from_truth(
    robot: Robot, mass: float, rows: Mapping[str, Array], support: NDArray[np.str_]
) -> dict[str, Any]:
    """Compute the columns of a record that follow from the simulator's arrays.

    Args:
        robot: the robot.
        mass: mass of the simulated robot [kg].
        rows: `time_s` (N,), `place` (N, 2, 3), `turn` (N, 2, 9), `wrench` and `twist`
            (N, 2, 6) of the feet in MuJoCo's convention, `com` (N, 3) of the robot, and
            `planned_zmp` (N, 2) in the support-foot frame.
        support: (N,) planned support, as `WalkRecord.support`.

    Returns:
        `feet`, `soles`, `foot_speed`, `zmp`, `planned_zmp`, `foot_load` and
        `touch_down` of `WalkRecord`.
    """
    soles, wrench = _soles(robot, rows), rows["wrench"]
    least_force = LEAST_LOAD * mass * GRAVITY
    time_s, load = rows["time_s"], wrench[..., 5]
    steps_s = np.diff(time_s) if len(time_s) > 1 else CONTROL_PERIOD_S
    period_s = float(np.median(steps_s))
    air_rows = max(round(_AIR_S / max(period_s, 1e-6)), 1)
    return {
        **soles,
        "zmp": _zmp(wrench.sum(axis=1), rows["com"], least_force),
        "planned_zmp": _planned_zmp(rows["planned_zmp"], soles["feet"], support),
        "foot_load": load,
        "touch_down": _landings(load > least_force, air_rows),
    }


def _soles(robot: Robot, raw: Mapping[str, Array]) -> dict[str, Array]:
    """Compute the poses of feet and soles, and the speed of the soles' centres."""
    place, twist, shape = raw["place"], raw["twist"], robot.reduced
    turn = raw["turn"].reshape(-1, 2, 3, 3)
    centre = place + turn @ [shape.sole_offset, 0.0, -shape.ankle_height]
    # MuJoCo gives the twist at the robot's CoM, as a point fixed to the foot.
    arm = centre - raw["com"][:, None]
    velocity = twist[..., 3:] + np.cross(twist[..., :3], arm)
    yaw = np.arctan2(turn[..., 1, 0], turn[..., 0, 0])
    half = 0.5 * np.array([shape.sole_length, shape.sole_width])
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half
    turned = corners @ np.swapaxes(turn[..., :2, :2], -1, -2)
    return {
        "soles": centre[..., None, :2] + turned,
        "feet": np.concatenate([place[..., :2], yaw[..., None]], axis=-1),
        "foot_speed": np.linalg.norm(velocity[..., :2], axis=-1),
    }


def _zmp(wrench: Array, com: Array, least_force: float) -> Array:
    """Compute the ZMP from wrenches about the CoM, as `SimulatorTruth.zmp` does."""
    torque, force = wrench[:, :3], wrench[:, 3:]
    on_ground = force[:, 2:] >= least_force
    return zmp_of_wrench(torque, np.where(on_ground, force, np.nan), com)


def _planned_zmp(planned: Array, feet: Array, support: NDArray[np.str_]) -> Array:
    """Return the planned ZMP (N, 2) in the world, from the support foot's frame."""
    right = np.char.startswith(support, "r")
    return to_world(planned, feet[np.arange(len(feet)), right.astype(int)], ~right)


def _landings(on_ground: NDArray[np.bool_], air_rows: int) -> NDArray[np.bool_]:
    """Return the rows in which each foot lands after a time in the air, (N, 2)."""
    before = np.ones((air_rows, 2), dtype=np.bool_)  # the walk begins standing
    padded = np.concatenate([before, on_ground])
    rows = len(on_ground)
    recent = np.any([padded[i : i + rows] for i in range(air_rows)], axis=0)
    return np.asarray(on_ground & ~recent)
