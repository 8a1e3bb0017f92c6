"""Telemetry as ROS 2 messages, for PlotJuggler, Foxglove and whatever reads bags."""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from gaitchain.backends.ros import messages as ros
from gaitchain.live.clock import Beat
from gaitchain.live.messages import Choice, Event, Telemetry
from gaitchain.live.ros_state import (
    ODOM,
    RosFrames,
    diagnostics,
    imu,
    odometry,
    quaternion_of,
)
from gaitchain.live.scene import Scene, Stage
from gaitchain.messages import Array
from gaitchain.robot.robot import Robot
from gaitchain.robot.turn import turn_matrix
from gaitchain.robot.urdf import BASE, urdf_of

TOPICS: dict[str, type[ros.Message]] = {
    "/joint_states": ros.JointState,
    "/joint_targets": ros.JointState,
    "/imu/data": ros.Imu,
    "/cmd_vel": ros.TwistStamped,
    "/zmp": ros.PointStamped,
    "/zmp_planned": ros.PointStamped,
    "/tf": ros.TFMessage,
    "/events": ros.LogMessage,
    "/decision": ros.DecisionMessage,
    "/odom": ros.Odometry,
    "/diagnostics": ros.DiagnosticArray,
    "/robot_description": ros.String,
}
"""Topic and type of all messages in a log."""
_JOINTS_S, _SCENE_S, _COMMAND_S = 0.004, 0.02, 0.1  # least times between messages
_TRUTH_S = 0.5  # a simulator gives its truth more often; a real robot never
_DIAGNOSTICS_S = 1.0
_WORLD = "world"
_INFO, _WARN = 20, 30  # levels of rcl_interfaces/msg/Log
_WRONG = {"sensor", "link", "overrun", "part", "log"}  # kinds of events
Messages = Iterator[tuple[str, ros.Message]]


class TopicBuilder:
    """Turns telemetry into topics and messages, each as often as it is of use."""

    def __init__(self, robot: Robot) -> None:
        """Take the robot."""
        self._names = robot.legs.joint_names
        self._stage = Stage(robot)
        self._joints, self._scene = Beat(_JOINTS_S), Beat(_SCENE_S)
        self._cmd_vel, self._diagnosed = Beat(_COMMAND_S), Beat(_DIAGNOSTICS_S)
        self._frames, self._robot = RosFrames(robot), robot
        self._described = False
        self._truth_s = math.inf
        self._command: tuple[float, ...] = ()
        self._choice: tuple[object, ...] = ()

    def build(self, telemetry: Telemetry) -> Messages:
        """Yield what is due or new."""
        t = telemetry
        if not self._described:
            self._described = True
            yield "/robot_description", ros.String(urdf_of(self._robot))
        if self._diagnosed.due(t.time_s):
            yield "/diagnostics", diagnostics(t, self._robot.name)
        for event in t.events:
            yield "/events", _log(event)
        if t.choice is not None and _chosen(t.choice) != self._choice:
            self._choice = _chosen(t.choice)
            yield "/decision", _decision(t.stamp_ns, t.choice)
        if self._joints.due(t.time_s):
            yield from self._measured(t)
        command = *t.command, t.crouch
        if self._cmd_vel.due(t.time_s) or command != self._command:
            self._command = command
            vx, vy, yaw_rate, crouch = command
            linear = ros.Vector3(vx, vy, 0.0 - crouch)  # no -0
            twist = ros.Twist(linear, ros.Vector3(z=yaw_rate))
            yield "/cmd_vel", ros.TwistStamped(_header(t.stamp_ns, BASE), twist)
        if self._knows(t) and self._scene.due(t.time_s):
            yield from self._drawn(t)

    def _measured(self, t: Telemetry) -> Messages:
        header = _header(t.stamp_ns)
        measured = t.joint_position, t.joint_velocity, t.joint_torque
        states = ros.JointState(header, self._names, *map(_known, measured))
        targets = ros.JointState(header, self._names, _known(t.joint_target))
        yield from (("/joint_states", states), ("/joint_targets", targets))
        measured_imu = imu(t)
        if measured_imu is not None:
            yield "/imu/data", measured_imu

    def _knows(self, t: Telemetry) -> bool:
        """Whether no other row soon says better where the robot stands."""
        if t.truth is not None:
            self._truth_s = t.time_s
        return t.truth is not None or not 0.0 <= t.time_s - self._truth_s < _TRUTH_S

    def _drawn(self, t: Telemetry) -> Messages:
        scene = self._stage.scene(t)
        root, points = self._rooted(t, scene)
        for topic, point in (("/zmp", scene.zmp), ("/zmp_planned", scene.planned_zmp)):
            if not math.isnan(point[0]):
                x, y, z, _ = (points @ (*point, 0.0, 1.0)).tolist()
                header = _header(t.stamp_ns, _WORLD)
                yield topic, ros.PointStamped(header, ros.Vector3(x, y, z))
        found = (root, *self._frames.base(t), *self._frames.links(t))
        yield "/tf", ros.TFMessage(found)
        if t.odometry is not None:
            yield "/odom", odometry(t, t.odometry)

    def _rooted(self, t: Telemetry, scene: Scene) -> tuple[ros.TransformStamped, Array]:
        """Return the transform that places the odometry in the world.

        In simulation it takes out the drift, as a localisation does. Of a real robot
        nobody knows where it is but the odometry: the world is that of the odometry.

        Returns:
            The transform, and what takes the scene's points to the world, (4, 4).
        """
        trunk, points = _pose_of(scene.trunk), np.eye(4)
        child = BASE
        if t.odometry is not None:
            child, by_steps = ODOM, np.eye(4)
            by_steps[:3, :3] = turn_matrix(np.array(t.odometry.attitude))
            by_steps[:3, 3] = t.odometry.place
            moved = trunk @ np.linalg.inv(by_steps)
            if t.truth is None:
                trunk, points = np.eye(4), np.linalg.inv(moved)
            else:
                trunk = moved
        place = ros.Transform(
            ros.Vector3(*trunk[:3, 3].tolist()), quaternion_of(trunk[:3, :3])
        )
        header = _header(t.stamp_ns, _WORLD)
        return ros.TransformStamped(header, child, place), points


def _pose_of(numbers: Sequence[float]) -> Array:
    """Return a place and a quaternion w, x, y, z as a matrix, (4, 4)."""
    w, x, y, z = numbers[3:]
    pose = np.eye(4)
    pose[:3, :3] = [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
    pose[:3, 3] = numbers[:3]
    return pose


def _header(time_ns: int, frame: str = "") -> ros.Header:
    return ros.Header(ros.Time.at(time_ns), frame)


def _known(column: Sequence[float]) -> Array:
    """Return numbers; an empty array is how ROS says that nothing was measured."""
    return np.array(() if all(map(math.isnan, column)) else column, dtype=np.float64)


def _log(event: Event) -> ros.LogMessage:
    level = _WARN if event.kind in _WRONG else _INFO
    return ros.LogMessage(ros.Time.at(event.stamp_ns), level, event.kind, event.text)


def _chosen(choice: Choice) -> tuple[object, ...]:
    # Without its costs, which may be NaN: then a choice would differ from itself.
    return choice.layer, choice.pose, choice.target, choice.left_support


def _decision(time_ns: int, choice: Choice) -> ros.DecisionMessage:
    return ros.DecisionMessage(
        header=_header(time_ns),
        key_moment=choice.key_moment,
        layer=choice.layer,
        pose=choice.pose,
        target=choice.target,
        cost=choice.cost,
        left_support=choice.left_support,
        runner_up=np.array([p for p, _ in choice.runners_up], dtype=np.int32),
        runner_up_cost=np.array([c for _, c in choice.runners_up], dtype=np.float64),
        primitive=tuple(choice.primitives),
        value=np.array(list(choice.primitives.values()), dtype=np.float64),
        size=np.array([s for s, _ in choice.sizes], dtype=np.float64),
        size_cost=np.array([c for _, c in choice.sizes], dtype=np.float64),
        end=np.array([p for p, _ in choice.ends], dtype=np.int32),
        end_cost=np.array([c for _, c in choice.ends], dtype=np.float64),
    )
