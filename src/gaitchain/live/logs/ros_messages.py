"""Telemetry as ROS 2 messages, for PlotJuggler, Foxglove and whatever reads bags."""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from gaitchain.backends.ros import messages as ros
from gaitchain.live.messages import Choice, Event, Telemetry
from gaitchain.live.scene import Stage
from gaitchain.messages import Array
from gaitchain.robot.robot import Robot

TOPICS: dict[str, type[ros.Message]] = {
    "/joint_states": ros.JointState,
    "/joint_targets": ros.JointState,
    "/imu": ros.Imu,
    "/cmd_vel": ros.TwistStamped,
    "/zmp": ros.PointStamped,
    "/zmp_planned": ros.PointStamped,
    "/tf": ros.TFMessage,
    "/events": ros.LogMessage,
    "/decision": ros.DecisionMessage,
}
"""Topic and type of all messages in a log."""
_JOINTS_S, _SCENE_S, _COMMAND_S = 0.004, 0.02, 0.1  # least times between messages
_TRUTH_S = 0.5  # a simulator gives its truth more often; a real robot never
_WORLD, _TRUNK = "world", "trunk"
_INFO, _WARN = 20, 30  # levels of rcl_interfaces/msg/Log
_WRONG = {"sensor", "link", "overrun", "part", "log"}  # kinds of events
_UNKNOWN = np.array([-1.0, *[0.0] * 8])  # where sensor_msgs wants "no estimate"
_UNMEASURED = np.zeros(9)  # a covariance that nobody measured
Messages = Iterator[tuple[str, ros.Message]]


class TopicBuilder:
    """Turns telemetry into topics and messages, each as often as it is of use."""

    def __init__(self, robot: Robot) -> None:
        """Take the robot."""
        self._names = robot.legs.joint_names
        self._stage = Stage(robot)
        self._joints, self._scene = _Beat(_JOINTS_S), _Beat(_SCENE_S)
        self._cmd_vel = _Beat(_COMMAND_S)
        self._truth_s = math.inf
        self._command: tuple[float, ...] = ()
        self._choice: tuple[object, ...] = ()

    def build(self, telemetry: Telemetry) -> Messages:
        """Yield what is due or new."""
        t = telemetry
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
            yield "/cmd_vel", ros.TwistStamped(_header(t.stamp_ns, _TRUNK), twist)
        if self._knows(t) and self._scene.due(t.time_s):
            yield from self._drawn(t)

    def _measured(self, t: Telemetry) -> Messages:
        header = _header(t.stamp_ns)
        measured = t.joint_position, t.joint_velocity, t.joint_torque
        states = ros.JointState(header, self._names, *map(_known, measured))
        targets = ros.JointState(header, self._names, _known(t.joint_target))
        yield from (("/joint_states", states), ("/joint_targets", targets))
        if not all(map(math.isnan, (*t.angular_velocity, *t.acceleration))):
            yield "/imu", _imu(t)

    def _knows(self, t: Telemetry) -> bool:
        """Whether no other row soon says better where the robot stands."""
        if t.truth is not None:
            self._truth_s = t.time_s
        return t.truth is not None or not 0.0 <= t.time_s - self._truth_s < _TRUTH_S

    def _drawn(self, t: Telemetry) -> Messages:
        scene, header = self._stage.scene(t), _header(t.stamp_ns, _WORLD)
        for topic, point in (("/zmp", scene.zmp), ("/zmp_planned", scene.planned_zmp)):
            if not math.isnan(point[0]):
                yield topic, ros.PointStamped(header, ros.Vector3(*point))
        x, y, z, qw, qx, qy, qz = scene.trunk
        place = ros.Transform(ros.Vector3(x, y, z), ros.Quaternion(qx, qy, qz, qw))
        yield "/tf", ros.TFMessage((ros.TransformStamped(header, _TRUNK, place),))


class _Beat:
    """Says when something is due again, on a clock that may jump or run backward."""

    def __init__(self, period_s: float) -> None:
        self._period_s, self._next_s = period_s, -math.inf

    def due(self, now_s: float) -> bool:
        """Whether it is; a row may come a quarter of the period early."""
        period_s, ahead_s = self._period_s, self._next_s - now_s
        if 0.25 * period_s < ahead_s <= 1.5 * period_s:
            return False
        on_beat = -period_s < ahead_s <= 0.25 * period_s
        self._next_s = (self._next_s if on_beat else now_s) + period_s
        return True


def _header(time_ns: int, frame: str = "") -> ros.Header:
    return ros.Header(ros.Time.at(time_ns), frame)


def _known(column: Sequence[float]) -> Array:
    """Return numbers; an empty array is how ROS says that nothing was measured."""
    return np.array(() if all(map(math.isnan, column)) else column, dtype=np.float64)


def _imu(t: Telemetry) -> ros.Imu:
    roll, pitch = t.estimated_tilt
    known = not (math.isnan(roll) or math.isnan(pitch))
    sin_r, cos_r, sin_p, cos_p = (
        (*_half(roll), *_half(pitch)) if known else (0.0, 1.0, 0.0, 1.0)
    )
    turn = cos_p * sin_r, sin_p * cos_r, -sin_p * sin_r, cos_p * cos_r
    return ros.Imu(
        header=_header(t.stamp_ns, _TRUNK),
        orientation=ros.Quaternion(*turn),
        orientation_covariance=_UNMEASURED if known else _UNKNOWN,
        angular_velocity=ros.Vector3(*t.angular_velocity),
        angular_velocity_covariance=_UNMEASURED,
        linear_acceleration=ros.Vector3(*t.acceleration),
        linear_acceleration_covariance=_UNMEASURED,
    )


def _half(angle: float) -> tuple[float, float]:
    return math.sin(0.5 * angle), math.cos(0.5 * angle)


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
