"""Telemetry as ROS 2 messages, for PlotJuggler, Foxglove and whatever reads bags."""

import math
from collections.abc import Iterator, Sequence

from gaitchain.live.logs.cdr import Cdr
from gaitchain.live.messages import Choice, Event, Telemetry
from gaitchain.live.scene import Stage
from gaitchain.robot.box_robot import anatomy_of
from gaitchain.robot.reduced_biped import Biped

TOPICS = {
    "/joint_states": "sensor_msgs/msg/JointState",
    "/joint_targets": "sensor_msgs/msg/JointState",
    "/imu": "sensor_msgs/msg/Imu",
    "/cmd_vel": "geometry_msgs/msg/TwistStamped",
    "/zmp": "geometry_msgs/msg/PointStamped",
    "/zmp_planned": "geometry_msgs/msg/PointStamped",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/events": "rcl_interfaces/msg/Log",
    "/decision": "gaitchain_msgs/msg/Decision",
}
"""Topic and type of all that a log tells."""
_JOINTS_S, _SCENE_S, _COMMAND_S = 0.004, 0.02, 0.1  # least times between messages
_TRUTH_S = 0.5  # a simulator tells its truth more often; a real robot never
_WORLD, _TRUNK = "world", "trunk"
_STAMPED = 12  # bytes of a message up to the end of its stamp
_INFO, _WARN = 20, 30  # levels of rcl_interfaces/msg/Log
_WRONG = {"sensor", "link", "overrun", "part", "log"}  # kinds of events
_UNKNOWN = (-1.0, *[0.0] * 8)  # a covariance, where sensor_msgs wants "no estimate"
_UNSAID = [0.0] * 9  # a covariance that nobody measured
Messages = Iterator[tuple[str, bytes]]


class Teller:
    """Turns telemetry into topics and messages, each as often as it is of use."""

    def __init__(self, biped: Biped) -> None:
        """Take the robot."""
        names = anatomy_of(biped).joint_names
        self._names = bytes(Cdr().header(0, "").texts(names))[_STAMPED:]
        self._stage = Stage(biped)
        self._joints, self._scene = _Beat(_JOINTS_S), _Beat(_SCENE_S)
        self._cmd_vel = _Beat(_COMMAND_S)
        self._truth_s = math.inf
        self._command: tuple[float, ...] = ()
        self._choice: tuple[object, ...] = ()

    def tell(self, telemetry: Telemetry) -> Messages:
        """Yield what is due or new."""
        t = telemetry
        for event in t.events:
            yield "/events", _log(event)
        if t.choice is not None and _chosen(t.choice) != self._choice:
            self._choice = _chosen(t.choice)
            yield "/decision", _decision(t.stamp_ns, t.choice)
        if self._joints.due(t.time_s):
            yield from self._measured(t)
        if self._cmd_vel.due(t.time_s) or t.command != self._command:
            self._command = t.command
            vx, vy, yaw_rate = t.command
            speeds = vx, vy, 0.0, 0.0, 0.0, yaw_rate
            yield "/cmd_vel", bytes(Cdr().header(t.stamp_ns, _TRUNK).numbers(*speeds))
        if self._knows(t) and self._scene.due(t.time_s):
            yield from self._drawn(t)

    def _measured(self, t: Telemetry) -> Messages:
        yield (
            "/joint_states",
            self._joint_state(
                t.stamp_ns, t.joint_position, t.joint_velocity, t.joint_torque
            ),
        )
        yield "/joint_targets", self._joint_state(t.stamp_ns, t.joint_target, (), ())
        if not all(map(math.isnan, (*t.angular_velocity, *t.acceleration))):
            yield "/imu", _imu(t)

    def _joint_state(self, time_ns: int, *columns: Sequence[float]) -> bytes:
        message = Cdr(bytes(Cdr().stamp(time_ns)) + self._names)
        for column in columns:
            # An empty array is how ROS says that nothing was measured.
            message.sequence(() if all(map(math.isnan, column)) else column)
        return bytes(message)

    def _knows(self, t: Telemetry) -> bool:
        """Whether a row is the best there is to tell where the robot stands."""
        if t.truth is not None:
            self._truth_s = t.time_s
        return t.truth is not None or not 0.0 <= t.time_s - self._truth_s < _TRUTH_S

    def _drawn(self, t: Telemetry) -> Messages:
        scene = self._stage.scene(t)
        for topic, point in (("/zmp", scene.zmp), ("/zmp_planned", scene.planned_zmp)):
            if not math.isnan(point[0]):
                message = Cdr().header(t.stamp_ns, _WORLD).numbers(*point, 0.0)
                yield topic, bytes(message)
        x, y, z, qw, *axis = scene.trunk
        message = Cdr().whole(1).header(t.stamp_ns, _WORLD).text(_TRUNK)
        yield "/tf", bytes(message.numbers(x, y, z, *axis, qw))


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


def _imu(t: Telemetry) -> bytes:
    roll, pitch = t.estimated_tilt
    known = not (math.isnan(roll) or math.isnan(pitch))
    sin_r, cos_r, sin_p, cos_p = (
        (*_half(roll), *_half(pitch)) if known else (0.0, 1.0, 0.0, 1.0)
    )
    turn = cos_p * sin_r, sin_p * cos_r, -sin_p * sin_r, cos_p * cos_r
    message = Cdr().header(t.stamp_ns, _TRUNK)
    message.numbers(*turn, *(_UNSAID if known else _UNKNOWN))
    message.numbers(*t.angular_velocity, *_UNSAID, *t.acceleration, *_UNSAID)
    return bytes(message)


def _half(angle: float) -> tuple[float, float]:
    return math.sin(0.5 * angle), math.cos(0.5 * angle)


def _log(event: Event) -> bytes:
    level = _WARN if event.kind in _WRONG else _INFO
    message = Cdr().stamp(event.stamp_ns).byte(level)
    return bytes(message.text(event.kind).text(event.text).text("").text("").whole(0))


def _chosen(choice: Choice) -> tuple[object, ...]:
    # Without its costs, which may be NaN: then a choice would differ from itself.
    return choice.layer, choice.pose, choice.target, choice.left_support


def _decision(time_ns: int, choice: Choice) -> bytes:
    poses, costs = [p for p, _ in choice.runners_up], [c for _, c in choice.runners_up]
    message = Cdr().header(time_ns, "").text(choice.key_moment).byte(choice.layer)
    message.signed(choice.pose, choice.target).numbers(choice.cost)
    message.byte(choice.left_support)
    message.whole(len(poses)).signed(*poses).sequence(costs)
    names = tuple(choice.primitives)
    return bytes(message.texts(names).sequence([choice.primitives[n] for n in names]))
