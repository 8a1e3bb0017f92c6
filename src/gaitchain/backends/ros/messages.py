"""The ROS 2 messages of links and logs, field by field as ROS defines them.

Names of fields are ROS's own; units are SI. What a message leaves empty is not known.
"""

from collections.abc import Sequence
from typing import Any, ClassVar, Self

import msgspec
import numpy as np
from numpy.typing import NDArray

from gaitchain.messages import Array

_SECOND = 1_000_000_000  # ns
_LAST_SECOND = 2**31 - 1  # that a stamp of ROS 2 can hold


def _empty() -> Array:
    return np.zeros(0)


def _covariance() -> Array:
    return np.zeros(9)


def as_array(_: type, value: Any) -> Any:
    """Return numbers as an array, None among them as NaN; a `dec_hook` of msgspec."""
    return np.array([np.nan if v is None else v for v in value], dtype=float)


class Message(msgspec.Struct, frozen=True, eq=False, forbid_unknown_fields=True):
    """What can be published, or a part of it."""

    type_name: ClassVar[str] = ""
    """As `ros2 topic info` prints it; empty for a part."""


class Time(Message, frozen=True, eq=False):
    """A moment of UNIX time, unless ROS runs on simulated time."""

    sec: int = 0
    nanosec: int = 0

    @classmethod
    def at(cls, time_ns: int) -> Self:
        """Return the moment `time_ns` [ns], or the nearest that ROS can hold."""
        seconds, rest = divmod(time_ns, _SECOND)
        return cls(min(max(seconds, 0), _LAST_SECOND), rest)

    @property
    def ns(self) -> int:
        """The same moment [ns]; 0 stands for "not said"."""
        return self.sec * _SECOND + self.nanosec


class Duration(Message, frozen=True, eq=False):
    """A span of time."""

    sec: int = 0
    nanosec: int = 0

    @classmethod
    def of(cls, seconds: float) -> Self:
        """Return that many seconds, to the nearest nanosecond."""
        return cls(*divmod(round(seconds * _SECOND), _SECOND))


class Header(Message, frozen=True, eq=False):
    """When and in which frame something was measured."""

    stamp: Time = Time()
    frame_id: str = ""


class Vector3(Message, frozen=True, eq=False):
    """Three components."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0


class Quaternion(Message, frozen=True, eq=False):
    """A rotation."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    w: float = 1.0


class Twist(Message, frozen=True, eq=False):
    """Linear [m/s] and angular [rad/s] velocity."""

    type_name = "geometry_msgs/msg/Twist"
    linear: Vector3 = Vector3()
    angular: Vector3 = Vector3()


class TwistStamped(Message, frozen=True, eq=False):
    """The same, with the moment it was asked for."""

    type_name = "geometry_msgs/msg/TwistStamped"
    header: Header = Header()
    twist: Twist = Twist()


class PointStamped(Message, frozen=True, eq=False):
    """A point in a frame [m]."""

    type_name = "geometry_msgs/msg/PointStamped"
    header: Header = Header()
    point: Vector3 = Vector3()


class Transform(Message, frozen=True, eq=False):
    """Where a frame is in another one."""

    translation: Vector3 = Vector3()
    """[m]"""
    rotation: Quaternion = Quaternion()


class TransformStamped(Message, frozen=True, eq=False):
    """The same, with both frames and the time."""

    header: Header = Header()
    child_frame_id: str = ""
    transform: Transform = Transform()


class TFMessage(Message, frozen=True, eq=False):
    """Where frames are."""

    type_name = "tf2_msgs/msg/TFMessage"
    transforms: tuple[TransformStamped, ...] = ()


class LogMessage(Message, frozen=True, eq=False):
    """A line of a log."""

    type_name = "rcl_interfaces/msg/Log"
    stamp: Time = Time()
    level: int = 0
    """20 for information, 30 for a warning."""
    name: str = ""
    msg: str = ""
    file: str = ""
    function: str = ""
    line: int = 0


class DecisionMessage(Message, frozen=True, eq=False):
    """The key pose that a walker chose, and why; defined by gaitchain."""

    type_name = "gaitchain_msgs/msg/Decision"
    definition: ClassVar[str] = """\
std_msgs/Header header
string key_moment
uint8 layer
int32 pose
int32 target
float64 cost
bool left_support
int32[] runner_up
float64[] runner_up_cost
string[] primitive
float64[] value
"""
    header: Header
    key_moment: str
    layer: int
    pose: int
    target: int
    cost: float
    left_support: bool
    runner_up: NDArray[np.int32]
    runner_up_cost: Array
    primitive: tuple[str, ...]
    value: Array


class JointState(Message, frozen=True, eq=False):
    """What the joints measure; an array is empty or as long as `name`."""

    type_name = "sensor_msgs/msg/JointState"
    header: Header = Header()
    name: tuple[str, ...] = ()
    position: Array = msgspec.field(default_factory=_empty)
    """[rad]"""
    velocity: Array = msgspec.field(default_factory=_empty)
    """[rad/s]"""
    effort: Array = msgspec.field(default_factory=_empty)
    """[N m]"""


class Imu(Message, frozen=True, eq=False):
    """What gyro and accelerometer measure; -1 first in a covariance: nothing."""

    type_name = "sensor_msgs/msg/Imu"
    header: Header = Header()
    orientation: Quaternion = Quaternion()
    orientation_covariance: Array = msgspec.field(default_factory=_covariance)
    angular_velocity: Vector3 = Vector3()
    """[rad/s]"""
    angular_velocity_covariance: Array = msgspec.field(default_factory=_covariance)
    linear_acceleration: Vector3 = Vector3()
    """Gravity included: 9.81 upward at rest [m/s^2]."""
    linear_acceleration_covariance: Array = msgspec.field(default_factory=_covariance)


class JointTrajectoryPoint(Message, frozen=True, eq=False):
    """Where the joints are to be at one moment."""

    positions: Array = msgspec.field(default_factory=_empty)
    """[rad]"""
    velocities: Array = msgspec.field(default_factory=_empty)
    accelerations: Array = msgspec.field(default_factory=_empty)
    effort: Array = msgspec.field(default_factory=_empty)
    time_from_start: Duration = Duration()


class JointTrajectory(Message, frozen=True, eq=False):
    """Where the joints are to go."""

    type_name = "trajectory_msgs/msg/JointTrajectory"
    header: Header = Header()
    joint_names: tuple[str, ...] = ()
    points: tuple[JointTrajectoryPoint, ...] = ()

    @classmethod
    def reaching(
        cls, joint_names: Sequence[str], position: Array, within_s: float
    ) -> Self:
        """Return a trajectory of one point.

        Its stamp is 0, which a joint_trajectory_controller reads as "start now". With a
        stamp it would compare two computers' clocks, and refuse a point that by its
        own clock is past: a few milliseconds of difference would stop the robot.
        Velocities are left out: a controller may refuse a last point that moves.

        Args:
            joint_names: which joints.
            position: where they are to be [rad].
            within_s: when, from the arrival of the message [s].
        """
        point = JointTrajectoryPoint(
            positions=np.array(position, dtype=float),
            time_from_start=Duration.of(within_s),
        )
        return cls(joint_names=tuple(joint_names), points=(point,))
