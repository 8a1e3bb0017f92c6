"""The log of an exercise: what was sent, and what the sensors showed. Ours.

One safetensors file; the same motions on the same simulated robot give the same bytes.
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load, save

from gaitchain.errors import LogError, file_errors
from gaitchain.gait.file_kind import other_kind
from gaitchain.gait.whole_file import replace_file
from gaitchain.live.exercise import Motion, Support
from gaitchain.messages import Array
from gaitchain.walker.sensor_check import ABSURD

_KEY, _KIND, _SCHEMA = "gaitchain", "exercise", 1
_COLUMNS = (
    *("target", "joint_position", "angular_velocity", "acceleration"),
    "time_s",
)
_LATE = 3.0  # periods by which rows may be late; beyond, `live.clock` leaves some out
_MALFORMED = (
    *(SafetensorError, KeyError, TypeError, ValueError),
    *(OverflowError, RecursionError),
)
_LEAST_S = 2.0
_MOST_BYTES = 64_000_000  # a minute at 1 kHz has 15


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
        size = path.stat().st_size
        if size > _MOST_BYTES:
            raise LogError(
                f"{path}: {size / 1e6:.0f} MB; a log of an exercise has at most "
                f"{_MOST_BYTES / 1e6:.0f}"
            )
        data = path.read_bytes()
    try:
        size = int.from_bytes(data[:8], "little")
        header = json.loads(json.loads(data[8 : 8 + size])["__metadata__"][_KEY])
        if other := other_kind(header, "the log of an exercise"):
            raise ValueError(other)
        if (header["kind"], header["schema"]) != (_KIND, _SCHEMA):
            raise ValueError("of another kind")
        return _checked(header, load(data))
    except _MALFORMED as error:
        raise LogError(
            f"{path}: not a log that `gaitchain calibrate --exercise` wrote ({error})"
        ) from None


def _checked(header: dict[str, Any], arrays: dict[str, Any]) -> ExerciseLog:
    names, period_s = tuple(map(str, header["joint_names"])), float(header["period_s"])
    if not header["supports"] or not 0.001 <= period_s <= 0.1:
        raise ValueError("no motion, or no control period")
    parts = []
    for i, support in enumerate(header["supports"]):
        of = f"_{i}"
        own = {n.removesuffix(of): a for n, a in arrays.items() if n.endswith(of)}
        parts.append(_part_of(support, own, len(names), period_s))
    robot, fingerprint = str(header["robot"]), str(header["fingerprint"])
    return ExerciseLog(robot, fingerprint, names, period_s, tuple(parts))


def _part_of(
    support: Any, own: dict[str, Any], joints: int, period_s: float
) -> MotionLog:
    if support not in get_args(Support):
        raise ValueError(f"support {support!r}")
    rows = len(own["target"])
    # Logs of before have no times: their rows are taken for those of every period.
    own = {"time_s": period_s * np.arange(rows), **own}
    widths = {"target": (joints,), "joint_position": (joints,), "time_s": ()}
    columns = {name: own[name] for name in _COLUMNS}
    for name, column in columns.items():
        shape = rows, *widths.get(name, (3,))
        if column.shape != shape or column.dtype != np.float64:
            raise ValueError(f"{name} has shape {column.shape}")
    target = columns.pop("target")
    if rows * period_s < _LEAST_S or not np.isfinite(target).all():
        raise ValueError("a motion is too short, or a target no number")
    if not np.isfinite(columns["time_s"]).all():
        raise ValueError("a time is no number")
    for name, column in {"target": target, **columns}.items():
        most = np.abs(column[np.isfinite(column)]).max(initial=0.0)
        if name != "time_s" and most > ABSURD:
            raise ValueError(f"{name} has a value of {most:.3g}, at most {ABSURD:g}")
    return MotionLog(Motion(support, target), Measured(**columns))
