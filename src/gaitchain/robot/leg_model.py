"""The full robot's legs, joint by joint: what walking needs beyond the reduced biped.

Vectors are in the *pelvis frame* with all leg joints at 0: origin between the hips,
x forward, y left, z up. The first index is the leg, 0 for the left one; joints run
from hip to ankle. The rest of the robot is held still and counts as trunk.
"""

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Annotated, Any, Self, get_type_hints

import msgspec
import numpy as np
from numpy.typing import NDArray

from gaitchain.errors import RobotFileError
from gaitchain.messages import Array

DECIMALS = 9
"""Of a number read from a robot's file, as a fingerprint has it: later ones differ from
processor to processor."""
MOSTLY = 0.7
"""Least component of a unit axis that counts as about that direction."""
_LEVEL = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
Soles = tuple[tuple[tuple[float, float], ...], ...]
"""Convex polygons in the frames of two soles, x forward, y left [m]."""


@dataclass(frozen=True, eq=False)
class LegModel:
    """The full robot with all joints but those of the legs held still; SI units.

    Each leg has n joints. Arrays over all leg joints, (2 n,), have the left leg first.
    Annotations are shapes, in which -1 stands for 2 n if it comes first, else for n.
    """

    joint_names: tuple[str, ...]
    """(2 n,) joint names in the robot's file."""
    knee: int
    """Index of the knee in a leg."""
    at: Annotated[Any, (2, -1, 3)]
    """(2, n, 3) joint centres relative to the previous joint, or the pelvis [m]."""
    axis: Annotated[Any, (2, -1, 3)]
    """(2, n, 3) joint axes, unit vectors."""
    com: Annotated[Any, (2, -1, 3)]
    """(2, n, 3) CoM of the link that each joint moves, from the joint's centre [m]."""
    inertia: Annotated[Any, (2, -1, 3, 3)]
    """(2, n, 3, 3) inertia of those links about their CoM [kg m^2]."""
    link_mass: Annotated[Any, (2, -1)]
    """(2, n) mass of those links [kg]."""
    foot_at: Annotated[Any, (2, 3)]
    """(2, 3) ankle point, above the sole's origin, from the last joint's centre [m]."""
    foot_turn: Annotated[Any, (2, 3, 3)]
    """(2, 3, 3) columns: the sole's forward, left and up axes."""
    trunk_mass: float
    trunk_com: Annotated[Any, (3,)]
    """(3,) CoM of the trunk [m]."""
    trunk_inertia: Annotated[Any, (3, 3)]
    """(3, 3) inertia of the trunk about its CoM [kg m^2]."""
    lower: Annotated[Any, (-1,)]
    """(2 n,) lower joint limits [rad]."""
    upper: Annotated[Any, (-1,)]
    stiffness: Annotated[Any, (-1,)]
    """(2 n,) stiffness of the servos [N m/rad]."""
    damping: Annotated[Any, (-1,)]
    """(2 n,) damping of servos and joints together [N m s/rad]."""
    joint_damping: Annotated[Any, (-1,)]
    """(2 n,) the joints' part of it, which torque limits do not bound [N m s/rad]."""
    torque_limit: Annotated[Any, (-1,)]
    speed_limit: Annotated[Any, (-1,)]
    """(2 n,) speed limits, infinite where the file has none [rad/s]."""
    armature: Annotated[Any, (-1,)]
    """(2 n,) rotor inertia reflected through the gear [kg m^2]."""
    friction_loss: Annotated[Any, (-1,)]
    """(2 n,) dry friction of the joints [N m]."""
    stand: Annotated[Any, (-1,)]
    """(2 n,) joint angles of the standing pose, with bent knees [rad]."""
    base_at: Annotated[Any, (3,)] = (0.0, 0.0, 0.0)
    """(3,) origin of the pelvis frame in the base frame of the file [m]."""
    base_turn: Annotated[Any, (3, 3)] = _LEVEL
    """(3, 3) columns: axes of the pelvis frame in the base frame."""
    held: Mapping[str, float] = field(default_factory=dict)
    """Fixed positions of all other joints: hinges [rad], slides [m]."""
    soles: Soles = ()
    """Corners of the left and the right sole from their ankle points, where they taper
    so that no rectangle does for them; else empty [m]."""

    def __post_init__(self) -> None:
        """Freeze the arrays and check that they fit together.

        Raises:
            RobotFileError: a shape is wrong, a value is NaN, or a joint range is empty
                or infinite, or a joint's own damping is more than that with its servo,
                or there is one sole, or one with two corners.
        """
        joints = len(self.joint_names)
        for name, shape in _SHAPES.items():
            array = np.array(getattr(self, name), dtype=float)
            size = joints if shape[0] == -1 else joints // 2
            needed = tuple(size if s == -1 else s for s in shape)
            if array.shape != needed:
                raise RobotFileError(f"{name} has shape {array.shape}, needs {needed}")
            if np.isnan(array).any():
                raise RobotFileError(f"{name} holds a value that is no number")
            array.setflags(write=False)
            object.__setattr__(self, name, array)

        finite = np.isfinite(self.lower) & np.isfinite(self.upper)
        ranges = "range is {lower:g} to {upper:g} rad, must "
        self._check_joints(finite, ranges + "be finite")
        self._check_joints(self.lower < self.upper, ranges + "rise")
        self._check_joints(
            self.joint_damping <= self.damping,
            "own damping is {joint_damping:g} N m s/rad, must be {damping:g} at most, "
            "which is all of it",
        )
        if len(self.soles) not in (0, 2) or any(len(sole) < 3 for sole in self.soles):
            corners = [len(sole) for sole in self.soles]
            raise RobotFileError(f"corners of soles: {corners}; two soles need 3 each")

    def _check_joints(self, held: NDArray[np.bool_], why: str) -> None:
        """Name the first joint of which something does not hold."""
        if held.all():
            return
        at = int(np.argmin(held))
        names = "lower", "upper", "damping", "joint_damping"
        numbers = {name: float(getattr(self, name)[at]) for name in names}
        raise RobotFileError(
            f"leg joint {self.joint_names[at]}: {why.format(**numbers)}"
        )

    def __eq__(self, other: object) -> bool:
        """Whether every number and name is the same; see `compare` for tolerances."""
        return isinstance(other, LegModel) and self.fingerprint == other.fingerprint

    def __hash__(self) -> int:
        return hash(self.fingerprint)

    @property
    def leg_joints(self) -> int:
        """Number of joints in one leg."""
        return len(self.joint_names) // 2

    @property
    def mass(self) -> float:
        """Mass of the whole robot [kg]."""
        return float(self.trunk_mass + self.link_mass.sum())

    @property
    def sagittal(self) -> tuple[str, ...]:
        """Names of the joints that turn about the y axis."""
        about_y = np.abs(self.axis[..., 1]).ravel() > MOSTLY
        return tuple(n for n, y in zip(self.joint_names, about_y, strict=True) if y)

    def with_servos(self, stiffness: Array | float, damping: Array | float) -> Self:
        """Return legs with other servos.

        Args:
            stiffness: part of each servo's stiffness.
            damping: part of each servo's damping; the joints keep their own.
        """
        servos = damping * (self.damping - self.joint_damping)
        return replace(
            self,
            stiffness=stiffness * self.stiffness,
            damping=self.joint_damping + servos,
        )

    def arrays(self) -> dict[str, Any]:
        """Return the array fields by name, as a library stores them."""
        return {name: getattr(self, name) for name in _SHAPES}

    def facts(self) -> dict[str, Any]:
        """Return the other fields by name."""
        names = [f.name for f in fields(self) if f.name not in _SHAPES]
        found = {name: getattr(self, name) for name in names}
        if not self.soles:
            del found["soles"]
        return {
            **found,
            "joint_names": list(self.joint_names),
            "held": dict(self.held),
        }

    @property
    def fingerprint(self) -> str:
        """Hash of every number, to `DECIMALS`, and of every name."""
        # A rounding error at 0 may have either sign: + 0.0 leaves no -0.
        facts = self.facts()
        facts["trunk_mass"] = round(self.trunk_mass, DECIMALS)
        facts["held"] = {n: round(q, DECIMALS) + 0.0 for n, q in self.held.items()}
        digest = hashlib.sha256(json.dumps(facts, sort_keys=True).encode())
        for name, array in self.arrays().items():
            rounded = np.round(np.ascontiguousarray(array), DECIMALS) + 0.0
            digest.update(name.encode() + rounded.tobytes())
        return digest.hexdigest()[:16]


_SHAPES: dict[str, tuple[int, ...]] = {
    name: hint.__metadata__[0]
    for name, hint in get_type_hints(LegModel, include_extras=True).items()
    if hasattr(hint, "__metadata__")
}


class _Facts(msgspec.Struct, forbid_unknown_fields=True):
    """The fields of a leg model that are no arrays, with their types."""

    joint_names: tuple[str, ...]
    knee: int
    trunk_mass: float
    held: dict[str, float]
    soles: Soles = ()


def legs_from(facts: Mapping[str, Any], arrays: Mapping[str, Any]) -> LegModel:
    """Build a leg model from what `LegModel.facts` and `LegModel.arrays` returned.

    Raises:
        RobotFileError: a fact is missing, unknown, of another type, or cannot be.
    """
    try:
        found = msgspec.convert(facts, _Facts)
    except msgspec.ValidationError as error:
        raise RobotFileError(f"facts of the legs: {error}") from None
    joints, mass = len(found.joint_names) // 2, found.trunk_mass
    if not 0 <= found.knee < joints:
        raise RobotFileError(
            f"knee is {found.knee}, must be the index of one of the {joints} joints of "
            "a leg, from 0"
        )
    if not (math.isfinite(mass) and mass > 0.0):
        raise RobotFileError(f"trunk_mass is {mass:g} kg, must be finite and above 0")
    return LegModel(**msgspec.structs.asdict(found), **arrays)
