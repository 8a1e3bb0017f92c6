"""Files of reference motions: npz, CSV, mjlab's npz, Open Duck's polynomials."""

import json
import pickle
import re
from collections.abc import Callable, Sequence
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gaitchain.errors import CommandError, file_errors
from gaitchain.gait.file_kind import INDEX_HEADS, kind_of
from gaitchain.messages import Array
from gaitchain.rl.cycle import best_degree, fit_polynomials, mean_cycle, mean_period
from gaitchain.rl.frames import Motion
from gaitchain.rl.motions import Plan
from gaitchain.robot.whole_file import replace_file

_OPEN_DUCK_HZ = 50  # its control rate, at which its reader counts the frames
_INDEX = "index.csv"
_NUMBERED = re.compile(r"motion_([0-9]{3}|[1-9][0-9]{3,})")


def write_npz(plan: Plan, motions: Sequence[Motion], to: Path) -> list[Path]:
    """Write one file with all motions, (C, F, ...) each, named as in `Motion`."""
    fields = [name for name in vars(motions[0]) if name != "fell"]
    arrays = {name: np.stack([getattr(m, name) for m in motions]) for name in fields}
    arrays["command"] = np.array([asked.command.motion for asked in plan.commands])
    arrays |= _names(plan)
    arrays["fps"] = np.array([float(plan.rate_hz)])
    return [_save(to, arrays)]


def write_csv(plan: Plan, motions: Sequence[Motion], to: Path) -> list[Path]:
    """Write a table for each command, with units in its first line, and index.csv."""
    joints, _ = plan.names
    heads = ["time [s]", "phase [1]"]
    heads += [f"base_{axis} [m]" for axis in "xyz"]
    heads += [f"base_q{axis} [1]" for axis in "wxyz"]
    heads += [f"{joint} [rad]" for joint in joints]
    heads += [f"base_v{axis} [m/s]" for axis in "xyz"]
    heads += [f"base_w{axis} [rad/s]" for axis in "xyz"]
    heads += [f"{joint} [rad/s]" for joint in joints]
    heads += ["left_contact [1]", "right_contact [1]"]
    heads += [f"{joint}_target [rad]" for joint in joints]
    *paths, index = _in_folder(plan, to, ".csv")
    _remove_earlier(index, ".csv")
    written = []
    for path, m in zip(paths, motions, strict=True):
        columns = m.time, m.phase, m.qpos, m.qvel, m.contact, m.target
        table = np.column_stack(columns)
        data = BytesIO()
        np.savetxt(data, table, "%.9g", ",", header=",".join(heads), comments="")
        written.append(_write(path, data.getvalue()))
    return [*written, _write_index(plan, written, index)]


def write_mjlab(plan: Plan, motions: Sequence[Motion], to: Path) -> list[Path]:
    """Write an npz for each command, as mjlab's `MotionLoader` reads, and index.csv.

    It finds bodies and joints by number: mjlab's robot has to have the same ones in the
    same order, as that of the plan's own file has.
    """
    *paths, index = _in_folder(plan, to, ".npz")
    _remove_earlier(index, ".npz")
    written = []
    for path, m in zip(paths, motions, strict=True):
        arrays = {
            "fps": np.array([float(plan.rate_hz)]),
            "joint_pos": m.qpos[:, 7:],
            "joint_vel": m.qvel[:, 6:],
            "body_pos_w": m.body_position,
            "body_quat_w": m.body_quaternion,
            "body_lin_vel_w": m.body_velocity,
            "body_ang_vel_w": m.body_rate,
        }
        single: dict[str, Any] = {
            name: value.astype(np.float32) for name, value in arrays.items()
        }
        written.append(_save(path, single | _names(plan)))
    return [*written, _write_index(plan, written, index)]


def write_open_duck(plan: Plan, motions: Sequence[Motion], to: Path) -> list[Path]:
    """Write polynomials as Open Duck Playground's `PolyReferenceMotion` reads them.

    Keys are "vx_vy_yaw" of the grid, which has to be complete: corners outside the
    library's range hold the motion scaled into it. Readers know one time of a cycle,
    the mean that was walked, rounded to whole frames of 20 ms. A second file, .json,
    has the same numbers and, by the same keys, what was walked.

    Raises:
        CommandError: a motion holds no whole cycle, or a file cannot be written.
    """
    true_s = mean_period(motions, plan.cycle_s, _cycle_frames(plan.cycle_s))
    frames = _cycle_frames(true_s)
    cycles = [mean_cycle(motion, plan.cycle_s, frames) for motion in motions]
    degree, error = best_degree(cycles)
    keys = ["_".join(f"{v:.3f}" for v in a.wanted.motion) for a in plan.commands]
    found = {
        key: _polynomials(cycle.rows, degree, frames)
        for key, cycle in zip(keys, cycles, strict=True)
    }
    walked = (asked.command.motion for asked in plan.commands)
    polynomials, beside = _with_json(plan, to)
    _write(polynomials, pickle.dumps(found))
    about = {
        "joints": plan.names[0],
        "true_period_s": true_s,
        "degree": degree,
        "joint_error_rad": error,
        "walked": dict(zip(keys, walked, strict=True)),
        "motions": found,
    }
    return [polynomials, _write(beside, json.dumps(about).encode())]


def _cycle_frames(cycle_s: float) -> int:
    return round(cycle_s * _OPEN_DUCK_HZ)


def _polynomials(rows: Array, degree: int, frames: int) -> dict[str, Any]:
    coefficients = fit_polynomials(rows, degree)
    joints = (rows.shape[1] - 8) // 2
    period_s = frames / _OPEN_DUCK_HZ
    if int(period_s * _OPEN_DUCK_HZ) < frames:  # as readers round it
        period_s = float(np.nextafter(period_s, np.inf))
    return {
        "coefficients": {
            f"dim_{number}": row.tolist() for number, row in enumerate(coefficients)
        },
        "period": period_s,
        "fps": _OPEN_DUCK_HZ,
        "frame_offsets": {
            "joints_pos": 0,
            "joints_vel": joints,
            "foot_contacts": 2 * joints,
            "world_linear_vel": 2 * joints + 2,
            "world_angular_vel": 2 * joints + 5,
        },
        "start_offset": 0,
        "nb_steps_in_period": frames,
        "startend_double_support_ratio": 0.0,
    }


def _names(plan: Plan) -> dict[str, Array]:
    joints, bodies = plan.names
    return {"joint_names": np.array(joints), "body_names": np.array(bodies)}


def _save(path: Path, arrays: dict[str, Array]) -> Path:
    data = BytesIO()
    np.savez_compressed(data, allow_pickle=False, **arrays)
    return _write(path, data.getvalue())


def _write(path: Path, data: bytes) -> Path:
    """Write a file as a whole: readers would take a part of one for all of it."""
    with file_errors(path, "written", CommandError):
        replace_file(path, data)
    return path


def _remove_earlier(index: Path, suffix: str) -> None:
    """Remove an earlier export's motions, which readers would mix with the new ones.

    A folder without the index of an export is somebody else's, and stays as it is.
    """
    ours = index.is_file() and kind_of(index) == "the index of motions"
    for path in index.parent.glob(f"motion_*{suffix}") if ours else ():
        if _NUMBERED.fullmatch(path.stem) and path.is_file():
            with file_errors(path, "removed", CommandError):
                path.unlink()


def _write_index(plan: Plan, written: Sequence[Path], index: Path) -> Path:
    """Write which file has which command."""
    lines = [INDEX_HEADS]
    for file, asked in zip(written, plan.commands, strict=True):
        lines.append(",".join([file.name, *(f"{v:.6f}" for v in asked.command.motion)]))
    return _write(index, "\n".join([*lines, ""]).encode())


def _alone(plan: Plan, to: Path) -> list[Path]:
    return [to]


def _with_json(plan: Plan, to: Path) -> list[Path]:
    return [to, to.with_suffix(".json")]


def _in_folder(plan: Plan, to: Path, suffix: str) -> list[Path]:
    """Return a file for each command, and the index."""
    numbers = range(len(plan.commands))
    return [*(to / f"motion_{number:03d}{suffix}" for number in numbers), to / _INDEX]


def _one_cycle(plan: Plan) -> float:
    return plan.cycle_s


def _all_phases(plan: Plan) -> float:
    """Return the length with which the last phase of a cycle has its frame [s]."""
    last = 1.0 - 1.0 / _cycle_frames(plan.cycle_s)
    return max(plan.length_to(last * plan.cycle_s), plan.cycle_s)


class Format(NamedTuple):
    """How motions are written."""

    write: Callable[[Plan, Sequence[Motion], Path], list[Path]]
    """Writes all motions, and returns the files."""
    files: Callable[[Plan, Path], list[Path]]
    """Returns the files that it would write; of a folder the index is the last one."""
    suffix: str = ""
    """Of its file; empty for a folder."""
    least: Callable[[Plan], float] = _one_cycle
    """Returns the least length of a plan's motions [s]."""


FORMATS = {
    "npz": Format(write_npz, _alone, ".npz"),
    "csv": Format(write_csv, partial(_in_folder, suffix=".csv")),
    "mjlab": Format(write_mjlab, partial(_in_folder, suffix=".npz")),
    "open-duck": Format(write_open_duck, _with_json, ".pkl", _all_phases),
}
"""Formats by name."""
