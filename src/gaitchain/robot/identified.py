"""What was identified of one robot: how it differs from its file. Ours.

A robot on a bench differs from its file; its logs tell how, see `identify.fit`.
"""

import json
import math
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np

from gaitchain.errors import RobotFileError, names_apart
from gaitchain.messages import Array

_AXES = 3
_OF_JOINTS = "gain", "offset", "damping", "backlash_deg", "dry_friction"
_ALIKE = "damping", "backlash_deg", "dry_friction"  # one number for all, of before
_NEW = {"trunk_mass": 1.0, "imu_delay_s": 0.0}  # that libraries of before do not have
_SELDOM = "turnaround_s"  # not in each log
_FACTORS = "gain", "damping", "trunk_mass"
_AMOUNTS = (
    *("delay_s", "backlash_deg", "dry_friction", "stiction", "viscous_friction"),
    *("imu_delay_s", _SELDOM),
)
_PLACED = "gain", "offset", "com", "tilt"
UNSURE = (
    *_PLACED,
    *("damping", "backlash_deg", "dry_friction"),
    *("delay_s", "stiction", "viscous_friction", "trunk_mass", "imu_delay_s"),
)
"""Numbers whose covariance is known, one after the other."""
_OF_BEFORE = {f"{name}_sd" for name in _PLACED}  # in place of `unknown`
_LEAST_FACTOR = 0.05
_LEAST = dict.fromkeys(_FACTORS, _LEAST_FACTOR) | dict.fromkeys(_AMOUNTS, 0.0)
"""What a drawn number is at least."""


@dataclass(frozen=True, eq=False)
class Identified:
    """How a robot differs from its file, and how well that is known.

    Of damping, play and dry friction one number may stand for all joints.
    """

    gain: Array
    """(2 n,) factor on each servo's stiffness and damping."""
    offset: Array
    """(2 n,) what each encoder shows more than the joint's angle [rad]."""
    com: Array
    """(3,) shift of the trunk's CoM [m]."""
    tilt: Array
    """(3,) turn of the IMU about the trunk's axes [rad]."""
    damping: Array = field(default_factory=lambda: np.ones(()))
    """(2 n,) factor on the damping of each servo, beyond its gain."""
    backlash_deg: Array = field(default_factory=lambda: np.zeros(()))
    """(2 n,) play of the gears, from end to end [deg]."""
    dry_friction: Array = field(default_factory=lambda: np.zeros(()))
    """(2 n,) dry friction of the gears, part of the torque limits."""
    delay_s: float = 0.0
    """Targets come late by this [s]."""
    stiction: float = 0.0
    """Dry friction at rest beyond that in motion, part of the latter."""
    viscous_friction: float = 0.0
    """Part of the torque limits that is lost at the speed limits."""
    trunk_mass: float = 1.0
    """Factor on the mass and the inertia of the trunk."""
    imu_delay_s: float = 0.0
    """Gyro and accelerometer come late by this [s]."""
    turnaround_s: float | None = None
    """What the bus of the log took from the begin of a read to the last byte of its
    targets [s]; None where the log does not tell. A part of `delay_s`, whose rest is
    of the servos."""
    unknown: Array = field(default_factory=lambda: np.zeros(()))
    """(K, K) lower factor of the covariance of all numbers of `UNSURE`, in their units;
    0 where they are exact."""

    def __post_init__(self) -> None:
        """Give each joint its own number."""
        for name in _ALIKE:
            numbers = np.full(np.shape(self.gain), getattr(self, name))
            object.__setattr__(self, name, numbers)
        count = unsure_numbers(len(self.gain))
        unknown = np.broadcast_to(self.unknown, (count, count)).copy()
        object.__setattr__(self, "unknown", unknown)

    @property
    def deviations(self) -> dict[str, float]:
        """Standard deviations of the numbers of `UNSURE` by name, RMS of each array."""
        square = np.sum(self.unknown**2, axis=1)
        return {n: float(np.sqrt(np.mean(square[at]))) for n, at in self._places()}

    def describe_unknown(self) -> list[tuple[str, str]]:
        """Return `deviations` as texts, of what and how much."""
        sd = self.deviations
        return [
            ("servo gain", f"{100.0 * sd['gain']:.1f} %"),
            ("encoders", f"{math.degrees(sd['offset']):.2f} deg"),
            ("CoM of the trunk", f"{1000.0 * sd['com']:.1f} mm"),
            ("IMU", f"{math.degrees(sd['tilt']):.2f} deg"),
            ("damping of the servos", f"{100.0 * sd['damping']:.1f} %"),
            ("backlash", f"{sd['backlash_deg']:.2f} deg"),
            ("dry friction", f"{100.0 * sd['dry_friction']:.1f} %"),
            ("viscous friction", f"{100.0 * sd['viscous_friction']:.1f} %"),
            ("stiction", f"{100.0 * sd['stiction']:.0f} %"),
            ("delay of the targets", f"{1000.0 * sd['delay_s']:.1f} ms"),
            ("mass of the trunk", f"{100.0 * sd['trunk_mass']:.1f} %"),
            ("delay of the IMU", f"{1000.0 * sd['imu_delay_s']:.1f} ms"),
        ]

    def moved(self, by: Array) -> "Identified":
        """Return what may as well be true of the robot.

        Args:
            by: (K,) independent numbers of deviation 1, which `unknown` ties together.
        """
        off = self.unknown @ by
        return replace(self, **{n: self._off(n, off[at]) for n, at in self._places()})

    def _off(self, name: str, off: Array) -> Any:
        """Return a number, or those of an array, that is off, if that can be."""
        value = getattr(self, name)
        moved = np.maximum(value + off, _LEAST.get(name, -math.inf))
        return moved if np.shape(value) else float(moved[0])

    def _places(self) -> list[tuple[str, slice]]:
        """Return where the numbers of `UNSURE` are in a row of all of them."""
        ends = np.cumsum([np.size(getattr(self, name)) for name in UNSURE]).tolist()
        return list(zip(UNSURE, map(slice, [0, *ends], ends), strict=True))

    @classmethod
    def of_file(cls, joints: int) -> "Identified":
        """Return what is known without a log: the file.

        Args:
            joints: number of leg joints, 2 n.
        """
        return cls(np.ones(joints), np.zeros(joints), np.zeros(_AXES), np.zeros(_AXES))

    def __eq__(self, other: object) -> bool:
        """Whether all numbers are equal."""
        return isinstance(other, Identified) and self.facts() == other.facts()

    def __hash__(self) -> int:
        return hash(json.dumps(self.facts()))

    def facts(self) -> dict[str, Any]:
        """Return all that is known by name, in plain types."""
        known = {f.name: getattr(self, f.name) for f in fields(self)}
        return {n: np.asarray(v).tolist() for n, v in known.items() if v is not None}


def identified_from(facts: Any, joints: int) -> Identified:
    """Return what `Identified.facts` returned.

    Args:
        facts: the numbers by name.
        joints: number of leg joints, 2 n.

    Raises:
        RobotFileError: a number is missing, unknown, not finite or cannot be, or there
            are too many or too few of them.
    """
    sizes: dict[str, tuple[int, ...]] = dict.fromkeys(_OF_JOINTS, (joints,))
    count = unsure_numbers(joints)
    sizes |= {"com": (_AXES,), "tilt": (_AXES,), "unknown": (count, count)}
    wanted = {f.name for f in fields(Identified)}
    if not isinstance(facts, dict):
        raise RobotFileError(f"what was identified is {facts!r:.80}, must be a table")
    facts = _NEW | _of_now(facts, joints)
    given = {*facts, _SELDOM}
    if given != wanted:
        raise RobotFileError(f"identified numbers {names_apart(given, wanted)}")
    found: dict[str, Any] = {}
    for name, value in facts.items():
        numbers = _numbers(name, value)
        if name in _ALIKE and not numbers.shape:
            numbers = np.full(joints, numbers)
        if name == "unknown" and numbers.shape == 2 * (_placed(joints),):
            numbers = np.pad(numbers, (0, count - len(numbers)))
        if numbers.shape != sizes.get(name, ()) or not np.isfinite(numbers).all():
            size = " x ".join(map(str, sizes.get(name, (1,))))
            raise RobotFileError(
                f"identified {name} is {value!r:.80}, must be finite, of size {size}"
            )
        if name in _FACTORS and not (numbers > 0.0).all():
            raise RobotFileError(f"identified {name} is {value!r:.80}, must be above 0")
        if name in _AMOUNTS and (numbers < 0.0).any():
            raise RobotFileError(
                f"identified {name} is {value!r:.80}, must be 0 or more"
            )
        found[name] = numbers if name in sizes else float(numbers)
    return Identified(**found)


def _numbers(name: str, value: Any) -> Array:
    """Return a value of JSON as an array, of whatever shape."""
    try:
        return np.array(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise RobotFileError(
            f"identified {name} is {value!r:.80}, must be of numbers"
        ) from None


def unsure_numbers(joints: int) -> int:
    """Return how many numbers `UNSURE` has together.

    Args:
        joints: number of leg joints, 2 n.
    """
    single = len(UNSURE) - len(_OF_JOINTS) - 2
    return len(_OF_JOINTS) * joints + 2 * _AXES + single


def _placed(joints: int) -> int:
    """Return how many of them libraries of before have: the others were exact."""
    return 2 * joints + 2 * _AXES


def _of_now(facts: dict[str, Any], joints: int) -> dict[str, Any]:
    """Return facts with what is unknown of each number, whichever way they have it.

    Libraries of before have one deviation for each array, of independent numbers.
    """
    if not set(facts) >= _OF_BEFORE:
        return facts
    each = [facts[f"{name}_sd"] for name in _PLACED]
    if not all(isinstance(sd, float | int) and sd >= 0.0 for sd in each):
        raise RobotFileError(
            f"identified deviations are {each!r:.80}, must be numbers, 0 or more"
        )
    rows = np.diag(np.repeat(each, [joints, joints, _AXES, _AXES])).tolist()
    left = {name: facts[name] for name in facts if name not in _OF_BEFORE}
    return {**left, "unknown": rows}
