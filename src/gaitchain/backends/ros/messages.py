"""The ROS 2 messages of links and logs, field by field as ROS defines them.

Field names are those of ROS; units are SI. Empty fields are unknown.
"""

from collections.abc import Sequence
from typing import Any, ClassVar, Self, TypeVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from gaitchain.messages import Array

_SECOND = 1_000_000_000  # ns
_LAST_SECOND = 2**31 - 1  # the largest second in a ROS 2 stamp


def _empty() -> Array:
    return np.zeros(0)


def _covariance() -> Array:
    return np.zeros(9)


def _covariance6() -> Array:
    return np.zeros(36)


def as_array(_: type, value: Any) -> Any:
    """Return numbers as an array with NaN for None; a `dec_hook` of msgspec."""
    return np.array([np.nan if v is None else v for v in value], dtype=float)


class Message(msgspec.Struct, frozen=True, eq=False, forbid_unknown_fields=True):
    """A message that can be published, or a part of one."""

    type_name: ClassVar[str] = ""
    """Type as printed by `ros2 topic info`; empty for a part."""


M = TypeVar("M", bound=Message)


class Time(Message, frozen=True, eq=False):
    """A time stamp: UNIX time, unless ROS uses simulated time."""

    sec: int = 0
    nanosec: int = 0

    @classmethod
    def at(cls, time_ns: int) -> Self:
        """Return the stamp of `time_ns` [ns], or the nearest that ROS can represent."""
        seconds, rest = divmod(time_ns, _SECOND)
        return cls(min(max(seconds, 0), _LAST_SECOND), rest)

    @property
    def ns(self) -> int:
        """The same time [ns]; 0 if not set."""
        return self.sec * _SECOND + self.nanosec


class Duration(Message, frozen=True, eq=False):
    """A span of time."""

    sec: int = 0
    nanosec: int = 0

    @classmethod
    def of(cls, seconds: float) -> Self:
        """Convert seconds, rounded to nanoseconds."""
        return cls(*divmod(round(seconds * _SECOND), _SECOND))


class Header(Message, frozen=True, eq=False):
    """Time and frame of a measurement."""

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
    """A twist with the time of the command."""

    type_name = "geometry_msgs/msg/TwistStamped"
    header: Header = Header()
    twist: Twist = Twist()


class PointStamped(Message, frozen=True, eq=False):
    """A point in a frame [m]."""

    type_name = "geometry_msgs/msg/PointStamped"
    header: Header = Header()
    point: Vector3 = Vector3()


class Transform(Message, frozen=True, eq=False):
    """Pose of a frame in another frame."""

    translation: Vector3 = Vector3()
    """Translation [m]."""
    rotation: Quaternion = Quaternion()


class TransformStamped(Message, frozen=True, eq=False):
    """A transform with the names of both frames and the time."""

    header: Header = Header()
    child_frame_id: str = ""
    transform: Transform = Transform()


class TFMessage(Message, frozen=True, eq=False):
    """A list of transforms."""

    type_name = "tf2_msgs/msg/TFMessage"
    transforms: tuple[TransformStamped, ...] = ()


class String(Message, frozen=True, eq=False):
    """A text."""

    type_name = "std_msgs/msg/String"
    data: str = ""


class Pose(Message, frozen=True, eq=False):
    """A place [m] and an orientation."""

    position: Vector3 = Vector3()
    orientation: Quaternion = Quaternion()


class PoseStamped(Message, frozen=True, eq=False):
    """A pose with its frame."""

    header: Header = Header()
    pose: Pose = Pose()


class Path(Message, frozen=True, eq=False):
    """Poses to pass one after another."""

    type_name = "nav_msgs/msg/Path"
    header: Header = Header()
    poses: tuple[PoseStamped, ...] = ()


class PoseWithCovariance(Message, frozen=True, eq=False):
    """A pose, and how sure it is."""

    pose: Pose = Pose()
    covariance: Array = msgspec.field(default_factory=_covariance6)
    """(36,) row by row of x, y, z and rotations about x, y, z [m, rad]."""


class TwistWithCovariance(Message, frozen=True, eq=False):
    """A velocity, and how sure it is."""

    twist: Twist = Twist()
    covariance: Array = msgspec.field(default_factory=_covariance6)
    """(36,) as that of a pose, [m/s, rad/s]."""


class Odometry(Message, frozen=True, eq=False):
    """A pose in the header's frame, and a velocity in the child's frame."""

    type_name = "nav_msgs/msg/Odometry"
    header: Header = Header()
    child_frame_id: str = ""
    pose: PoseWithCovariance = PoseWithCovariance()
    twist: TwistWithCovariance = TwistWithCovariance()


class KeyValue(Message, frozen=True, eq=False):
    """A value with its name."""

    key: str = ""
    value: str = ""


class DiagnosticStatus(Message, frozen=True, eq=False):
    """The state of a part."""

    level: int = 0
    """0 well, 1 warning, 2 error, 3 silent."""
    name: str = ""
    message: str = ""
    hardware_id: str = ""
    values: tuple[KeyValue, ...] = ()


class DiagnosticArray(Message, frozen=True, eq=False):
    """The states of several parts."""

    type_name = "diagnostic_msgs/msg/DiagnosticArray"
    header: Header = Header()
    status: tuple[DiagnosticStatus, ...] = ()


class TriggerResponse(Message, frozen=True, eq=False):
    """The answer of a service without arguments, std_srvs/srv/Trigger."""

    type_name = "std_srvs/msg/TriggerResponse"
    """A name of this package: ROS has none for half a service."""
    definition: ClassVar[str] = "bool success\nstring message\n"
    success: bool = False
    message: str = ""


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
    """A walker's choice of the next key pose, with reasons; defined by gaitchain."""

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
float64[] size
float64[] size_cost
int32[] end
float64[] end_cost
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
    size: Array
    size_cost: Array
    end: NDArray[np.int32]
    end_cost: Array


class JointState(Message, frozen=True, eq=False):
    """Measurements of the joints; each array is empty or as long as `name`."""

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
    """Measurements of an IMU; -1 as the first element of a covariance: no data."""

    type_name = "sensor_msgs/msg/Imu"
    header: Header = Header()
    orientation: Quaternion = Quaternion()
    orientation_covariance: Array = msgspec.field(default_factory=_covariance)
    angular_velocity: Vector3 = Vector3()
    """[rad/s]"""
    angular_velocity_covariance: Array = msgspec.field(default_factory=_covariance)
    linear_acceleration: Vector3 = Vector3()
    """Specific force: at rest 9.81 upward [m/s^2]."""
    linear_acceleration_covariance: Array = msgspec.field(default_factory=_covariance)


class JointTrajectoryPoint(Message, frozen=True, eq=False):
    """Joint targets at one time."""

    positions: Array = msgspec.field(default_factory=_empty)
    """[rad]"""
    velocities: Array = msgspec.field(default_factory=_empty)
    accelerations: Array = msgspec.field(default_factory=_empty)
    effort: Array = msgspec.field(default_factory=_empty)
    time_from_start: Duration = Duration()


class JointTrajectory(Message, frozen=True, eq=False):
    """Joint targets over time."""

    type_name = "trajectory_msgs/msg/JointTrajectory"
    header: Header = Header()
    joint_names: tuple[str, ...] = ()
    points: tuple[JointTrajectoryPoint, ...] = ()

    @classmethod
    def reaching(
        cls,
        joint_names: Sequence[str],
        position: Array,
        within_s: float,
        effort: Array | None = None,
    ) -> Self:
        """Return a trajectory of one point.

        Its stamp is 0, which a joint_trajectory_controller interprets as "start now".
        With another stamp the controller would compare the clocks of two computers and
        reject a point in the past: a difference of a few milliseconds would stop the
        robot. Velocities are omitted, because a controller may reject a last point
        with a velocity other than 0.

        Args:
            joint_names: names of the joints.
            position: joint targets [rad].
            within_s: time of the targets after the arrival of the message [s].
            effort: torques fed forward, for a controller that takes them [N m].
        """
        point = JointTrajectoryPoint(
            positions=np.array(position, dtype=float),
            effort=_empty() if effort is None else np.array(effort, dtype=float),
            time_from_start=Duration.of(within_s),
        )
        return cls(joint_names=tuple(joint_names), points=(point,))
