"""A walk as physics recorded it: its columns, and the file that keeps them."""

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, astuple, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import load, save

from gaitchain.biped import Biped
from gaitchain.errors import GaitchainError, RecordError
from gaitchain.generator import Decision
from gaitchain.kinematics import Array
from gaitchain.messages import Command, PanelMessage
from gaitchain.motion import Timing
from gaitchain.zmp import Support

SCHEMA = 1
RECORD = "walk.rec"
"""The record's name in the folder of a walk."""
SUPPORTS = ("stand", *(support.value for support in Support))
"""What `WalkRecord.support` may say."""
_KEY = "gaitchain"  # the one metadata entry, as in a library's file


@dataclass(frozen=True, eq=False)
class WalkRecord:
    """A walk in physics, one row per control period, N in all.

    Targets, plans and estimates are the walker's; all else is the simulator's truth.
    """

    time_s: Array
    """(N,) since the first step began [s]."""
    target: Array
    """(N, 12) joint targets [rad]."""
    joint_position: Array
    """(N, 12) [rad]."""
    joint_velocity: Array
    """(N, 12) [rad/s]."""
    torque: Array
    """(N, 12) [N m]."""
    qpos: Array
    """(N, 19) MuJoCo generalised positions: base, then joints."""
    zmp: Array
    """(N, 2) measured ZMP in the world, NaN off the ground [m]."""
    planned_zmp: Array
    """(N, 2) planned ZMP where the support foot is, in the world; or NaN [m]."""
    feet: Array
    """(N, 2, 3) left and right foot in the world: x, y, yaw [m, m, rad]."""
    soles: Array
    """(N, 2, 4, 2) corners of each sole in the world, from above [m]."""
    foot_load: Array
    """(N, 2) vertical ground force on each sole [N]."""
    foot_height: Array
    """(N, 2) lowest corner of each sole above the floor under it [m]."""
    foot_speed: Array
    """(N, 2) horizontal speed of each sole's centre [m/s]."""
    touch_down: NDArray[np.bool_]
    """(N, 2) whether each foot lands: it bears load again after 50 ms in the air."""
    tilt: Array
    """(N, 2) roll and pitch of the trunk from the vertical: right, forward [rad]."""
    estimated_tilt: Array
    """(N, 2) roll and pitch as the walker believes, NaN in open loop [rad]."""
    self_contact: NDArray[np.bool_]
    """(N,) whether a link of the left leg touches one of the right."""
    support: NDArray[np.str_]
    """(N,) planned support: "rs", "rl", "ls", "lr", or "stand"."""
    key_pose: NDArray[np.int64]
    """(N, 2) key moment (0 for kp_1) and pose that the robot is moving to."""
    step_ticks: tuple[int, ...]
    """Row at which each step began, and the row after the last."""
    fell_at_s: float | None
    decisions: tuple[tuple[float, Decision, PanelMessage], ...] = ()
    """(time [s], decision, primitive components) of each key pose, in order."""
    biped: Biped | None = None
    """The robot; None in a record made by hand."""
    timing: Timing | None = None
    """Planned times of a step; None if no walker planned it."""
    torque_limit: float | None = None
    """Of every joint in this world [N m]; None for the robot's own."""
    speed_limit: float | None = None
    """Of every joint in this world [rad/s]; None for the robot's own."""
    events: tuple[tuple[float, str], ...] = ()
    """(time [s], what) that was done to the robot from outside, such as a push."""
    commands: tuple[tuple[float, Command], ...] = ()
    """(time [s], command) whenever another one was given; the stop at the end, too."""


# Columns with their shape after N, as the file has them.
_COLUMNS: Mapping[str, tuple[int, ...]] = {
    "time_s": (),
    "target": (12,),
    "joint_position": (12,),
    "joint_velocity": (12,),
    "torque": (12,),
    "qpos": (19,),
    "zmp": (2,),
    "planned_zmp": (2,),
    "feet": (2, 3),
    "soles": (2, 4, 2),
    "foot_load": (2,),
    "foot_height": (2,),
    "foot_speed": (2,),
    "touch_down": (2,),
    "tilt": (2,),
    "estimated_tilt": (2,),
    "self_contact": (),
    "support": (),
    "key_pose": (2,),
}
_KINDS = {"touch_down": "b", "self_contact": "b", "support": "u", "key_pose": "i"}


def save_record(record: WalkRecord, path: Path) -> int:
    """Write a record as one safetensors file; the same record gives the same bytes.

    Args:
        record: the walk.
        path: where to, such as walk.rec.

    Returns:
        Size [bytes].

    Raises:
        RecordError: the file cannot be written.
    """
    arrays = {n: np.ascontiguousarray(getattr(record, n)) for n in _COLUMNS}
    codes = [SUPPORTS.index(str(name)) for name in record.support]
    arrays["support"] = np.array(codes, dtype=np.uint8)
    data = bytes(save(arrays, {_KEY: json.dumps(_header(record), sort_keys=True)}))
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
    except OSError as error:
        raise RecordError(f"{path}: cannot be written: {error.strerror}") from None
    return len(data)


def load_record(path: Path) -> WalkRecord:
    """Read a record and check that it is one.

    Args:
        path: the file.

    Returns:
        The record.

    Raises:
        RecordError: the file is missing, truncated, damaged, foreign or of another
            schema; in one line.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise RecordError(f"{path}: cannot be read: {error.strerror}") from None
    arrays, header = _unpack(data, str(path))
    if header.get("schema") != SCHEMA:
        raise RecordError(
            f"{path}: record schema {header.get('schema')!r}, this version reads "
            f"{SCHEMA}; walk again with `gaitchain walk`"
        )
    try:
        _check(arrays)
        return _assemble(arrays, header)
    except (AttributeError, IndexError, KeyError, TypeError, ValueError) as error:
        raise RecordError(f"{path}: inconsistent: {error}") from None
    except GaitchainError as error:
        raise RecordError(f"{path}: inconsistent: {error}") from None


def _header(record: WalkRecord) -> dict[str, Any]:
    biped, timing = record.biped, record.timing
    return {
        "schema": SCHEMA,
        "step_ticks": [int(tick) for tick in record.step_ticks],
        "fell_at_s": record.fell_at_s,
        "events": record.events,
        "commands": [(t, *astuple(command)) for t, command in record.commands],
        "decisions": [(t, asdict(d), asdict(p)) for t, d, p in record.decisions],
        "robot": biped and {"name": biped.name, "numbers": biped.numbers()},
        "timing": timing and [timing.step, timing.rise, timing.fall],
        "limits": [record.torque_limit, record.speed_limit],
    }


def _unpack(data: bytes, origin: str) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    try:
        length = int.from_bytes(data[:8], "little")
        header = json.loads(data[8 : 8 + length])["__metadata__"][_KEY]
        facts, arrays = json.loads(header), load(data)
    except (SafetensorError, KeyError, TypeError, ValueError, RecursionError):
        raise RecordError(
            f"{origin}: damaged, or not the record of a walk; give a walk.rec that "
            "`gaitchain walk` wrote"
        ) from None
    if not isinstance(facts, dict):
        raise RecordError(f"{origin}: damaged: its header is no table")
    return arrays, facts


def _check(arrays: Mapping[str, NDArray[Any]]) -> None:
    """Refuse columns that are missing, foreign, of another length, kind or shape."""
    if set(arrays) != set(_COLUMNS):
        raise ValueError(f"columns differ: {sorted(set(arrays) ^ set(_COLUMNS))}")
    rows = len(arrays["qpos"])
    for name, shape in _COLUMNS.items():
        array, kind = arrays[name], _KINDS.get(name, "f")
        if array.shape != (rows, *shape) or array.dtype.kind != kind:
            raise ValueError(
                f"{name} is {array.dtype} {array.shape}, needs {(rows, *shape)}"
            )
    if not rows or not np.isfinite(arrays["time_s"]).all():
        raise ValueError("it has no rows, or a time is no number")


def _assemble(arrays: dict[str, NDArray[Any]], header: dict[str, Any]) -> WalkRecord:
    robot, timing = header["robot"], header["timing"]
    torque, speed = map(_number, header["limits"])
    columns = {**arrays, "support": np.array(SUPPORTS)[arrays["support"]]}
    return WalkRecord(
        **columns,
        step_ticks=tuple(int(tick) for tick in header["step_ticks"]),
        fell_at_s=_number(header["fell_at_s"]),
        decisions=tuple(
            (float(t), _decision(d), PanelMessage(**p))
            for t, d, p in header["decisions"]
        ),
        biped=None if robot is None else _robot(robot),
        timing=None if timing is None else Timing(*timing),
        torque_limit=torque,
        speed_limit=speed,
        events=tuple((float(time_s), str(what)) for time_s, what in header["events"]),
        commands=tuple(
            (float(t), Command(*map(float, asked)))
            for t, *asked in header.get("commands", ())  # none in older records
        ),
    )


def _decision(values: dict[str, Any]) -> Decision:
    others = tuple((int(pose), float(cost)) for pose, cost in values["runners_up"])
    return Decision(**{**values, "runners_up": others})


def _number(value: Any) -> float | None:
    return None if value is None else float(value)


def _robot(values: dict[str, Any]) -> Biped:
    wanted = {f.name for f in fields(Biped) if f.metadata}
    numbers: dict[str, Any] = {n: float(x) for n, x in values["numbers"].items()}
    if set(numbers) != wanted or not all(map(math.isfinite, numbers.values())):
        raise ValueError(f"numbers of the robot: {sorted(set(numbers) ^ wanted)}")
    return Biped(name=str(values["name"]), **numbers)
