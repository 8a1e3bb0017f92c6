"""Read and write the TOML file of a calibration, with a check of every value."""

import difflib
import json
import re
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from gaitchain.backends.servos.calibration import (
    Calibration,
    ImuCalibration,
    JointCalibration,
    check_calibration,
    check_robot,
)
from gaitchain.errors import CalibrationError, file_errors
from gaitchain.robot.robot import Robot
from gaitchain.robot.whole_file import read_file, replace_file

_MOST_BYTES = 1_000_000
_T = TypeVar("_T", bound=msgspec.Struct)
_UNITS = {
    "baud": "bit/s",
    "offset": "deg, servo angle at joint angle 0",
    "lower": "deg",
    "upper": "deg",
    "pwm_limit": "%",
    "gyro_scale": "rad/s",
    "accelerometer_scale": "m/s^2",
}


def load_calibration(path: Path, robot: Robot | None = None) -> Calibration:
    """Read a calibration and check every value.

    Args:
        path: the file that `gaitchain calibrate` wrote.
        robot: robot of the gait library that the calibration must be for, if given.

    Raises:
        CalibrationError: the file cannot be read, a value is impossible, or it is for
            another robot.
    """
    try:
        text = read_file(path, _MOST_BYTES).decode()
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else "not a text file"
        raise CalibrationError(
            f"{path}: {reason}; `gaitchain calibrate` writes one"
        ) from None
    calibration = parse_calibration(text, str(path))
    if robot is not None:
        check_robot(calibration, robot, str(path))
    return calibration


def parse_calibration(text: str, origin: str = "calibration") -> Calibration:
    """Parse the text of a calibration file and check every value.

    Args:
        text: the content of the file.
        origin: name of the file in messages.

    Raises:
        CalibrationError: the text is not TOML, or a value is impossible.
    """
    try:
        table: dict[str, Any] = tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # also numbers of 5000 digits
        raise CalibrationError(f"{origin}: not a TOML file: {error}") from None
    joints = table.get("joints")
    if not isinstance(joints, dict) or not joints:
        raise CalibrationError(
            f"{origin}: joints: give a table [joints.NAME] for each joint, with id, "
            "sign, offset, lower and upper"
        )
    # One by one, so that a message can name the joint.
    table["joints"] = {
        name: _converted(value, JointCalibration, origin, f"joints.{name}")
        for name, value in joints.items()
    }
    if "imu" in table:
        table["imu"] = _converted(table["imu"], ImuCalibration, origin, "imu")
    calibration = _converted(table, Calibration, origin)
    check_calibration(calibration, origin)
    return calibration


def save_calibration(calibration: Calibration, path: Path) -> None:
    """Write a calibration; an existing file is replaced only by a complete one.

    Raises:
        CalibrationError: the file cannot be written.
    """
    with file_errors(path, "written", CalibrationError):
        replace_file(path, calibration_text(calibration).encode())


def calibration_text(calibration: Calibration) -> str:
    """Return the text of the file, which parses to the same calibration."""
    return "\n".join(_lines(calibration)) + "\n"


def _lines(calibration: Calibration) -> Iterator[str]:
    yield f"# Servos of {json.dumps(calibration.robot)}, by `gaitchain calibrate`."
    plain = msgspec.to_builtins(calibration)
    yield from _pairs({k: plain[k] for k in ("robot", "fingerprint", "make", "baud")})
    for name, joint in plain["joints"].items():
        bare = re.fullmatch(r"[A-Za-z0-9_-]+", name)
        yield f"\n[joints.{name if bare else _quoted(name)}]"
        yield from _pairs(joint)
    if calibration.imu is not None:
        yield "\n[imu]"
        yield from _pairs(plain["imu"])


def _pairs(values: dict[str, Any]) -> Iterator[str]:
    for key, value in values.items():
        unit = f"  # {_UNITS[key]}" if key in _UNITS else ""
        yield f"{key} = {_toml(value)}{unit}"


def _toml(value: Any) -> str:
    if isinstance(value, str):
        return _quoted(value)
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_toml, value))}]"
    return repr(value)


def _quoted(text: str) -> str:
    # A JSON string is a TOML string, except for DEL, which TOML requires escaped.
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _converted(value: Any, kind: type[_T], origin: str, where: str = "") -> _T:
    """Convert one table; errors name file, key, value and the allowed values."""
    try:
        return msgspec.convert(value, kind)
    except msgspec.ValidationError as error:
        what, _, path = str(error).partition(" - at `$")
        keys = re.findall(r"[a-z_]+", path)[:1]
        found = value.get(keys[0]) if keys else value
        shown = f" = {found!r:.60}" if keys or not isinstance(found, dict) else ""
        key = ".".join(part for part in (where, *keys) if part)
        raise CalibrationError(
            f"{origin}: {key}{': ' if key and not shown else ''}{shown}"
            f"{': ' if shown else ''}{_in_words(what, kind, keys)}"
        ) from None


def _in_words(what: str, kind: type[msgspec.Struct], keys: Sequence[str]) -> str:
    """Return msgspec's error with the allowed values."""
    known = {field.name: str(field.type) for field in msgspec.structs.fields(kind)}
    unknown = re.search(r"unknown field `(.*)`", what)
    if unknown:
        near = difflib.get_close_matches(unknown[1], known, n=1)
        hint = f"did you mean {near[0]}?" if near else f"known: {', '.join(known)}"
        return f"unknown key {unknown[1]}; {hint}"
    words = what.replace("`", "").replace("Object missing required field", "missing:")
    wanted = known.get(keys[0], "") if keys else ""
    limits = re.search(r"g[et]=([-\d.]+), le=([-\d.]+)", wanted)
    choices = re.search(r"Literal\[(.*?)\]", wanted)
    if limits:
        words += f"; allowed: {limits[1]} to {limits[2]}"
    elif choices:
        words += f"; allowed: {choices[1]}"
    return words[:1].lower() + words[1:]
