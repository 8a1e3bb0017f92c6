"""A robot driven by ROS 2 as a backend: trajectories out, joint states and IMU in."""

import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import NamedTuple

import numpy as np

from gaitchain.backends.base import TORQUE_UNIT, LinkHealth
from gaitchain.backends.ros.joint_states import JointStates
from gaitchain.backends.ros.link import RosLink
from gaitchain.backends.ros.messages import Imu, JointState, JointTrajectory, Vector3
from gaitchain.errors import BackendError
from gaitchain.messages import GRAVITY, Array, MotorTargets, Sensors

_IMU_WAIT_S = 1.0
_AGAIN_WAIT_S = 0.4  # for joint states, once there were some
_SILENT_S = 0.1  # older measurements are not used
_NO_TURN, _UPRIGHT = np.zeros(3), np.array([0.0, 0.0, GRAVITY])
_NONE = np.full(3, np.nan)
_IDLE = "nothing is published; the controller holds its last target"


class RobotTopics(NamedTuple):
    """Topics of a robot driven by ROS."""

    trajectory: str = "/joint_trajectory_controller/joint_trajectory"
    """trajectory_msgs/JointTrajectory, out."""
    state: str = "/joint_states"
    """sensor_msgs/JointState, in."""
    imu: str = "/imu/data"
    """sensor_msgs/Imu, in; its axes are the trunk's: x forward, y left, z up."""


_TOPICS = RobotTopics()


class RosBackend:
    """Drive a joint_trajectory_controller of ros2_control.

    The robot may be real. Arrays are in the order of `joint_names`, which are also the
    names of the joints in ROS.
    """

    physical = True
    load_unit = TORQUE_UNIT

    def __init__(
        self,
        link: RosLink,
        joint_names: Sequence[str],
        period_s: float,
        *,
        topics: RobotTopics = _TOPICS,
        timeout_s: float = 3.0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Subscribe to the robot; nothing is sent before `engage`.

        Args:
            link: the link to the ROS network; closed with the backend.
            joint_names: the robot's joints in the order of all arrays.
            period_s: control period, in which a target is to be reached after its
                arrival [s].
            topics: names of the topics.
            timeout_s: how long the first `connect` waits for joint states [s].
            clock: monotonic clock of the control loop, used for `Sensors.time` [s].

        Raises:
            CommandError: a topic's name is invalid.
        """
        self.has_imu = False
        """Whether an IMU message was received."""
        self._link, self._period_s = link, period_s
        self._topics, self._timeout_s, self._clock = topics, timeout_s, clock
        self._states, self._imu_wait_s = JointStates(joint_names), _IMU_WAIT_S
        self._state_came, self._imu_came = threading.Event(), threading.Event()
        self._imu = (float("nan"), _NO_TURN, _UPRIGHT)
        self._loads = np.full(len(self._states.joint_names), np.nan)
        self._engaged = self._closed = False
        link.advertise(topics.trajectory, JointTrajectory)
        link.subscribe(topics.state, JointState, self._on_state)
        link.subscribe(topics.imu, Imu, self._on_imu)

    def connect(self, position: Array) -> None:
        """Wait for recent joint states of the robot, which is not moved.

        Args:
            position: not used.

        Raises:
            BackendError: no joint state arrived in time, or none with the robot's
                joints.
        """
        if self._silent_s > _SILENT_S:
            self._state_came.clear()
        if not self._state_came.wait(self._timeout_s):
            raise BackendError(self._unheard())
        # A robot without an IMU can be watched, so that is no error. A reconnect waits
        # shortly, as it may happen inside a control loop.
        self._imu_came.wait(min(self._imu_wait_s, self._timeout_s))
        self._imu_wait_s = 0.0
        self._timeout_s = min(self._timeout_s, _AGAIN_WAIT_S)

    def read(self) -> Sensors:
        """Return the latest measurements.

        `time` is the arrival of the newest joint state, so it does not advance while
        the robot is silent. A joint 0.1 s older than the newest one is NaN, and so are
        gyro and accelerometer without recent messages; without any IMU message they
        are those of an upright robot at rest.

        Raises:
            BackendError: no joint state was received yet.
        """
        latest = self._states.latest()
        if np.isnan(latest.time):
            raise BackendError(self._unheard())
        self._loads = latest.effort
        came, gyro, acceleration = self._imu
        if self.has_imu and latest.time - came > _SILENT_S:
            gyro = acceleration = _NONE
        return Sensors(
            time=latest.time,
            joint_position=latest.position,
            joint_velocity=latest.velocity,
            angular_velocity=gyro.copy(),
            acceleration=acceleration.copy(),
        )

    def write(self, position: Array) -> None:
        """Publish joint targets [rad] once; does nothing before `engage`.

        Raises:
            BackendError: a target is not finite, or the backend is closed.
        """
        self._send(position)

    def engage(self) -> None:
        """Publish the present joint positions as targets, and enable `write`.

        Raises:
            BackendError: a joint's position is not known.
        """
        latest = self._states.latest()  # of one moment: another may come at any time
        missing = self._states.missing(latest)
        if missing:
            raise BackendError(
                f"no position of {', '.join(missing)} on {self._topics.state}: what "
                "cannot be measured cannot be held"
            )
        silent_s = self._clock() - latest.time
        if not silent_s <= _SILENT_S:
            raise BackendError(
                f"the joint states on {self._topics.state} are {silent_s:.1f} s old, "
                f"at most {_SILENT_S:g} s: the robot may be elsewhere by now"
            )
        self._engaged = True
        self._publish(latest.position)

    def release(self) -> None:
        """Stop publishing: the controller holds its last target.

        ROS has no standard way to turn the torque off. To let the robot go limp,
        deactivate the controller or use the robot's own switch.
        """
        self._engaged = False

    def loads(self) -> Array:
        """Return the efforts at the latest `read`, NaN where unknown [N m]."""
        return self._loads

    def health(self) -> LinkHealth:
        """Return the numbers of published and lost messages, and present problems."""
        link = self._link.health()
        note = link.note or self._note()
        return LinkHealth(link.sent, link.lost, note, holds=not self._engaged)

    def close(self) -> None:
        """Stop publishing and leave the ROS network."""
        self.release()
        self._closed = True
        self._link.close()

    @property
    def _silent_s(self) -> float:
        """Age of the newest joint state, NaN without any [s]."""
        return self._clock() - self._states.latest().time

    def _note(self) -> str:
        silent_s = self._silent_s
        missing = self._states.missing()
        if not self._state_came.is_set():
            return self._unheard()
        if silent_s > _SILENT_S:
            return f"{self._topics.state} silent for {silent_s:.1f} s"
        if missing:
            return f"{', '.join(missing)} not in {self._topics.state}"
        return "" if self._engaged else _IDLE

    def _unheard(self) -> str:
        note = self._link.health().note
        why = f" ({note})" if note else ""
        if self._states.strangers:
            return (
                f"{self._topics.state} has {', '.join(self._states.strangers)}, none "
                f"of {', '.join(self._states.joint_names)}"
            )
        return (
            f"nothing came on {self._topics.state} within {self._timeout_s:g} s{why}; "
            "a joint_state_broadcaster publishes it"
        )

    def _send(self, position: Array, effort: Array | None = None) -> None:
        if self._closed:
            raise BackendError("the backend is closed; make another one to go on")
        sums = position if effort is None else position + effort
        if not np.isfinite(sums).all():
            bad = int(np.flatnonzero(~np.isfinite(sums))[0])
            raise BackendError(
                f"target of {self._states.joint_names[bad]} is {sums[bad]} rad; a "
                "finite one can be sent"
            )
        if self._engaged:
            self._publish(position, effort)

    def _publish(self, position: Array, effort: Array | None = None) -> None:
        names = self._states.joint_names
        self._link.publish(
            self._topics.trajectory,
            JointTrajectory.reaching(names, position, self._period_s, effort),
        )

    def _on_state(self, message: JointState) -> None:
        if self._states.add(message, self._clock()):
            self._state_came.set()

    def _on_imu(self, message: Imu) -> None:
        # In ROS, -1 stands for a sensor that does not exist.
        if (
            message.angular_velocity_covariance[0] == -1.0
            or message.linear_acceleration_covariance[0] == -1.0
        ):
            return
        turn = _array(message.angular_velocity)
        push = _array(message.linear_acceleration)
        if not np.isfinite([turn, push]).all():
            return  # as if it had been lost; a rosbridge says null for what is NaN
        self._imu = (self._clock(), turn, push)
        self.has_imu = True
        self._imu_came.set()


class RosEffortBackend(RosBackend):
    """Drive a joint_trajectory_controller that takes positions and efforts.

    Efforts are torques that the motor drivers add to their own position control, as
    ros2_control has it for the command interfaces position and effort since Jazzy.
    """

    _latest: Array | None = None  # position that was published last

    def drive(self, targets: MotorTargets) -> None:
        """Publish the reference and the torques; does nothing before `engage`.

        A trajectory's point says no velocity here, so that the driver damps towards
        rest; what that takes from a moving joint, kd q'_ref, is added to its torque.

        Raises:
            BackendError: a target is not finite, or the backend is closed.
        """
        damped = np.nan_to_num(targets.damping) * targets.velocity
        self._send(targets.position, targets.torque + damped)

    def release(self) -> None:
        """Hold the last position without a torque, and stop publishing.

        The controller keeps its last point, whose torque was that of a moving robot.
        """
        if self._engaged and self._latest is not None:
            with suppress(BackendError, OSError):
                self._publish(self._latest)
        super().release()

    def _publish(self, position: Array, effort: Array | None = None) -> None:
        self._latest = position
        # Each point has both, so that no torque of an earlier one stays.
        super()._publish(
            position, np.zeros_like(position) if effort is None else effort
        )


def _array(vector: Vector3) -> Array:
    return np.array([vector.x, vector.y, vector.z])
