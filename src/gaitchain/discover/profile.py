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
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from gaitchain.errors import RobotFileError

_SIDES = ("left", "right")
_SOLE = {
    "front": (0.001, 1.0, "m"),
    "rear": (-1.0, -0.001, "m"),
    "half_width": (0.001, 0.5, "m"),
    "below": (0.0, 0.5, "m"),
}
_SERVO = {
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
    """Standing angles of joints outside the legs [rad]."""
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
        table = tomllib.loads(Path(path).read_text(encoding="utf-8"))
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
    known = ("forward", "up", "legs", "foot", "sole", "servo", "stand")
    _refuse_unknown(table, known, origin, "")
    legs = _section(table, "legs", _SIDES, origin)
    foot = _section(table, "foot", _SIDES, origin)
    stand = _section(table, "stand", ("hip_height", "angles"), origin)
    angles = _table(stand, "angles", origin, "stand.angles")
    servo = _table(table, "servo", origin, "servo")
    feet = {s: _name(n, f"foot.{s}", origin) for s, n in foot.items()}
    # A leg may be named by its foot's body alone.
    feet |= {s: _name(n, f"legs.{s}", origin) for s, n in legs.items() if _word(n)}
    return Profile(
        origin=origin,
        legs={
            s: _names(n, f"legs.{s}", origin) for s, n in legs.items() if not _word(n)
        },
        foot=feet,
        sole=_numbers(_table(table, "sole", origin, "sole"), _SOLE, "sole", origin),
        forward=_direction(table, "forward", origin),
        up=_direction(table, "up", origin),
        servo={
            j: _numbers(
                _table(servo, j, origin, f"servo.{j}"), _SERVO, f"servo.{j}", origin
            )
            for j in servo
        },
        angles={
            j: _number(v, _ANGLE, f"stand.angles.{j}", origin)
            for j, v in angles.items()
        },
        hip_height=_number(stand["hip_height"], _HIP_HEIGHT, "stand.hip_height", origin)
        if "hip_height" in stand
        else None,
    )


def _word(value: Any) -> bool:
    return isinstance(value, str)


def _table(
    table: Mapping[str, Any], key: str, origin: str, path: str
) -> Mapping[str, Any]:
    entry = table.get(key, {})
    if not isinstance(entry, dict):
        raise RobotFileError(f"{origin}: {path} = {entry!r:.60}: expected a table")
    return entry


def _section(
    table: Mapping[str, Any], key: str, known: Iterable[str], origin: str
) -> Mapping[str, Any]:
    entry = _table(table, key, origin, key)
    _refuse_unknown(entry, known, origin, f"{key}.")
    return entry


def _refuse_unknown(
    table: Mapping[str, Any], known: Iterable[str], origin: str, prefix: str
) -> None:
    allowed = tuple(known)
    for key in table:
        if key not in allowed:
            near = difflib.get_close_matches(key, allowed, n=1)
            hint = f"did you mean {prefix}{near[0]}? " if near else ""
            raise RobotFileError(
                f"{origin}: unknown key {prefix}{key}; {hint}allowed: "
                f"{', '.join(allowed)}"
            )


def _numbers(
    table: Mapping[str, Any],
    known: Mapping[str, tuple[float, float, str]],
    path: str,
    origin: str,
) -> dict[str, float]:
    _refuse_unknown(table, known, origin, f"{path}.")
    return {k: _number(v, known[k], f"{path}.{k}", origin) for k, v in table.items()}


def _number(
    value: Any, allowed: tuple[float, float, str], path: str, origin: str
) -> float:
    low, high, unit = allowed
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not number or not low <= value <= high:  # false for NaN too
        raise RobotFileError(
            f"{origin}: {path} = {value!r:.40}; allowed: {low:g} to {high:g} {unit}"
        )
    return float(value)


def _name(value: Any, path: str, origin: str) -> str:
    if not isinstance(value, str) or not value:
        raise RobotFileError(
            f"{origin}: {path} = {value!r:.60}: expected a body's name"
        )
    return value


def _names(value: Any, path: str, origin: str) -> tuple[str, ...]:
    if not isinstance(value, list) or not all(_word(n) and n for n in value):
        raise RobotFileError(
            f"{origin}: {path} = {value!r:.60}: expected a list of joint names, hip to "
            "ankle, or the name of the foot's body"
        )
    if not 5 <= len(set(value)) == len(value) <= 7:
        raise RobotFileError(
            f"{origin}: {path}: {len(value)} joints; expected 5, 6 or 7, each once"
        )
    return tuple(value)


def _direction(
    table: Mapping[str, Any], key: str, origin: str
) -> tuple[float, float, float] | None:
    if key not in table:
        return None
    value = table[key]
    if not isinstance(value, list) or len(value) != 3:
        raise RobotFileError(f"{origin}: {key} = {value!r:.60}: expected [x, y, z]")
    x, y, z = (_number(v, (-1e3, 1e3, ""), key, origin) for v in value)
    length = math.hypot(x, y, z)
    if length < 1e-6:
        raise RobotFileError(f"{origin}: {key} = {value!r}: has no direction")
    return x / length, y / length, z / length
