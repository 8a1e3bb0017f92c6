"""Drive a walk from ROS 2: commands from /cmd_vel in, joint states and targets out."""

import math
import threading
import time
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from gaitchain.backends.base import LinkHealth
from gaitchain.backends.ros.joint_states import joint_state
from gaitchain.backends.ros.link import RosLink
from gaitchain.backends.ros.messages import (
    JointState,
    JointTrajectory,
    Twist,
    TwistStamped,
)
from gaitchain.messages import CONTROL_PERIOD_S, Array, Command

MAX_AGE_S = 0.5
"""Largest difference of a command's stamp from this computer's clock [s]."""


class PilotTopics(NamedTuple):
    """Topics of a pilot."""

    command: str = "/cmd_vel"
    """geometry_msgs/Twist or TwistStamped, in."""
    state: str | None = "/joint_states"
    """sensor_msgs/JointState, out; None for a robot that is itself driven by ROS, since
    it would receive its own messages."""
    target: str | None = "/gaitchain/joint_trajectory"
    """trajectory_msgs/JointTrajectory, out; None for none."""


_TOPICS = PilotTopics()


class RosPilot:
    """Let ROS 2 nodes drive any backend, and publish its joint states and targets."""

    def __init__(
        self,
        link: RosLink,
        on_command: Callable[[Command], None],
        *,
        stamped: bool = False,
        period_s: float = CONTROL_PERIOD_S,
        topics: PilotTopics = _TOPICS,
        clock: Callable[[], int] = time.time_ns,
    ) -> None:
        """Subscribe and advertise.

        Args:
            link: the link to the ROS network; closed with the pilot.
            on_command: called on a thread of the link with each command, one at a
                time.
            stamped: for a link with one type per topic: whether to subscribe to
                TwistStamped instead of Twist; other links subscribe to both.
            period_s: control period, in which a target is to be reached [s].
            topics: names of the topics.
            clock: ROS time [ns].

        Raises:
            CommandError: a topic's name is invalid.
        """
        self._link, self._on_command, self._clock = link, on_command, clock
        self._period_s, self._topics = period_s, topics
        self.ignored = 0
        """Number of rejected commands."""
        self._note = ""
        self._lock = threading.Lock()  # each of two types has a thread of its own
        if link.mixes_types or not stamped:
            link.subscribe(topics.command, Twist, self._on_twist)
        if link.mixes_types or stamped:
            link.subscribe(topics.command, TwistStamped, self._on_stamped)
        if topics.state:
            link.advertise(topics.state, JointState)
        if topics.target:
            link.advertise(topics.target, JointTrajectory)

    def publish(
        self,
        time_ns: int,
        joint_names: Sequence[str],
        *,
        position: Array,
        velocity: Array,
        effort: Array,
        target: Array,
    ) -> None:
        """Publish joint states and targets; never blocks.

        Args:
            time_ns: UNIX time of the measurement [ns].
            joint_names: names of the joints in the order of the arrays.
            position: (n,) positions, NaN where not measured [rad].
            velocity: (n,) velocities, NaN where not measured [rad/s].
            effort: (n,) torques, NaN where not measured [N m].
            target: (n,) joint targets; published if all are finite [rad].
        """
        if self._topics.state:
            state = joint_state(time_ns, joint_names, position, velocity, effort)
            self._link.publish(self._topics.state, state)
        if self._topics.target and np.isfinite(target).all():
            targets = JointTrajectory.reaching(joint_names, target, self._period_s)
            self._link.publish(self._topics.target, targets)

    def health(self) -> LinkHealth:
        """Return the numbers of published and lost messages, and present problems."""
        link = self._link.health()
        return LinkHealth(link.sent, link.lost, link.note or self._note)

    def close(self) -> None:
        """Leave the ROS network."""
        self._link.close()

    def _on_stamped(self, message: TwistStamped) -> None:
        with self._lock:
            self._take_stamped(message)

    def _on_twist(self, message: Twist) -> None:
        with self._lock:
            self._take(message)

    def _take_stamped(self, message: TwistStamped) -> None:
        stamp = message.header.stamp.ns
        age_s = (self._clock() - stamp) * 1e-9
        if stamp and abs(age_s) > MAX_AGE_S:
            self._ignore(
                f"its stamp is {age_s:.1f} s old, more than {MAX_AGE_S:g} s from this "
                "computer's clock"
            )
            return
        self._take(message.twist)

    def _take(self, message: Twist) -> None:
        linear, turn = message.linear, message.angular
        numbers = (linear.x, linear.y, linear.z, turn.x, turn.y, turn.z)
        if not all(map(math.isfinite, numbers)):
            self._ignore(f"linear and angular are {numbers}, must be finite")
            return
        self._note = ""
        # Down is negative; nobody can stretch beyond the usual height.
        crouch = max(-linear.z, 0.0)
        self._on_command(Command(linear.x, linear.y, turn.z, crouch))

    def _ignore(self, why: str) -> None:
        self.ignored += 1
        # Without how many: a note that changes each time is a new event each time.
        self._note = f"commands on {self._topics.command} are ignored: {why}"
