"""A walk as physics recorded it, column by column."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gaitchain.gait.motion import Timing
from gaitchain.gait.zmp import Support
from gaitchain.messages import Array, Command, PanelMessage
from gaitchain.robot.box_robot import JOINT_NAMES
from gaitchain.robot.robot import Robot
from gaitchain.walker.generator import Decision

SUPPORTS = ("stand", *(support.value for support in Support))
"""What `WalkRecord.support` may say."""
Limit = float | tuple[float, ...] | None
"""Of all joints, or of each of them."""


@dataclass(frozen=True, eq=False)
class WalkRecord:
    """A walk in physics, one row per control period, N in all.

    Targets, plans and estimates are the walker's; all else is the simulator's truth.
    """

    time_s: Array
    """(N,) since the first step began [s]."""
    target: Array
    """(N, 2 n) joint targets, in the order of `joint_names` [rad]."""
    joint_position: Array
    """(N, 2 n) [rad]."""
    joint_velocity: Array
    """(N, 2 n) [rad/s]."""
    torque: Array
    """(N, 2 n) [N m]."""
    qpos: Array
    """(N, 7 + 2 n) MuJoCo generalised positions: base, then joints."""
    zmp: Array
    """(N, 2) measured ZMP in the world, NaN off the ground [m]."""
    planned_zmp: Array
    """(N, 2) planned ZMP where the support foot is, in the world; or NaN [m]."""
    feet: Array
    """(N, 2, 3) left and right foot in the world: x, y, yaw [m, m, rad]."""
    soles: Array
    """(N, 2, 4, 2) corners of each sole in the world, from above [m]."""
    foot_load: Array
    """(N, 2) vertical ground force on each sole [N]."""
    foot_height: Array
    """(N, 2) lowest corner of each sole above the floor under it [m]."""
    foot_speed: Array
    """(N, 2) horizontal speed of each sole's centre [m/s]."""
    touch_down: NDArray[np.bool_]
    """(N, 2) whether each foot lands: it bears load again after 50 ms in the air."""
    tilt: Array
    """(N, 2) roll and pitch of the trunk from the vertical: right, forward [rad]."""
    estimated_tilt: Array
    """(N, 2) roll and pitch as the walker believes, NaN in open loop [rad]."""
    self_contact: NDArray[np.bool_]
    """(N,) whether a link of the left leg touches one of the right."""
    support: NDArray[np.str_]
    """(N,) planned support: "rs", "rl", "ls", "lr", or "stand"."""
    key_pose: NDArray[np.int64]
    """(N, 2) key moment (0 for kp_1) and pose that the robot is moving to."""
    step_ticks: tuple[int, ...]
    """Row at which each step began, and the row after the last."""
    fell_at_s: float | None
    decisions: tuple[tuple[float, Decision, PanelMessage], ...] = ()
    """(time [s], decision, primitive components) of each key pose, in order."""
    robot: Robot | None = None
    """The robot; None in a record made by hand."""
    timing: Timing | None = None
    """Planned times of a step; None if no walker planned it."""
    gait: str = ""
    """Name of the gait's family; empty in a record made by hand."""
    torque_limit: Limit = None
    """Of every joint in this world, or of each [N m]; None for the robot's own."""
    speed_limit: Limit = None
    """Of every joint in this world, or of each [rad/s]; None for the robot's own."""
    events: tuple[tuple[float, str], ...] = ()
    """(time [s], what) that was done to the robot from outside, such as a push."""
    commands: tuple[tuple[float, Command], ...] = ()
    """(time [s], command) whenever another one was given; the stop at the end, too."""

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joint columns."""
        return joint_names(self.robot)


def joint_names(robot: Robot | None) -> tuple[str, ...]:
    """Return the names of a robot's joint columns; of boxes where none is known."""
    return JOINT_NAMES if robot is None else robot.legs.joint_names
