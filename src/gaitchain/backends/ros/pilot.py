"""ROS 2 drives a walk: commands from /cmd_vel in, joint states and targets out."""

import math
import time
from collections.abc import Callable, Sequence

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

COMMANDS = "/cmd_vel"
STATES = "/joint_states"
TARGETS = "/gaitchain/joint_trajectory"
MAX_AGE_S = 0.5
"""Stamps of commands that differ more from this computer's clock are not believed."""


class RosPilot:
    """Let ROS 2 nodes drive any backend, and see what its joints do."""

    def __init__(
        self,
        link: RosLink,
        on_command: Callable[[Command], None],
        *,
        stamped: bool = False,
        period_s: float = CONTROL_PERIOD_S,
        command_topic: str = COMMANDS,
        state_topic: str | None = STATES,
        target_topic: str | None = TARGETS,
        clock: Callable[[], int] = time.time_ns,
    ) -> None:
        """Subscribe and advertise.

        Args:
            link: the way into the ROS network; closed with the pilot.
            on_command: called on a thread of the link with each command.
            stamped: whether a link that carries one type per topic listens to
                TwistStamped, else to Twist; other links listen to both.
            period_s: control period: a target is to be reached that long after [s].
            command_topic: geometry_msgs/Twist or TwistStamped, in.
            state_topic: sensor_msgs/JointState, out; None for a robot that is behind
                ROS itself, or it would hear its own echo.
            target_topic: trajectory_msgs/JointTrajectory, out; None for none.
            clock: ROS time [ns].

        Raises:
            CommandError: a topic's name cannot be.
        """
        self._link, self._on_command, self._clock = link, on_command, clock
        self._period_s, self._command_topic = period_s, command_topic
        self._state_topic, self._target_topic = state_topic, target_topic
        self.ignored = 0
        """Commands that were not passed on."""
        self._note = ""
        if link.mixes_types or not stamped:
            link.subscribe(command_topic, Twist, self._on_twist)
        if link.mixes_types or stamped:
            link.subscribe(command_topic, TwistStamped, self._on_stamped)
        if state_topic:
            link.advertise(state_topic, JointState)
        if target_topic:
            link.advertise(target_topic, JointTrajectory)

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
        """Publish what the joints do and are asked to do; never waits.

        Args:
            time_ns: UNIX time of the measurement [ns].
            joint_names: in the order of the arrays.
            position: NaN where it is not measured [rad].
            velocity: the same [rad/s].
            effort: the same [N m].
            target: published if all of it are numbers [rad].
        """
        if self._state_topic:
            state = joint_state(time_ns, joint_names, position, velocity, effort)
            self._link.publish(self._state_topic, state)
        if self._target_topic and np.isfinite(target).all():
            targets = JointTrajectory.reaching(joint_names, target, self._period_s)
            self._link.publish(self._target_topic, targets)

    def health(self) -> LinkHealth:
        """Return how many messages were published, and what is wrong."""
        link = self._link.health()
        return LinkHealth(link.sent, link.lost, link.note or self._note)

    def close(self) -> None:
        """Leave the ROS network."""
        self._link.close()

    def _on_stamped(self, message: TwistStamped) -> None:
        stamp = message.header.stamp.ns
        age_s = (self._clock() - stamp) * 1e-9
        if stamp and abs(age_s) > MAX_AGE_S:
            self._ignore(
                f"its stamp is {age_s:.1f} s old, more than {MAX_AGE_S:g} s from this "
                "computer's clock"
            )
            return
        self._on_twist(message.twist)

    def _on_twist(self, message: Twist) -> None:
        linear, turn = message.linear, message.angular
        numbers = (linear.x, linear.y, linear.z, turn.x, turn.y, turn.z)
        if not all(map(math.isfinite, numbers)):
            self._ignore(f"linear and angular are {numbers}, must be finite")
            return
        self._note = ""
        self._on_command(Command(linear.x, linear.y, turn.z))

    def _ignore(self, why: str) -> None:
        self.ignored += 1
        self._note = (
            f"{self.ignored} commands on {self._command_topic} ignored, the last one "
            f"because {why}"
        )
