"""A robot's profile: a person's answers where geometry does not decide.

A TOML file, every key optional, all numbers SI:

    forward = [1, 0, 0]                # in the base's frame; `up` likewise
    [legs]
    left = ["j1", "j2", "j3", "j4", "j5", "j6"]  # hip to ankle, or the foot's body
    [foot]
    left = "left_foot"                 # the foot's body
    [sole]                             # both soles, from the point under the ankle
    front = 0.12
    rear = -0.06
    half_width = 0.04
    below = 0.05                       # sole's plane below the ankle's joint
    [servo."*"]                        # every joint, or [servo.NAME] for one
    stiffness = 300
    armature = 0.02                    # rotor's inertia times gear ratio squared
    [stand]
    hip_height = 0.62
    [stand.angles]                     # joints outside the legs
    left_elbow = 0.4
"""

import difflib
import math
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from gaitchain.discover.findings import FEWEST_LEG_JOINTS, MOST_LEG_JOINTS
from gaitchain.errors import RobotFileError
from gaitchain.robot.whole_file import read_file

_MOST_BYTES = 1_000_000
_KEYS = ("forward", "up", "legs", "foot", "sole", "servo", "stand")
_SIDES = ("left", "right")
_Range = tuple[float, float, str]  # least, most, unit
_SOLE: dict[str, _Range] = {
    "front": (0.001, 1.0, "m"),
    "rear": (-1.0, -0.001, "m"),
    "half_width": (0.001, 0.5, "m"),
    "below": (0.0, 0.5, "m"),
}
_SERVO: dict[str, _Range] = {
    "stiffness": (0.01, 1e6, "N m/rad"),
    "damping": (0.0, 1e5, "N m s/rad"),
    "torque_limit": (0.001, 1e5, "N m"),
    "speed_limit": (0.01, 1e3, "rad/s"),
    "armature": (0.0, 100.0, "kg m^2"),
}
_HIP_HEIGHT = (0.02, 3.0, "m")
_ANGLE = (-2.0 * math.pi, 2.0 * math.pi, "rad")


@dataclass(frozen=True)
class Profile:
    """Answers that override what `find` would guess; empty ones override nothing."""

    origin: str = "profile"
    """What messages call the file."""
    legs: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """Joint names from hip to ankle, by side."""
    foot: Mapping[str, str] = field(default_factory=dict)
    """Body of the foot, by side."""
    sole: Mapping[str, float] = field(default_factory=dict)
    """Edges of both soles and how far they lie below the ankle [m]."""
    forward: tuple[float, float, float] | None = None
    up: tuple[float, float, float] | None = None
    servo: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    """Numbers of a servo by joint; "*" stands for every joint."""
    angles: Mapping[str, float] = field(default_factory=dict)
    """Standing angles of joints outside the legs [rad]; of slides, places [m]."""
    hip_height: float | None = None
    """Hips above the soles when standing [m]."""

    def require(self, name: str, known: Iterable[str], key: str) -> str:
        """Return a name that the model has.

        Args:
            name: the joint or body asked for.
            known: names in the model.
            key: key of the profile that asks.

        Raises:
            RobotFileError: the model has no such name; the message lists close ones.
        """
        names = [n for n in known if n]
        if name in names:
            return name
        near = difflib.get_close_matches(name, names, n=3) or names[:8]
        raise RobotFileError(
            f"{self.origin}: {key} = {name!r}: not in the model; near: "
            f"{', '.join(near)}"
        )


def load_profile(path: str | Path) -> Profile:
    """Load a robot's profile from a TOML file.

    Args:
        path: the file.

    Returns:
        The profile, each key and number checked.

    Raises:
        RobotFileError: the file is missing or not TOML; a key is unknown or its value
            cannot be.
    """
    try:
        table = tomllib.loads(read_file(Path(path), _MOST_BYTES).decode())
    except OSError as error:
        raise RobotFileError(f"{path}: {error.strerror}; give a TOML file") from None
    except (ValueError, RecursionError) as error:
        raise RobotFileError(f"{path}: not a TOML file: {error}") from None
    return parse_profile(table, str(path))


def parse_profile(table: Mapping[str, Any], origin: str) -> Profile:
    """Check a parsed profile key by key.

    Args:
        table: the keys as the module's docstring lists them.
        origin: what the messages call the file.

    Raises:
        RobotFileError: see `load_profile`.
    """
    whole = _Entry(table, "", origin).table(_KEYS)
    part = {key: whole.get(key, _Entry({}, key, origin)) for key in _KEYS}
    legs, foot = part["legs"].table(_SIDES), part["foot"].table(_SIDES)
    stand = part["stand"].table(("hip_height", "angles"))
    angles = stand["angles"].table() if "angles" in stand else {}
    feet = {side: entry.name() for side, entry in foot.items()}
    # A leg may be named by its foot's body alone.
    brief = [side for side, leg in legs.items() if isinstance(leg.value, str)]
    feet |= {side: legs.pop(side).name() for side in brief}
    return Profile(
        origin=origin,
        foot=feet,
        legs={side: leg.names() for side, leg in legs.items()},
        sole=part["sole"].numbers(_SOLE),
        forward=whole["forward"].direction() if "forward" in whole else None,
        up=whole["up"].direction() if "up" in whole else None,
        servo={j: entry.numbers(_SERVO) for j, entry in part["servo"].table().items()},
        angles={joint: entry.number(_ANGLE) for joint, entry in angles.items()},
        hip_height=stand["hip_height"].number(_HIP_HEIGHT)
        if "hip_height" in stand
        else None,
    )


@dataclass(frozen=True)
class _Entry:
    """An entry of a profile, and what messages call it and the file."""

    value: Any
    path: str
    origin: str

    def _wrong(self, reason: str) -> RobotFileError:
        shown = f"{self.path} = {self.value!r:.60}"
        return RobotFileError(f"{self.origin}: {shown}: {reason}")

    def table(self, known: Iterable[str] | None = None) -> dict[str, "_Entry"]:
        """Return the entries of a table, by name; `known` are all that it may have."""
        if not isinstance(self.value, dict):
            raise self._wrong("expected a table")
        prefix = f"{self.path}." if self.path else ""
        allowed = tuple(self.value if known is None else known)
        for key in self.value:
            if key not in allowed:
                near = difflib.get_close_matches(key, allowed, n=1)
                hint = f"did you mean {prefix}{near[0]}? " if near else ""
                raise RobotFileError(
                    f"{self.origin}: unknown key {prefix}{key}; {hint}allowed: "
                    f"{', '.join(allowed)}"
                )
        entries = self.value.items()
        return {k: _Entry(v, f"{prefix}{k}", self.origin) for k, v in entries}

    def numbers(self, known: Mapping[str, _Range]) -> dict[str, float]:
        return {k: entry.number(known[k]) for k, entry in self.table(known).items()}

    def number(self, allowed: _Range) -> float:
        (low, high, unit), value = allowed, self.value
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if not number or not low <= value <= high:  # false for NaN too
            raise RobotFileError(
                f"{self.origin}: {self.path} = {value!r:.40}; allowed: {low:.9g} to "
                f"{high:.9g} {unit}"
            )
        return float(value)

    def name(self) -> str:
        if not isinstance(self.value, str) or not self.value:
            raise self._wrong("expected a body's name")
        return self.value

    def names(self) -> tuple[str, ...]:
        names = self.value if isinstance(self.value, list) else [None]
        if not all(isinstance(name, str) and name for name in names):
            raise self._wrong(
                "expected a list of joint names, hip to ankle, or the name of the "
                "foot's body"
            )
        count = len(names)
        if not FEWEST_LEG_JOINTS <= len(set(names)) == count <= MOST_LEG_JOINTS:
            raise RobotFileError(
                f"{self.origin}: {self.path}: {count} joints; expected "
                f"{FEWEST_LEG_JOINTS} to {MOST_LEG_JOINTS}, each once"
            )
        return tuple(names)

    def direction(self) -> tuple[float, float, float]:
        if not isinstance(self.value, list) or len(self.value) != 3:
            raise self._wrong("expected [x, y, z]")
        x, y, z = (replace(self, value=v).number((-1e3, 1e3, "")) for v in self.value)
        length = math.hypot(x, y, z)
        if length < 1e-6:
            raise self._wrong("has no direction")
        return x / length, y / length, z / length
