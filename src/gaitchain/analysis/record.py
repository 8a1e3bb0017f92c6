"""The record of a walk, column by column."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gaitchain.gait.motion import Timing
from gaitchain.gait.zmp import Support
from gaitchain.messages import Array, Command, PanelMessage
from gaitchain.robot.box_robot import JOINT_NAMES
from gaitchain.robot.robot import Robot
from gaitchain.walker.generator import Decision

SUPPORTS = ("stand", *(support.value for support in Support))
"""Values of `WalkRecord.support`."""
Limit = float | tuple[float, ...] | None
"""A limit for all joints, or one for each of them."""


@dataclass(frozen=True, eq=False)
class WalkRecord:
    """A walk in physics with one row per control period, N in all.

    Targets, plans and estimates are the walker's; all other columns are ground truth of
    the simulator.
    """

    time_s: Array
    """(N,) time since the start of the first step [s]."""
    target: Array
    """(N, 2 n) joint targets, in the order of `joint_names` [rad]."""
    joint_position: Array
    """(N, 2 n) joint angles [rad]."""
    joint_velocity: Array
    """(N, 2 n) joint speeds [rad/s]."""
    torque: Array
    """(N, 2 n) joint torques [N m]."""
    qpos: Array
    """(N, 7 + 2 n) MuJoCo generalised positions: base, then joints."""
    zmp: Array
    """(N, 2) measured ZMP in the world [m]; NaN off the ground."""
    planned_zmp: Array
    """(N, 2) planned ZMP in the world, from the measured pose of the support foot [m];
    NaN if none is planned."""
    feet: Array
    """(N, 2, 3) left and right foot in the world: x, y, yaw [m, m, rad]."""
    soles: Array
    """(N, 2, 4, 2) corners of each sole in the world, horizontal position [m]."""
    foot_load: Array
    """(N, 2) vertical ground force on each sole [N]."""
    foot_height: Array
    """(N, 2) lowest corner of each sole above the floor under it [m]."""
    foot_speed: Array
    """(N, 2) horizontal speed of each sole's centre [m/s]."""
    touch_down: NDArray[np.bool_]
    """(N, 2) whether a foot lands: it is loaded again after 50 ms in the air."""
    tilt: Array
    """(N, 2) roll (to the right) and pitch (forward) of the trunk [rad]."""
    estimated_tilt: Array
    """(N, 2) roll and pitch estimated by the walker [rad]; NaN in open loop."""
    self_contact: NDArray[np.bool_]
    """(N,) whether a link of the left leg touches one of the right."""
    support: NDArray[np.str_]
    """(N,) planned support: "rs", "rl", "ls", "lr", or "stand"."""
    key_pose: NDArray[np.int64]
    """(N, 2) key moment (0 for kp_1) and pose that the robot is moving to."""
    step_ticks: tuple[int, ...]
    """Row at which each step began, and the row after the last step."""
    fell_at_s: float | None
    """Time of the fall [s]; None without one."""
    decisions: tuple[tuple[float, Decision, PanelMessage], ...] = ()
    """(time [s], decision, primitive components) of each key pose, in order."""
    robot: Robot | None = None
    """The robot; None in a record that was not written by a walk."""
    timing: Timing | None = None
    """Planned times of a step; None if there is no plan."""
    gait: str = ""
    """Name of the gait's family; empty if unknown."""
    torque_limit: Limit = None
    """Torque limit of the joints in this world [N m]; None for the robot's limits."""
    speed_limit: Limit = None
    """Speed limit of the joints in this world [rad/s]; None for the robot's limits."""
    events: tuple[tuple[float, str], ...] = ()
    """(time [s], event) of external disturbances such as a push."""
    notes: tuple[tuple[float, str], ...] = ()
    """(time [s], event) of what else happened to the robot, such as a stop or a reset;
    none of them makes a robot fall."""
    commands: tuple[tuple[float, Command], ...] = ()
    """(time [s], command) of each change of the command, with the stop at the end."""

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joint columns."""
        return joint_names(self.robot)


def joint_names(robot: Robot | None) -> tuple[str, ...]:
    """Return the names of a robot's joint columns; by default those of box robots."""
    return JOINT_NAMES if robot is None else robot.legs.joint_names


def support_stays(
    support: NDArray[np.str_], first: int = 0
) -> list[tuple[str, int, int]]:
    """Return (region, first row, row after the last) of each interval in a region.

    Args:
        support: (N,) names of the planned support regions.
        first: row of the record at which `support` begins.
    """
    changes = np.flatnonzero(support[1:] != support[:-1]) + 1
    bounds = [0, *changes.tolist(), len(support)]
    return [(str(support[a]), first + a, first + b) for a, b in pairwise(bounds)]
