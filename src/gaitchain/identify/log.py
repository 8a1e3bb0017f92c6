"""The log of an exercise: what was sent, and what the sensors showed. Ours.

One safetensors file; the same motions on the same simulated robot give the same bytes.
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load, save

from gaitchain.analysis.column_check import check_sizes
from gaitchain.errors import MOST_SAID, LogError, file_errors, short_name
from gaitchain.gait.file_kind import other_kind
from gaitchain.live.exercise import Motion, Support
from gaitchain.messages import Array
from gaitchain.robot.whole_file import read_file, replace_file
from gaitchain.walker.sensor_check import ABSURD

_KEY, _KIND, _SCHEMA = "gaitchain", "exercise", 1
_OPTIONAL = "time_s", "turnaround_s"  # which logs of before do not have
_COLUMNS = (
    *("target", "joint_position", "angular_velocity", "acceleration"),
    *_OPTIONAL,
)
_LATE = 3.0  # periods by which rows may be late; beyond, `live.clock` leaves some out
_MALFORMED = SafetensorError, ValueError, OverflowError, RecursionError
_LEAST_S = 2.0
_MOST_TIME_S = 1e10  # since some beginning, as 1970; beyond, differences lose ms
_MOST_BYTES = 64_000_000  # a minute at 1 kHz has 15


class _Header(msgspec.Struct):
    """What a log says of itself."""

    kind: str
    schema: int
    robot: str
    fingerprint: str
    joint_names: tuple[str, ...]
    period_s: float
    supports: tuple[Support, ...]


@dataclass(frozen=True, eq=False)
class Measured:
    """What the sensors of a robot showed, one row for each control period."""

    joint_position: Array
    """(N, 2 n) before each target was sent [rad]."""
    angular_velocity: Array
    """(N, 3) in the IMU's frame [rad/s]; NaN without an IMU."""
    acceleration: Array
    """(N, 3) in the IMU's frame [m/s^2]; NaN without an IMU."""
    time_s: Array
    """(N,) when each row was measured, since some beginning [s]."""
    turnaround_s: Array
    """(N,) from the begin of a read to the last byte of its target [s]; NaN where that
    is not known, as in simulation."""


@dataclass(frozen=True, eq=False)
class MotionLog:
    """One motion, and what came of it."""

    motion: Motion
    measured: Measured


@dataclass(frozen=True, eq=False)
class ExerciseLog:
    """The log of one robot."""

    robot: str
    """Its name."""
    fingerprint: str
    """That of its file, `Robot.fingerprint`."""
    joint_names: tuple[str, ...]
    period_s: float
    parts: tuple[MotionLog, ...]

    @property
    def seconds(self) -> float:
        """Length of all motions [s]."""
        return sum(len(p.motion.targets) for p in self.parts) * self.period_s

    @property
    def turnarounds_s(self) -> Array:
        """(K,) those of all rows that are known [s]."""
        known = np.concatenate([part.measured.turnaround_s for part in self.parts])
        return np.asarray(known[np.isfinite(known)])

    @property
    def late_s(self) -> float:
        """By how much rows are late where one comes each period, at most [s]."""
        return max(
            float(np.ptp(own - self.period_s * np.arange(len(own))))
            for own in (part.measured.time_s for part in self.parts)
        )

    @property
    def uneven(self) -> str:
        """Why the rows are too late to be fitted, and what to do; empty if not."""
        late_s, most_s = self.late_s, _LATE * self.period_s
        if late_s <= most_s:
            return ""
        return (
            f"rows of the log come up to {1e3 * late_s:.0f} ms late, at most "
            f"{1e3 * most_s:g} ms can be fitted, as a replay is never held up; "
            "exercise again with nothing else on that computer (`gaitchain doctor` "
            "tests the rate of the bus)"
        )


def save_log(log: ExerciseLog, path: Path) -> None:
    """Write a log; an existing file is replaced only by a complete one.

    Raises:
        LogError: the file cannot be written.
    """
    header = {
        "kind": _KIND,
        "schema": _SCHEMA,
        "robot": log.robot,
        "fingerprint": log.fingerprint,
        "joint_names": list(log.joint_names),
        "period_s": log.period_s,
        "supports": [part.motion.support for part in log.parts],
    }
    arrays: dict[str, Array] = {}
    for i, part in enumerate(log.parts):
        columns = {"target": part.motion.targets, **vars(part.measured)}
        arrays |= {f"{n}_{i}": np.ascontiguousarray(a) for n, a in columns.items()}
    data = save(arrays, {_KEY: json.dumps(header, sort_keys=True)})
    with file_errors(path, "written", LogError):
        path.parent.mkdir(parents=True, exist_ok=True)
        replace_file(path, bytes(data))


def load_log(path: Path) -> ExerciseLog:
    """Read a log and check it.

    Raises:
        LogError: the file is missing, damaged, or no log of an exercise.
    """
    with file_errors(path, "read", LogError):
        data = read_file(path, _MOST_BYTES)
    try:
        return _checked(_header_of(data), _arrays_of(data))
    except _MALFORMED as error:
        why = short_name(str(error), MOST_SAID)
        raise LogError(
            f"{path}: not a log that `gaitchain calibrate --exercise` wrote ({why})"
        ) from None


def _header_of(data: bytes) -> _Header:
    """Return the header of a log, or raise what tells why there is none."""
    if not data:
        raise ValueError("it is empty")
    size, outer = int.from_bytes(data[:8], "little"), dict[str, Any]
    try:
        plain = msgspec.json.decode(data[8 : 8 + size], type=outer)
    except msgspec.DecodeError:
        raise ValueError("it has no header of safetensors") from None
    notes = plain.get("__metadata__")
    if not isinstance(notes, dict) or _KEY not in notes:
        raise ValueError(f"its metadata has no entry {_KEY!r}")
    header = msgspec.json.decode(notes[_KEY], type=outer)
    if other := other_kind(header, "the log of an exercise"):
        raise ValueError(other)
    found = msgspec.convert(header, _Header)
    if (found.kind, found.schema) != (_KIND, _SCHEMA):
        is_ = f"{short_name(found.kind)!r}, {found.schema}"
        wanted = f"{_KIND!r}, {_SCHEMA}"
        raise ValueError(f"its kind and schema are {is_}, must be {wanted}")
    return found


def _arrays_of(data: bytes) -> dict[str, Any]:
    try:
        return load(data)
    except KeyError as error:  # a type that NumPy does not have
        raise ValueError(f"numbers are of {error}, must be of float64") from None


def _checked(header: _Header, arrays: dict[str, Any]) -> ExerciseLog:
    names, period_s = header.joint_names, header.period_s
    if not 0.001 <= period_s <= 0.1:
        raise ValueError(f"period_s is {period_s:g}, must be 0.001 to 0.1")
    if not header.supports:
        raise ValueError("no motion: supports is empty")
    parts = []
    for i, support in enumerate(header.supports):
        of = f"_{i}"
        own = {n.removesuffix(of): a for n, a in arrays.items() if n.endswith(of)}
        parts.append(_part_of(support, own, len(names), period_s))
    robot, fingerprint = short_name(header.robot), short_name(header.fingerprint)
    return ExerciseLog(robot, fingerprint, names, period_s, tuple(parts))


def _part_of(
    support: Support, own: dict[str, Any], joints: int, period_s: float
) -> MotionLog:
    missing = [n for n in _COLUMNS if n not in own and n not in _OPTIONAL]
    if missing:
        raise ValueError(f"the motion {support!r} has no {', '.join(missing)}")
    rows = len(np.atleast_1d(own["target"]))
    # Logs of before have no times: their rows are taken for those of every period.
    even, unknown = period_s * np.arange(rows), np.full(rows, np.nan)
    own = {"time_s": even, "turnaround_s": unknown, **own}
    columns = {name: own[name] for name in _COLUMNS}
    for name, column in columns.items():
        _check_column(name, column, rows, joints)
    target = columns.pop("target")
    if rows * period_s < _LEAST_S:
        raise ValueError(
            f"the motion {support!r} has {rows * period_s:g} s, needs {_LEAST_S:g}"
        )
    for name, column in (("target", target), ("time_s", columns["time_s"])):
        if not np.isfinite(column).all():
            raise ValueError(f"{name} has a value that is no number")
    if (columns["turnaround_s"] < 0.0).any():
        raise ValueError("turnaround_s has a value below 0")
    return MotionLog(Motion(support, target), Measured(**columns))


def _check_column(name: str, column: Any, rows: int, joints: int) -> None:
    """Refuse numbers of another type or shape, or of a size that none is of."""
    if column.dtype != np.float64:
        raise ValueError(f"{name} is of {column.dtype}, must be of float64")
    widths = dict.fromkeys(("target", "joint_position"), (joints,))
    shape = (rows,) if name in _OPTIONAL else (rows, *widths.get(name, (3,)))
    if column.shape != shape:
        raise ValueError(
            f"{name} has shape {column.shape}, must be {shape}, by the {rows} rows of "
            f"target and {joints} joint_names"
        )
    check_sizes(name, column, _MOST_TIME_S if name == "time_s" else ABSURD)
