"""The reduced biped: the lengths, masses, soles and limits that walking needs."""

import difflib
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from gaitchain.errors import RobotFileError

_DEGREE = math.pi / 180.0
_OF_CALIBRATIONS = {"fingerprint", "joints"}  # keys of a file of that kind
_LONGEST_NAME = 1000
_MISTAKEN = {"m": ("lengths", "mm"), "kg": ("masses", "g")}


def _quantity(unit: str, low: float, high: float, scale: float = 1.0) -> Any:
    """Declare a quantity of the robot file: its unit, allowed range and SI scale."""
    return field(metadata={"unit": unit, "low": low, "high": high, "scale": scale})


@dataclass(frozen=True)
class ReducedBiped:
    """A humanoid reduced to five links, two feet and two frontal angles.

    The paper gives lengths and masses of crus, femur and trunk (Sec. VI-A); feet,
    widths and servos are ours. All values are SI, angles in radians. Links are
    uniform boxes, so that every inertia follows from mass and size.
    """

    name: str
    crus_length: float = _quantity("m", 0.02, 2.0)
    femur_length: float = _quantity("m", 0.02, 2.0)
    trunk_length: float = _quantity("m", 0.02, 3.0)
    ankle_height: float = _quantity("m", 0.0, 0.5)
    hip_width: float = _quantity("m", 0.01, 1.0)
    sole_length: float = _quantity("m", 0.01, 1.0)
    sole_width: float = _quantity("m", 0.01, 1.0)
    sole_offset: float = _quantity("m", -0.5, 0.5)
    leg_thickness: float = _quantity("m", 0.005, 0.5)
    trunk_depth: float = _quantity("m", 0.01, 2.0)
    trunk_width: float = _quantity("m", 0.01, 2.0)
    crus_mass: float = _quantity("kg", 0.001, 200.0)
    femur_mass: float = _quantity("kg", 0.001, 200.0)
    trunk_mass: float = _quantity("kg", 0.001, 500.0)
    foot_mass: float = _quantity("kg", 0.001, 50.0)
    joint_angle_limit: float = _quantity("deg", 10.0, 180.0, _DEGREE)
    joint_speed_limit: float = _quantity("deg/s", 1.0, 5000.0, _DEGREE)
    joint_torque_limit: float = _quantity("N m", 0.1, 5000.0)
    servo_stiffness: float = _quantity("N m/rad", 0.1, 1e6)
    servo_damping: float = _quantity("N m s/rad", 0.0, 1e5)
    joint_armature: float = _quantity("kg m^2", 0.0, 10.0)
    sources: Mapping[str, str] = field(default_factory=dict, compare=False)

    @property
    def leg_length(self) -> float:
        """Length of the straight leg from hip to ankle [m]."""
        return self.crus_length + self.femur_length

    @property
    def mass(self) -> float:
        """Mass of the whole robot [kg]."""
        legs = 2.0 * (self.crus_mass + self.femur_mass + self.foot_mass)
        return self.trunk_mass + legs

    @property
    def sole_x(self) -> tuple[float, float]:
        """Rear and front edge of the sole, x from the ankle [m]."""
        half = 0.5 * self.sole_length
        return self.sole_offset - half, self.sole_offset + half

    def digits(self, decimals: int | None = None) -> str:
        """Return all quantities as text to be hashed.

        Args:
            decimals: to which they are rounded; None for all digits.
        """
        found = self.numbers()
        if decimals is not None:
            found = {name: round(value, decimals) for name, value in found.items()}
        # A rounding error at 0 may have either sign: no -0.
        return "".join(f"{name}={value + 0.0!r};" for name, value in found.items())

    def numbers(self) -> dict[str, float]:
        """Return all quantities of the robot by name, in SI units."""
        return {f.name: getattr(self, f.name) for f in fields(self) if f.metadata}


def builtin_robots() -> tuple[str, ...]:
    """Return the names of the robots that come with the package."""
    folder = resources.files("gaitchain") / "data"
    names = (entry.name for entry in folder.iterdir())
    return tuple(sorted(n.removesuffix(".toml") for n in names if n.endswith(".toml")))


def is_boxes(robot: str | Path) -> bool:
    """Return whether a path or name refers to a box robot."""
    return str(robot) in builtin_robots() or str(robot).endswith(".toml")


def parse_biped(table: Mapping[str, Any], origin: str) -> ReducedBiped:
    """Check a parsed robot file key by key and build the biped.

    Args:
        table: `name` and one `{value, unit, source}` table for each quantity.
        origin: name of the file in error messages.

    Raises:
        RobotFileError: see `box_robot.load_box_robot`.
    """
    quantities = {f.name: f.metadata for f in fields(ReducedBiped) if f.metadata}
    _refuse_unknown(table, {"name", *quantities}, origin)
    try:
        name = checked_name(table.get("name"))
    except ValueError as error:
        raise RobotFileError(f"{origin}: {error}") from None
    values = {k: _number(table, k, meta, origin) for k, meta in quantities.items()}
    sources = {k: str(table[k].get("source", "unsaid")) for k in quantities}
    biped = ReducedBiped(name=name, sources=sources, **values)
    _check_sole(biped, origin)
    return biped


def check_units(biped: ReducedBiped, origin: str) -> None:
    """Refuse what is so large or heavy that it must have been in mm or g.

    Args:
        biped: read from a file whose units are m and kg.
        origin: what messages call the robot.

    Raises:
        RobotFileError: a length or a mass is beyond what a robot file of our own may
            have. What is too small is no matter of units, but of the rest of the robot.
    """
    for quantity in fields(biped):
        unit = quantity.metadata.get("unit")
        value = getattr(biped, quantity.name)
        if unit in _MISTAKEN and value > quantity.metadata["high"]:
            kind, other = _MISTAKEN[unit]
            raise RobotFileError(
                f"{origin}: {quantity.name} is {value:.4g} {unit}, at most "
                f"{quantity.metadata['high']:g} {unit} are allowed; MJCF and URDF have "
                f"{kind} in {unit}; if the file's are in {other}, divide them by 1000"
            )


def checked_name(name: object) -> str:
    """Return the name of a robot.

    Raises:
        ValueError: it cannot be shown in one line, or sent as text.
    """
    if isinstance(name, str) and name.isprintable() and 0 < len(name) <= _LONGEST_NAME:
        return name
    raise ValueError(
        f"name = {name!a:.80}: expected a non-empty string of at most "
        f"{_LONGEST_NAME} characters that can be printed"
    )


def quantity_limits() -> dict[str, tuple[float, float]]:
    """Return the least and the greatest that each quantity may be, in SI units."""
    return {
        f.name: (f.metadata["low"] * scale, f.metadata["high"] * scale)
        for f in fields(ReducedBiped)
        if (scale := f.metadata.get("scale"))
    }


def quantity_units(biped: ReducedBiped) -> dict[str, tuple[float, str]]:
    """Return each quantity with its unit, as given in the robot's file."""
    return {
        f.name: (getattr(biped, f.name) / f.metadata["scale"], f.metadata["unit"])
        for f in fields(biped)
        if f.metadata
    }


def _refuse_unknown(table: Mapping[str, Any], known: set[str], origin: str) -> None:
    for key in table:
        if key not in known:
            near = difflib.get_close_matches(key, known, n=1)
            hint = f"; did you mean {near[0]}?" if near else ""
            if table.keys() >= _OF_CALIBRATIONS:
                hint = "; this is a calibration of servos, no robot"
            raise RobotFileError(f"{origin}: unknown key {key}{hint}")


def _number(
    table: Mapping[str, Any], key: str, meta: Mapping[str, Any], origin: str
) -> float:
    unit, low, high = meta["unit"], meta["low"], meta["high"]
    allowed = f"allowed: {low:.9g} to {high:.9g} {unit}"
    entry = table.get(key)
    if entry is None:
        raise RobotFileError(f"{origin}: {key} is missing; {allowed}")
    if not isinstance(entry, dict) or "value" not in entry:
        raise RobotFileError(
            f'{origin}: {key} = {entry!r}: expected {{ value = ..., unit = "{unit}", '
            f'source = "..." }}; {allowed}'
        )
    _refuse_unknown(entry, {"value", "unit", "source"}, f"{origin}: {key}")
    value = entry["value"]
    if entry.get("unit", unit) != unit:
        raise RobotFileError(f"{origin}: {key} is in {entry['unit']!r}; use {unit!r}")
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise RobotFileError(f"{origin}: {key} = {value!r} is not a number; {allowed}")
    if not low <= value <= high:  # false for NaN too
        raise RobotFileError(f"{origin}: {key} = {value!r:.40} {unit}; {allowed}")
    return float(value) * float(meta["scale"])


def _check_sole(biped: ReducedBiped, origin: str) -> None:
    rear, front = biped.sole_x
    if not rear < 0.0 < front:
        limit = 0.5 * biped.sole_length
        raise RobotFileError(
            f"{origin}: sole_offset = {biped.sole_offset:g} m leaves the ankle off the "
            f"sole; allowed: {-limit:g} to {limit:g} m for this sole_length"
        )
    if not np.isfinite(biped.mass):
        raise RobotFileError(f"{origin}: the masses add up to {biped.mass} kg")
