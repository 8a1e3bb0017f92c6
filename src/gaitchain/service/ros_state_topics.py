"""What the service publishes to ROS of the robot's state, beside joints and targets."""

import math
from collections.abc import Iterator

from gaitchain.backends.base import LinkHealth
from gaitchain.backends.ros import RosLink
from gaitchain.backends.ros import messages as ros
from gaitchain.live.messages import Telemetry
from gaitchain.live.ros_state import RosFrames, diagnostics, imu, odometry
from gaitchain.robot.robot import Robot
from gaitchain.robot.urdf import urdf_of

_FRAMES_S, _DIAGNOSTICS_S = 0.02, 1.0  # least times between messages


class StateTopics:
    """Odometry, TF, IMU, diagnostics and description of one robot."""

    def __init__(self, link: RosLink, robot: Robot, *, behind: bool) -> None:
        """Announce the topics, and describe the robot to who comes later, too.

        Args:
            link: to the ROS network.
            robot: the robot.
            behind: whether ROS drives the motors: its own nodes then publish IMU, links
                and description, and only base and diagnostics are published here.
        """
        self._link, self._robot, self._behind = link, robot, behind
        self._frames = RosFrames(robot)
        self._frames_s = self._diagnostics_s = -math.inf
        link.advertise("/odom", ros.Odometry)
        link.advertise("/tf", ros.TFMessage)
        link.advertise("/diagnostics", ros.DiagnosticArray)
        if not behind:
            link.advertise("/imu/data", ros.Imu)
            link.advertise("/robot_description", ros.String, latched=True)
            link.publish("/robot_description", ros.String(urdf_of(robot)))

    def publish(self, t: Telemetry, health: LinkHealth, ignored: int) -> None:
        """Publish what is due; never blocks.

        Args:
            t: the telemetry.
            health: of the link.
            ignored: number of commands from ROS that were not taken.
        """
        for topic, message in self._due(t):
            self._link.publish(topic, message)
        if not 0.0 < self._diagnostics_s - t.time_s <= _DIAGNOSTICS_S:
            self._diagnostics_s = t.time_s + _DIAGNOSTICS_S - 1e-6
            told = diagnostics(t, self._robot.name, health, ignored)
            self._link.publish("/diagnostics", told)

    def _due(self, t: Telemetry) -> Iterator[tuple[str, ros.Message]]:
        measured = None if self._behind else imu(t)
        if measured is not None:
            yield "/imu/data", measured
        if not 0.0 < self._frames_s - t.time_s <= _FRAMES_S:
            self._frames_s = t.time_s + _FRAMES_S - 1e-6
            links = () if self._behind else self._frames.links(t)
            yield "/tf", ros.TFMessage((*self._frames.base(t), *links))
            if t.odometry is not None:
                yield "/odom", odometry(t, t.odometry)
