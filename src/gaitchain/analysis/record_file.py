"""The file of a walk's record: safetensors with a header; loading checks everything."""

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, astuple
from itertools import pairwise
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import load, save

from gaitchain.analysis.column_check import check_sizes
from gaitchain.analysis.record import SUPPORTS, Limit, WalkRecord, joint_names
from gaitchain.errors import (
    MOST_SAID,
    GaitchainError,
    RecordError,
    file_errors,
    names_apart,
    short_name,
)
from gaitchain.gait.file_kind import other_kind
from gaitchain.gait.motion import Timing
from gaitchain.messages import Command, PanelMessage
from gaitchain.robot.robot import Robot
from gaitchain.robot.storage import PREFIX, robot_arrays, robot_facts, robot_from
from gaitchain.robot.whole_file import read_file, replace_file
from gaitchain.walker.generator import Decision

SCHEMA = 1
RECORD = "walk.rec"
"""Name of the record's file in the folder of a walk."""
_MOST_BYTES = 1_000_000_000  # an hour at 100 Hz has a third
_KEY = "gaitchain"  # the only metadata entry, as in a library's file
_UNHEARD_S = 1.0  # from the last row to the fall: a period, more where rows were lost
_MOST = 1e12  # in SI units; in MuJoCo speeds end at 1e10, whatever diverges
_JOINTS, _BASE = -1, 7  # placeholder for 2 n joints; positions of the free joint
# Shape of each column in the file, without its first dimension N.
_COLUMNS: Mapping[str, tuple[int, ...]] = {
    "time_s": (),
    "target": (_JOINTS,),
    "joint_position": (_JOINTS,),
    "joint_velocity": (_JOINTS,),
    "torque": (_JOINTS,),
    "qpos": (_BASE + _JOINTS,),
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


class _Header(msgspec.Struct, frozen=True):
    """Header of the file: all fields of a record that are not columns."""

    step_ticks: tuple[int, ...]
    fell_at_s: float | None
    events: tuple[tuple[float, str], ...]
    decisions: tuple[tuple[float, Decision, PanelMessage], ...]
    robot: Any
    timing: tuple[float, float, float] | None
    limits: tuple[Limit, Limit]
    # Files of older versions do not have these.
    commands: tuple[tuple[float, ...], ...] = ()
    gait: str = ""
    notes: tuple[tuple[float, str], ...] = ()


def save_record(record: WalkRecord, path: Path) -> int:
    """Write a record as one safetensors file; the same record gives the same bytes.

    Args:
        record: the walk.
        path: the file, such as walk.rec.

    Returns:
        Size of the file [bytes].

    Raises:
        RecordError: the file cannot be written.
    """
    arrays = robot_arrays(record.robot) if record.robot else {}
    arrays |= {n: np.ascontiguousarray(getattr(record, n)) for n in _COLUMNS}
    codes = [SUPPORTS.index(str(name)) for name in record.support]
    arrays["support"] = np.array(codes, dtype=np.uint8)
    data = bytes(save(arrays, {_KEY: json.dumps(_header(record), sort_keys=True)}))
    with file_errors(path, "written", RecordError):
        path.parent.mkdir(parents=True, exist_ok=True)
        replace_file(path, data)
    return len(data)


def load_record(path: Path) -> WalkRecord:
    """Read a record and check it.

    Args:
        path: the file.

    Returns:
        The record.

    Raises:
        RecordError: the file is missing, truncated, damaged, not a record, or of
            another schema.
    """
    with file_errors(path, "read", RecordError):
        data = read_file(path, _MOST_BYTES)
    arrays, header = _unpack(data, str(path))
    if header.get("schema") != SCHEMA:
        raise RecordError(
            f"{path}: record schema {header.get('schema')!r:.40}, this version reads "
            f"{SCHEMA}; walk again with `gaitchain walk`"
        )
    try:
        columns = {n: a for n, a in arrays.items() if not n.startswith(PREFIX)}
        facts = msgspec.convert(header, _Header)
        robot = facts.robot and robot_from(facts.robot, arrays)
        _check(columns, robot)
        _check_facts(facts, columns["time_s"], len(joint_names(robot)))
        return _assemble(columns, facts, robot)
    except (
        ArithmeticError,
        AttributeError,
        LookupError,
        TypeError,
        ValueError,
        GaitchainError,
        msgspec.ValidationError,
    ) as error:
        why = short_name(str(error), MOST_SAID)
        raise RecordError(f"{path}: inconsistent: {why}") from None


def _header(record: WalkRecord) -> dict[str, Any]:
    robot, timing = record.robot, record.timing
    return {
        "schema": SCHEMA,
        "step_ticks": [int(tick) for tick in record.step_ticks],
        "fell_at_s": record.fell_at_s,
        "events": record.events,
        **({"notes": record.notes} if record.notes else {}),
        "commands": [(t, *astuple(command)) for t, command in record.commands],
        "decisions": [(t, asdict(d), asdict(p)) for t, d, p in record.decisions],
        "robot": robot and robot_facts(robot),
        "gait": record.gait,
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
    if other := other_kind(facts, "the record of a walk"):
        raise RecordError(
            f"{origin}: {other}, not the record of a walk; give a walk.rec that "
            "`gaitchain walk` wrote"
        )
    return arrays, facts


def _check(arrays: Mapping[str, NDArray[Any]], robot: Robot | None) -> None:
    """Raise ValueError for missing or unknown columns, wrong types, shapes or sizes."""
    joints = len(joint_names(robot))
    counts = {_JOINTS: joints, _BASE + _JOINTS: _BASE + joints}
    if set(arrays) != set(_COLUMNS):
        raise ValueError(f"columns {names_apart(arrays, _COLUMNS)}")
    rows = len(arrays["qpos"])
    for name, known in _COLUMNS.items():
        shape = tuple(counts.get(size, size) for size in known)
        array, kind = arrays[name], _KINDS.get(name, "f")
        if array.shape != (rows, *shape) or array.dtype.kind != kind:
            raise ValueError(
                f"{name} is {array.dtype} {array.shape}, needs {(rows, *shape)}"
            )
        if kind == "f":
            check_sizes(name, array, _MOST)
    _check_times(arrays["time_s"])


def _check_times(time_s: NDArray[Any]) -> None:
    """Raise ValueError for times that are no numbers or do not rise."""
    if not len(time_s) or np.isnan(time_s).any():
        raise ValueError("it has no rows, or a time is no number")
    stays = np.flatnonzero(np.diff(time_s) <= 0.0)
    if len(stays):
        row = stays[0] + 1
        raise ValueError(
            f"time_s is {time_s[row]:g} in row {row}, needs more than "
            f"{time_s[row - 1]:g}, that of the row before"
        )


def _check_facts(facts: _Header, time_s: NDArray[Any], joints: int) -> None:
    """Raise ValueError for numbers of the header that do not fit the columns."""
    for name, limit in zip(("torque", "speed"), facts.limits, strict=True):
        _check_limit(f"{name} limit", limit, joints)
    for name, moments in (
        ("an event", facts.events),
        ("a note", facts.notes),
        ("a decision", facts.decisions),
        ("a command", facts.commands),
    ):
        for at_s in (moment[0] for moment in moments):
            if not math.isfinite(at_s):
                raise ValueError(f"{name} is at {at_s} s, needs a finite time")
    _check_fall(facts.fell_at_s, float(time_s[-1]))
    _check_ticks(facts.step_ticks, len(time_s), facts.fell_at_s is not None)


def _check_limit(name: str, limit: Limit, joints: int) -> None:
    each = limit if isinstance(limit, tuple) else (limit,)
    if isinstance(limit, tuple) and len(each) != joints:
        raise ValueError(f"{name} has {len(each)} numbers, needs one or {joints}")
    for value in each:
        if value is not None and not value >= 0.0:
            raise ValueError(f"a {name} is {value}, needs 0 or more, or infinity")


def _check_fall(fell_at_s: float | None, last_s: float) -> None:
    """Check that a record ends at its fall."""
    latest_s = last_s + _UNHEARD_S
    if fell_at_s is not None and not last_s <= fell_at_s <= latest_s:
        raise ValueError(
            f"the fall is at {fell_at_s} s, needs {last_s:g} s, that of the last row, "
            f"to {latest_s:g} s"
        )


def _check_ticks(ticks: tuple[int, ...], rows: int, fell: bool) -> None:
    """Check rows of steps; those planned in advance go on beyond a fall."""
    for before, tick in pairwise((0, *ticks)):
        if tick < before:
            raise ValueError(f"a step is at row {tick}, needs {before} or more")
    if not fell and ticks and ticks[-1] > rows:
        raise ValueError(
            f"a step is at row {ticks[-1]} without a fall before it, needs {rows} or "
            "less"
        )


def _assemble(
    arrays: dict[str, NDArray[Any]], facts: _Header, robot: Robot | None
) -> WalkRecord:
    columns = {**arrays, "support": np.array(SUPPORTS)[arrays["support"]]}
    torque, speed = facts.limits
    return WalkRecord(
        **columns,
        step_ticks=facts.step_ticks,
        fell_at_s=facts.fell_at_s,
        decisions=facts.decisions,
        robot=robot,
        gait=facts.gait,
        timing=None if facts.timing is None else Timing(*facts.timing),
        torque_limit=torque,
        speed_limit=speed,
        events=facts.events,
        notes=facts.notes,
        commands=tuple((time_s, Command(*asked)) for time_s, *asked in facts.commands),
    )
