"""Interfaces of every backend, and of a simulator, with ground truth and pushes."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import msgspec
import numpy as np

from gaitchain.errors import CommandError
from gaitchain.messages import Array, MotorTargets, Sensors
from gaitchain.sim.push import Punches, Push
from gaitchain.sim.world import DISTURBANCES, Arms

TORQUE_UNIT = "N m"
"""`Backend.load_unit` of a backend that measures joint torques."""
Numbers = tuple[float, ...]


def joint_angles(position: object, count: int) -> Array:
    """Return joint angles for a backend without a bus that could refuse them.

    Args:
        position: (count,) angles [rad], as the backend was given them.
        count: number of its joints.

    Raises:
        CommandError: they are other than so many finite numbers.
    """
    try:
        angles = np.asarray(position, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):  # a whole number may be too large
        raise CommandError(
            f"joint angles {position!r:.80}: need {count} finite numbers [rad]"
        ) from None
    if angles.shape != (count,):
        size = f"{angles.size} values" if angles.ndim == 1 else f"shape {angles.shape}"
        raise CommandError(f"joint angles have {size}, needs {count} [rad]")
    if not np.isfinite(angles).all():
        bad = np.flatnonzero(~np.isfinite(angles))[0]
        raise CommandError(
            f"joint angle {bad} is {angles[bad]}, each must be a finite number [rad]"
        )
    return angles


def numbers(*parts: Array) -> Numbers:
    """Return the numbers of arrays of any shape one after the other, as messages do."""
    return tuple(number for part in parts for number in np.ravel(part).tolist())


class Truth(msgspec.Struct, frozen=True):
    """Ground truth of a simulator: for pictures, logs and the cause of a fall.

    Poses, velocities and forces are those of MuJoCo, in the world frame.
    """

    qpos: Numbers
    """(7 + 2 n,) positions of base and joints [m, -, rad]."""
    qvel: Numbers
    """(6 + 2 n,) velocities of base and joints [m/s, rad/s]."""
    place: Numbers
    """(2 * 3,) positions of the left and the right ankle [m]."""
    turn: Numbers
    """(2 * 9,) rotation matrices of the feet, row by row."""
    wrench: Numbers
    """(2 * 6,) ground torque and force on each foot, about the robot's CoM [N m, N]."""
    twist: Numbers
    """(2 * 6,) angular and linear velocity of the feet at the CoM [rad/s, m/s]."""
    com: Numbers
    """(3,) CoM of the robot [m]."""
    tilt: Numbers
    """(2,) roll and pitch of the trunk from the vertical [rad]."""
    foot_height: Numbers
    """(2,) height of each sole's lowest corner above the floor [m]."""
    self_contact: bool
    whole: Numbers = ()
    """Positions in the robot's own model, arms and all, where that is simulated."""


def truth_sizes(joints: int) -> dict[str, int]:
    """Return the length of each array of a truth by its name.

    Args:
        joints: number of leg joints, 2 n.
    """
    fixed = {"place": 6, "turn": 18, "wrench": 12, "twist": 12, "com": 3}
    base = {"qpos": 7 + joints, "qvel": 6 + joints}
    return {**base, **fixed, "tilt": 2, "foot_height": 2}


class PunchesState(msgspec.Struct, frozen=True):
    """Punches: pushes of random size on random bodies, in random directions."""

    most_ns: float
    """Largest impulse [N s]."""
    every_s: float
    """From one to the next [s]."""

    def checked(self) -> Punches:
        """Return them as the world's.

        Raises:
            CommandError: a number is outside its limits.
        """
        return Punches(self.most_ns, self.every_s)

    def __str__(self) -> str:
        return str(self.checked())


class Disturbances(msgspec.Struct, frozen=True):
    """What disturbs a simulated robot all the while, besides pushes."""

    punches: PunchesState | None
    """On random bodies, in random directions in space; None for none."""
    arms: Arms
    """What somebody else does with the arms."""
    payload: float
    """Mass on the trunk, part of the robot's mass."""

    def changes_from(self, before: "Disturbances") -> list[str]:
        """Say what each field is that was another one before."""
        now = {name: getattr(self, name) for name in self.__struct_fields__}
        return [
            DISTURBANCES[name].tell(value)
            for name, value in now.items()
            if value != getattr(before, name)
        ]


@dataclass(frozen=True)
class LinkHealth:
    """State of a backend's link to its robot, since it was connected."""

    sent: int = 0
    """Number of requests to the robot."""
    lost: int = 0
    """Number of requests without a valid answer."""
    note: str = ""
    """Present problems, such as "left_knee does not answer"; empty if none."""
    fault: str = ""
    """Problem that ends a walk, such as "left_knee has let go"; empty if none."""
    holds: bool = False
    """Whether motors may have torque although the robot was let go."""
    supply_v: float | None = None
    """Voltage of the motors' supply, None where it is not measured [V]."""


class Backend(Protocol):
    """The interface to a robot, real or simulated.

    Arrays of joints are (2 n,), in the order of the walker that drives the robot. A
    simulated robot advances its clock by one control period at each `write`.
    """

    physical: bool
    """Whether real motors move; these require a qualified library of this robot."""
    has_imu: bool
    """Whether the robot has gyro and accelerometer; valid once connected."""
    load_unit: str
    """Unit of `loads`: "N m", or "A" for servos that measure their currents."""

    def connect(self, position: Array) -> None:
        """Connect to the robot.

        Args:
            position: joint angles in which a simulated robot is placed, standing
                [rad]. A real robot is not moved, and its torque is off.

        Raises:
            BackendError: the robot cannot be reached, or differs from its description.
        """

    def read(self) -> Sensors:
        """Return the latest measurements; NaN for a joint that did not answer.

        Raises:
            BackendError: the robot does not answer.
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
        """Return the motor loads at the latest `read`, NaN where unknown."""

    def health(self) -> LinkHealth:
        """Return the state of the link to the robot."""

    def close(self) -> None:
        """Disconnect, with the torque of motors off; never raises."""


@runtime_checkable
class MotorDriven(Protocol):
    """What a backend offers beyond `Backend.write` whose drivers take torques, too."""

    def drive(self, targets: MotorTargets) -> None:
        """Send targets for one control period, in place of `write`.

        Raises:
            BackendError: nothing can be sent.
        """


@runtime_checkable
class Bounded(Protocol):
    """What a backend offers whose servos turn less far than the robot's joints."""

    @property
    def limits(self) -> tuple[Array, Array]:
        """Lower and upper ends (2 n,) of what it sends, once connected [rad]."""


@runtime_checkable
class WholeBodied(Protocol):
    """What a backend offers that moves more than the legs: all joints, to get up."""

    whole_joint_names: tuple[str, ...]
    """All joints that it moves."""

    def read_whole(self) -> Sensors:
        """Return the latest measurements, of all joints.

        Raises:
            BackendError: the robot does not answer.
        """

    def write_whole(self, position: Array) -> None:
        """Send targets of all joints [rad] for one control period, in place of `write`.

        Raises:
            BackendError: nothing can be sent.
        """


@runtime_checkable
class SimulatedTruth(Protocol):
    """What a simulator offers beyond the sensors of a robot."""

    def truth(self) -> Truth:
        """Return the robot's true pose and the forces on its feet, now."""

    def push(
        self,
        impulse_ns: float,
        direction_deg: float,
        elevation_deg: float = Push.elevation_deg,
        body: str = Push.body,
    ) -> Push:
        """Push a body for 0.1 s, beginning now.

        Args:
            impulse_ns: force times duration [N s].
            direction_deg: relative to the trunk's heading; 0 pushes forward, +90 to
                the left [deg].
            elevation_deg: of the force above the floor's plane [deg].
            body: its name, or `sim.bodies.ANY_BODY`.

        Returns:
            The push, with the body that was drawn.

        Raises:
            CommandError: a number is outside its limits, or there is no such body.
        """

    @property
    def disturbances(self) -> Disturbances:
        """What disturbs the robot now, besides pushes."""

    def disturb(self, wanted: Disturbances) -> None:
        """Replace what disturbs the robot, from now on and across `connect`.

        Raises:
            CommandError: a number is outside its limits.
        """

    def take_punches(self) -> list[Push]:
        """Return the punches that have begun since the last call."""
