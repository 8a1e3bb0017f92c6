"""What walking needs of a robot's model, as `find` derives it from the geometry.

Joint angles are MuJoCo's `qpos`, so a joint whose `ref` is not 0 is at `ref` where its
file draws it. The left leg comes first throughout.
"""

from dataclasses import dataclass

from gaitchain.errors import RobotFileError
from gaitchain.messages import Array

Row = tuple[str, str, str]
"""What was found, the finding, the evidence for it."""
Rows = list[Row]
FEWEST_LEG_JOINTS, MOST_LEG_JOINTS = 5, 7
"""Driven joints of a leg that walking can use."""
LEG_GAINS = "leg gains"
"""What a row is about that says why the file's gains of leg servos are not believed."""


@dataclass(frozen=True, eq=False)
class FoundSole:
    """Flat outline of a sole, in its foot body's frame."""

    body: str
    """The foot body."""
    origin: Array
    """(3,) foot point: in the sole's plane, x under the ankle, y on the sole's centre
    line [m], in the foot body's frame."""
    rotation: Array
    """(3, 3) ahead, left and up of the sole as columns, in the foot body's frame."""
    outline: Array
    """(K, 2) convex polygon, counter-clockwise, in that frame from the origin [m]."""
    front: float
    """Front edge of the rectangle that control uses, x > 0 [m]. It is inscribed in the
    outline, or of the same area where that tapers to a point."""
    rear: float
    """Its rear edge, x < 0 [m]."""
    half_width: float
    """Half its width [m]."""
    tapers: bool
    """Whether no rectangle in the outline does for it."""
    geoms: tuple[int, ...]
    """Collision geoms it came from."""

    @property
    def centre(self) -> Array:
        """Middle of that rectangle, (3,) in the foot body's frame [m]."""
        ahead = 0.5 * (self.front + self.rear) * self.rotation[:, 0]
        return self.origin + ahead


@dataclass(frozen=True, eq=False)
class FoundLeg:
    """A leg: its joints from hip to ankle, its knee and its sole."""

    joints: tuple[str, ...]
    """Hinges with an actuator (or to be given one), hip to ankle."""
    knee: int
    """Index of the knee in `joints`."""
    knee_bends: float
    """Sign, +1 or -1, of the knee angle that flexes the leg, knee moving forward."""
    passive: tuple[str, ...]
    """Joints of the leg that are coupled, or have no actuator while others have."""
    sole: FoundSole


@dataclass(frozen=True, eq=False)
class FoundServo:
    """The position servo of a joint."""

    joint: str
    stiffness: float
    """[N m/rad], of a slide [N/m]."""
    damping: float
    """Sum of servo and joint [N m s/rad]."""
    torque_limit: float
    """[N m]."""
    speed_limit: float
    """[rad/s]; infinite where the file does not say."""
    source: str
    """"actuator", "derived: motor", "derived: placeholder gains", "derived: none",
    "passive" or "profile"."""
    armature: float
    """Inertia of the rotor, times the gear ratio squared [kg m^2]."""


@dataclass(frozen=True, eq=False)
class Findings:
    """What walking needs of a robot."""

    base: str
    """Body with the free joint."""
    pelvis: str
    """Last body that both legs share; a waist may lie between it and the base."""
    forward: Array
    """(3,) unit vector, in the base's frame."""
    up: Array
    """(3,) unit vector, in the base's frame."""
    left: FoundLeg
    right: FoundLeg
    stand: dict[str, float]
    """Standing pose with bent knees: hinges [rad], slides [m]."""
    hip_height: float
    """Hips above the soles' plane in it [m]."""
    servos: dict[str, FoundServo]
    """One for every hinge and slide of the robot."""
    evidence: tuple[Row, ...]
    """For people to check."""

    @property
    def legs(self) -> tuple[FoundLeg, FoundLeg]:
        """Left and right leg."""
        return self.left, self.right


class UnfitError(RobotFileError):
    """A robot cannot walk here; `find` adds what messages call the robot."""

    def __init__(
        self, reason: str, key: str | None = None, other: str | None = None
    ) -> None:
        """Say why, and which profile key would settle it, or in rarer cases another."""
        hint = f"; to settle it, give {key} in a profile" if key else ""
        super().__init__(f"{reason}{hint}{f', or {other}' if other else ''}")
