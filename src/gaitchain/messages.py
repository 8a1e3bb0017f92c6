"""The typed messages that cross a boundary: commands, sensors, targets, the panel."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
GRAVITY = 9.81
"""Acceleration of free fall: what the accelerometer of a robot at rest shows, upward
[m/s^2]."""
CONTROL_PERIOD_S = 0.01
"""Time between two targets of the servos [s]."""

ABSURD = 1e6
"""Speeds that add up to this are no robot's, as NaN is none [m/s, rad/s]."""


@dataclass(frozen=True)
class Command:
    """What the walk is asked to do."""

    vx: float = 0.0
    """Forward speed [m/s]; all three speeds 0 stop."""
    vy: float = 0.0
    """Speed to the left [m/s]."""
    yaw_rate: float = 0.0
    """Turning to the left [rad/s]."""
    crouch: float = 0.0
    """Hips below their usual height, walking or standing [m]."""

    @property
    def motion(self) -> tuple[float, float, float]:
        """The speeds: vx, vy [m/s], yaw rate [rad/s]."""
        return self.vx, self.vy, self.yaw_rate

    @property
    def stops(self) -> bool:
        """Whether the robot is to stand; also where a speed is none of a robot's."""
        sizes = abs(self.vx) + abs(self.vy) + abs(self.yaw_rate)
        return not 0.0 < sizes < ABSURD

    def scaled(self, part: float) -> "Command":
        """Return the command with a part of its speeds."""
        vx, vy, yaw_rate = self.motion
        return replace(self, vx=part * vx, vy=part * vy, yaw_rate=part * yaw_rate)

    @property
    def halted(self) -> "Command":
        """The command without its speeds: a robot that stops stays as low as it is."""
        return Command(crouch=self.crouch)


@dataclass(frozen=True, eq=False)
class Sensors:
    """What a robot measures in one control period."""

    time: float
    """[s]"""
    joint_position: Array
    """(2 n,) in the order of the walker's `joint_names` [rad]"""
    joint_velocity: Array
    """(2 n,) [rad/s]"""
    angular_velocity: Array
    """(3,) gyro in the trunk's frame [rad/s]"""
    acceleration: Array
    """(3,) accelerometer in the trunk's frame [m/s^2]"""
    foot_load: Array | None = None
    """(2,) load on the left and the right sole, where a robot has them [N]"""


class MotorGains(NamedTuple):
    """Gains of motor drivers that are not the library's."""

    stiffness: Array
    """(2 n,) kp [N m/rad]"""
    damping: Array
    """(2 n,) kd [N m s/rad]"""
    armature: Array
    """(2 n,) inertia of the rotors at the joints: `library.robot.legs.armature`
    [kg m^2]"""
    period_s: float
    """Time between two torques [s]."""


class MeasuredJoints(NamedTuple):
    """Joints as they were measured, some time after targets were made for them."""

    position: Array
    """(2 n,) [rad]"""
    velocity: Array
    """(2 n,) [rad/s]"""
    age_s: float
    """Of the targets [s]."""


@dataclass(frozen=True, eq=False)
class MotorTargets:
    """Targets in the form that motor drivers take.

    The driver pushes with torque + stiffness (position - q) + damping (velocity - q'),
    which is what a position servo of that stiffness and damping makes of
    `JointTargets.position`. Joints outside the legs are held with gains of their own,
    which are not known here: NaN.
    """

    position: Array
    """(2 n,) of the reference [rad]"""
    velocity: Array
    """(2 n,) of the reference [rad/s]"""
    torque: Array
    """(2 n,) fed forward; within the motors' limits as a walker makes it, not as
    `with_gains` does [N m]"""
    stiffness: Array
    """(2 n,) kp [N m/rad]"""
    damping: Array
    """(2 n,) kd, without that of the joint itself [N m s/rad]"""

    def with_gains(
        self, gains: "MotorGains", measured: "MeasuredJoints"
    ) -> "MotorTargets":
        """Return targets with which a driver of other gains pushes the same now.

        What a driver that has the gains of its maker misses is fed forward as torque:
        tau + (K - kp) (q_ref - q) + (D - kd) (q_ref' - q'), the reference moved on by
        its age. That is feedback by the computer, so it has to be made anew from each
        measurement, every 2 ms or so, where the walker makes targets each 10 ms. A
        torque that is held for a period T damps a rotor J stably by 2 J / T at most, so
        D - kd ends there.

        The torque alone may exceed the motors' limits where a joint is far from its
        reference: what the driver limits is its sum with kp and kd.

        Args:
            gains: the driver's.
            measured: the joints.

        Returns:
            Targets of those gains, whose torque is not limited.
        """
        position = self.position + measured.age_s * self.velocity
        missed = (self.stiffness - gains.stiffness) * (position - measured.position)
        more = np.minimum(
            self.damping - gains.damping, 2.0 * gains.armature / gains.period_s
        )
        torque = self.torque + missed + more * (self.velocity - measured.velocity)
        own = gains.stiffness, gains.damping
        return MotorTargets(position, self.velocity, torque, *own)


@dataclass(frozen=True, eq=False)
class JointTargets:
    """What the servos are asked to do."""

    joint_names: tuple[str, ...]
    position: Array
    """(2 n,) for position servos: ahead of the reference by what they lag [rad]"""
    status: str = ""
    """What was wrong with the sensors, if anything."""
    motors: MotorTargets | None = None
    """The same for motor drivers; None in the gait's own targets."""


@dataclass(frozen=True)
class PanelMessage:
    """The primitive components of the next key pose, for the control panel.

    Action primitives classify the joints: the sagittal group is what Lift and Move
    set, the frontal group what Swing sets (Sec. VI-B).
    """

    key_moment: str
    """kp_1 to kp_4."""
    left_support: bool
    duration_s: float
    """Time until the pose is reached [s]."""
    swing: dict[str, float]
    """Swing: sway [rad]."""
    lift: dict[str, float]
    """Lift: foot_x, foot_z [m]."""
    move: dict[str, float]
    """Move: hip_x, hip_height [m]."""
    frontal: dict[str, float]
    """Joint angles of the frontal plane by name [rad]."""
    sagittal: dict[str, float]
    """Joint angles of the sagittal plane by name [rad]."""
