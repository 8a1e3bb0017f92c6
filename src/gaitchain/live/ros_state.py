"""Telemetry as the topics that nodes of ROS expect: odometry, TF, IMU, diagnostics.

Frames are those of REP 105 and REP 120: odom -> base_link -> links, and base_link ->
base_footprint. Vectors are as in REP 103: x ahead, y left, z up.
"""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from gaitchain.backends.base import LinkHealth
from gaitchain.backends.ros import messages as ros
from gaitchain.live.messages import Mode, Telemetry
from gaitchain.live.shown_joints import shown_joints
from gaitchain.messages import Array
from gaitchain.robot.feet import FootFinder
from gaitchain.robot.robot import Robot
from gaitchain.robot.turn import quaternion, turn_matrix
from gaitchain.robot.urdf import (
    BASE,
    SOLES,
    last_links,
    link_names,
    link_parents,
    sole_origins,
)
from gaitchain.walker.odometry import Odometry

ODOM, FOOTPRINT = "odom", "base_footprint"
# What the odometry's covariance does not tell; about what RES has in simulation.
_HEIGHT, _TILT = 0.01, 0.02  # standard deviations [m, rad]
_SPEED, _SPIN = 0.08, 0.02  # of the velocity [m/s, rad/s]
_UNKNOWN = np.array([-1.0, *[0.0] * 8])  # where sensor_msgs wants "no estimate"
_UNMEASURED = np.zeros(9)  # a covariance that nobody measured
_PLANE = (0, 1, 5)  # rows of x, y and yaw in a covariance of ROS
_OK, _WARN, _ERROR = 0, 1, 2  # levels of diagnostic_msgs
_LEVELS = {Mode.SAFE: _ERROR, Mode.STOPPED: _ERROR}


class RosFrames:
    """The transforms of one robot."""

    def __init__(self, robot: Robot) -> None:
        """Take the robot."""
        full, self._ankle = robot.legs, robot.reduced.ankle_height
        self._feet = FootFinder(full)
        self._stand = np.asarray(full.stand, dtype=float)
        self._axes = np.asarray(full.axis, dtype=float).reshape(-1, 3)
        self._at = [ros.Vector3(*at) for at in full.at.reshape(-1, 3).tolist()]
        self._pairs = tuple(zip(link_parents(robot), link_names(robot), strict=True))
        self._soles = tuple(
            (
                parent,
                sole,
                ros.Transform(ros.Vector3(*at.tolist()), quaternion_of(turn)),
            )
            for parent, sole, at, turn in zip(
                last_links(robot),
                SOLES,
                sole_origins(robot),
                np.asarray(full.foot_turn),
                strict=True,
            )
        )

    def links(self, t: Telemetry) -> Iterator[ros.TransformStamped]:
        """Yield the links of the legs; an unmeasured joint counts as at its target."""
        stamp = ros.Time.at(t.stamp_ns)
        half = 0.5 * shown_joints(t, self._stand)
        turns = np.column_stack((np.sin(half)[:, None] * self._axes, np.cos(half)))
        for (parent, child), at, turn in zip(
            self._pairs, self._at, turns.tolist(), strict=True
        ):
            place = ros.Transform(at, ros.Quaternion(*turn))
            yield ros.TransformStamped(ros.Header(stamp, parent), child, place)
        for parent, child, place in self._soles:
            yield ros.TransformStamped(ros.Header(stamp, parent), child, place)

    def base(self, t: Telemetry) -> Iterator[ros.TransformStamped]:
        """Yield odom -> base_link, where it is estimated, and base_footprint."""
        stamp = ros.Time.at(t.stamp_ns)
        if t.odometry is not None:
            place = ros.Transform(
                ros.Vector3(*t.odometry.place), _turn_of(*t.odometry.attitude)
            )
            yield ros.TransformStamped(ros.Header(stamp, ODOM), BASE, place)
        yield ros.TransformStamped(
            ros.Header(stamp, BASE), FOOTPRINT, self._footprint(t)
        )

    def _footprint(self, t: Telemetry) -> ros.Transform:
        """Return the middle between the soles, on the lower one's height, level."""
        roll, pitch = _tilt(t)
        level = turn_matrix(np.array([roll, pitch, 0.0]))
        found = self._feet.find(shown_joints(t, self._stand))
        soles = found.ankles - self._ankle * found.turns[:, :, 2]
        points = soles @ level.T
        middle = np.array([*points[:, :2].mean(axis=0), points[:, 2].min()])
        return ros.Transform(
            ros.Vector3(*(level.T @ middle).tolist()), quaternion_of(level.T)
        )


def odometry(t: Telemetry, found: Odometry) -> ros.Odometry:
    """Return an odometry as ROS has it: the velocity is in base_link."""
    covariance = np.diag([0.0, 0.0, _HEIGHT**2, _TILT**2, _TILT**2, 0.0])
    xx, xy, yy, xt, yt, tt = found.covariance
    covariance[np.ix_(_PLANE, _PLANE)] = [[xx, xy, xt], [xy, yy, yt], [xt, yt, tt]]
    speed = np.diag([_SPEED**2] * 3 + [_SPIN**2] * 3)
    spin = _finite(t.angular_velocity, 3)
    twist = ros.Twist(ros.Vector3(*found.velocity), ros.Vector3(*spin))
    pose = ros.Pose(ros.Vector3(*found.place), _turn_of(*found.attitude))
    return ros.Odometry(
        ros.Header(ros.Time.at(t.stamp_ns), ODOM),
        BASE,
        ros.PoseWithCovariance(pose, covariance.ravel()),
        ros.TwistWithCovariance(twist, speed.ravel()),
    )


def imu(t: Telemetry) -> ros.Imu | None:
    """Return what the IMU measures, in the trunk's axes; None if it measures nothing.

    The orientation is roll and pitch as estimated, with the odometry's heading.
    """
    if all(map(math.isnan, (*t.angular_velocity, *t.acceleration))):
        return None
    known = not any(map(math.isnan, t.estimated_tilt))
    yaw = 0.0 if t.odometry is None else t.odometry.attitude[2]
    return ros.Imu(
        header=ros.Header(ros.Time.at(t.stamp_ns), BASE),
        orientation=_turn_of(*t.estimated_tilt, yaw) if known else ros.Quaternion(),
        orientation_covariance=_UNMEASURED if known else _UNKNOWN,
        angular_velocity=ros.Vector3(*t.angular_velocity),
        angular_velocity_covariance=_UNMEASURED,
        linear_acceleration=ros.Vector3(*t.acceleration),
        linear_acceleration_covariance=_UNMEASURED,
    )


def diagnostics(
    t: Telemetry, robot: str, link: LinkHealth | None = None, ignored: int = 0
) -> ros.DiagnosticArray:
    """Return what is well and what is not: robot, sensors, links, and pace of the loop.

    Args:
        t: the telemetry.
        robot: its name.
        link: to the ROS network; None where there is none.
        ignored: number of commands from there that were not taken.
    """
    trouble = "" if t.trouble is None else str(t.trouble)
    pace = t.pace
    parts: list[tuple[str, int, str, dict[str, object]]] = [
        ("mode", _LEVELS.get(t.mode, _OK), t.reason or str(t.mode), _facts(t, trouble)),
        ("sensors", _WARN if t.status else _OK, t.status or "measuring", {}),
        (
            "link to the robot",
            _WARN if t.link_note else _OK,
            t.link_note or "answering",
            _link_facts(t),
        ),
        (
            "control loop",
            _OK,
            "running",
            {
                "period [s]": pace.period_s,
                "ticks": pace.ticks,
                "overruns": pace.overruns,
                "late, 99 % [s]": pace.late_p99_s,
                "late, worst [s]": pace.late_max_s,
            },
        ),
    ]
    if link is not None:
        level, message = _WARN if link.note else _OK, link.note or "answering"
        lost = {"lost": link.lost, "ignored commands": ignored}
        parts.append(("link to ROS", level, message, {"sent": link.sent, **lost}))
    status = tuple(
        ros.DiagnosticStatus(
            level,
            f"gaitchain: {name}",
            message,
            robot,
            tuple(ros.KeyValue(key, str(value)) for key, value in values.items()),
        )
        for name, level, message, values in parts
    )
    return ros.DiagnosticArray(ros.Header(ros.Time.at(t.stamp_ns)), status)


def _link_facts(t: Telemetry) -> dict[str, object]:
    facts: dict[str, object] = {"sent": t.link_sent, "lost": t.link_lost}
    return facts if t.supply_v is None else facts | {"supply [V]": t.supply_v}


def quaternion_of(turn: Array) -> ros.Quaternion:
    """Return the quaternion of a rotation matrix (3, 3), as ROS has it."""
    w, x, y, z = quaternion(turn).tolist()
    return ros.Quaternion(x, y, z, w)


def _turn_of(roll: float, pitch: float, yaw: float) -> ros.Quaternion:
    return quaternion_of(turn_matrix(np.array([roll, pitch, yaw])))


def _tilt(t: Telemetry) -> tuple[float, float]:
    roll, pitch = _finite(t.estimated_tilt, 2)
    return roll, pitch


def _finite(numbers: Sequence[float], count: int) -> Sequence[float]:
    """Return numbers, or zeros where one of them is unknown."""
    return (0.0,) * count if any(map(math.isnan, numbers)) else numbers


def _facts(t: Telemetry, trouble: str) -> dict[str, object]:
    return {
        "mode": str(t.mode),
        "trouble": trouble,
        "driver": t.driver,
        "note": t.note,
        "steps": t.steps,
    }
