"""What every backend offers, and what only a simulator does: truth and pushes."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import msgspec

from gaitchain.messages import Array, Sensors

TORQUE_UNIT = "N m"
"""Of a backend that knows its joints' torques."""
Numbers = tuple[float, ...]


class Truth(msgspec.Struct, frozen=True):
    """What only a simulator knows: for pictures, logs and the cause of a fall.

    Poses, velocities and forces are MuJoCo's, in the world.
    """

    qpos: Numbers
    """(7 + 2 n,) base and joints."""
    qvel: Numbers
    """(6 + 2 n,)"""
    place: Numbers
    """(2 * 3,) ankles of the left and the right foot [m]."""
    turn: Numbers
    """(2 * 9,) rotations of the feet."""
    wrench: Numbers
    """(2 * 6,) torque and force of the ground about the robot's CoM [N m, N]."""
    twist: Numbers
    """(2 * 6,) angular and linear velocity of the feet, at the robot's CoM."""
    com: Numbers
    """(3,) [m]."""
    tilt: Numbers
    """(2,) roll and pitch from the vertical [rad]."""
    foot_height: Numbers
    """(2,) [m]."""
    self_contact: bool


@dataclass(frozen=True)
class LinkHealth:
    """How well a backend has reached its robot since it was connected."""

    sent: int = 0
    """Requests to the robot."""
    lost: int = 0
    """Of them, those without a sound answer."""
    note: str = ""
    """What is wrong now, such as "left_knee does not answer"; empty if nothing."""
    fault: str = ""
    """What no walk goes on with, such as "left_knee has let go"; empty if nothing."""


class Backend(Protocol):
    """A robot, real or simulated, at the edge.

    Arrays of joints are (2 n,), in the order of the walker that drives it. Simulated
    robots move their clock by one control period at each `write`.
    """

    physical: bool
    """Whether motors move: then only a qualified library of this robot may."""
    has_imu: bool
    """Whether gyro and accelerometer measure anything; known once it is connected."""
    load_unit: str
    """Of `loads`: "N m", or "A" for servos that measure their currents."""

    def connect(self, position: Array) -> None:
        """Take hold of the robot.

        Args:
            position: where a simulated robot is put, standing [rad]. A real one stays
                as it is, with its torque off.

        Raises:
            BackendError: it cannot be reached, or is not what it is said to be.
        """

    def read(self) -> Sensors:
        """Return the latest measurements; NaN for a joint that did not answer.

        Raises:
            BackendError: nothing answers.
        """

    def write(self, position: Array) -> None:
        """Send joint targets [rad] for one control period.

        Raises:
            BackendError: nothing can be sent.
        """

    def engage(self) -> None:
        """Turn the torque on; each joint holds where it is.

        Raises:
            BackendError: nothing can be sent.
        """

    def release(self) -> None:
        """Turn the torque off, as far as the robot can be reached; never raises."""

    def loads(self) -> Array:
        """Return what the motors bore at the latest `read`, NaN where unknown."""

    def health(self) -> LinkHealth:
        """Return how well the robot was reached so far."""

    def close(self) -> None:
        """Let go of the robot, torque off where it has motors; never raises."""


@runtime_checkable
class SimulatedTruth(Protocol):
    """What a simulator offers beside the sensors of a robot."""

    def truth(self) -> Truth:
        """Return where the robot is and what its feet bear, now."""

    def push(self, impulse_ns: float, direction_deg: float) -> None:
        """Push the trunk from now on, for 0.1 s.

        Args:
            impulse_ns: force times duration [N s].
            direction_deg: as the trunk faces; 0 is pushed forward, +90 to the left.

        Raises:
            CommandError: a number is outside its limits.
        """
