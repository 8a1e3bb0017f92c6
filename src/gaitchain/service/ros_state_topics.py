"""What the service publishes to ROS of the robot's state, beside joints and targets."""

from collections.abc import Iterator

from gaitchain.backends.base import LinkHealth
from gaitchain.backends.ros import RosLink
from gaitchain.backends.ros import messages as ros
from gaitchain.live.clock import Beat
from gaitchain.live.messages import Telemetry
from gaitchain.live.ros_state import RosFrames, diagnostics, imu, odometry
from gaitchain.messages import CONTROL_PERIOD_S
from gaitchain.robot.robot import Robot
from gaitchain.robot.urdf import urdf_of

_FRAMES_S, _DIAGNOSTICS_S = 0.02, 1.0  # between messages


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
        self._felt, self._framed = Beat(CONTROL_PERIOD_S), Beat(_FRAMES_S)
        self._diagnosed = Beat(_DIAGNOSTICS_S)
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
            t: the next row of the loop.
            health: of the link.
            ignored: number of commands from ROS that were not taken.
        """
        for topic, message in self._due(t):
            self._link.publish(topic, message)
        if self._diagnosed.due(t.time_s):
            told = diagnostics(t, self._robot.name, health, ignored)
            self._link.publish("/diagnostics", told)

    def _due(self, t: Telemetry) -> Iterator[tuple[str, ros.Message]]:
        if not self._behind and self._felt.due(t.time_s):
            measured = imu(t)
            if measured is not None:
                yield "/imu/data", measured
        if self._framed.due(t.time_s):
            links = () if self._behind else self._frames.links(t)
            yield "/tf", ros.TFMessage((*self._frames.base(t), *links))
            if t.odometry is not None:
                yield "/odom", odometry(t, t.odometry)
