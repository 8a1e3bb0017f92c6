"""What a proof's report says of the robot: its file, and what its log showed. Ours."""

import hashlib
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from gaitchain.discover.loaded_robot import load_robot, robot_file
from gaitchain.errors import GaitchainError
from gaitchain.figures.page import add, table
from gaitchain.gait.library import GaitLibrary
from gaitchain.messages import Array
from gaitchain.robot.identified import Identified
from gaitchain.robot.robot import Robot

_FROM_FILE = "of its file; no real robot was measured for them"
_FROM_LOG = "of its file, but for what was identified of one real robot"
_NOT_HERE = "not at hand, or not readable, when this was written"
_OTHER = "not given: the file of that name differs from what the library was built from"
_ONE_ROBOT = (
    "The robot is not that of its file but one robot as its own log showed it "
    "(`gaitchain identify`). Another one of the same make differs from it, and nothing "
    "is shown of that."
)
_LEFT = (
    "What the log left unknown of these numbers, as standard deviations; each walk "
    "of the proof draws its own errors, off together as the log ties them. One of 0 is "
    "of a number that was taken for exact:"
)
_FILES = (
    "Not estimated from the log, and as in the file: masses and inertias of the legs, "
    "lengths and soles, limits of torque and speed."
)
_JOINT_HEADS = (
    "joint",
    "servo gain, times the file's",
    "damping beyond it, times",
    "encoder shows more by",
    "play of the gears",
    "dry friction, part of the torque limit",
)


def robot_origin(robot: Robot) -> str:
    """Say where a robot's numbers are from."""
    said = _FROM_FILE if robot.identified is None else _FROM_LOG
    part = robot.servo_gain
    return said if part == 1.0 else f"{said}; servo gains times {part:g}"


def file_origin(library: GaitLibrary) -> tuple[str, str]:
    """Return name and SHA-256 of the file that a library's robot is from.

    Whatever else has that name now is not attested: what it gives has to be the robot.
    """
    config = library.config
    name = Path(config.robot).name
    try:
        found, file = load_robot(config.robot, config.profile), robot_file(config.robot)
        name, digest = file.name, hashlib.sha256(file.read_bytes()).hexdigest()
    except (GaitchainError, OSError):
        return name, _NOT_HERE
    same = found.fingerprint == library.robot.in_file.fingerprint
    return name, digest if same else _OTHER


def robot_section(body: Any, robot: Robot) -> None:
    """Append what was identified, and how well it is known; nothing if nothing was."""
    found = robot.identified
    if found is None:
        return
    add(body, "h2", "What was identified of this robot")
    add(body, "p", _ONE_ROBOT)
    table(body, _JOINT_HEADS, _joint_rows(robot.legs.joint_names, found))
    table(body, (), _rows(found))
    add(body, "p", _LEFT)
    table(body, (), found.describe_unknown())
    add(body, "p", _FILES)


def _joint_rows(names: tuple[str, ...], found: Identified) -> Iterator[tuple[str, ...]]:
    for j, name in enumerate(names):
        yield (
            name,
            f"{found.gain[j]:.3f}",
            f"{found.damping[j]:.3f}",
            _deg(found.offset[j]),
            f"{found.backlash_deg[j]:.2f} deg",
            f"{found.dry_friction[j]:.3f}",
        )


def _rows(found: Identified) -> list[tuple[str, str]]:
    """Return what is not of one joint alone, as (name, value)."""
    took_s = found.turnaround_s
    bus = [] if took_s is None else [("of it, the bus's", f"{1000.0 * took_s:.1f} ms")]
    return [
        ("delay of the targets", f"{1000.0 * found.delay_s:.1f} ms"),
        *bus,
        ("more dry friction at rest, part of that", f"{found.stiction:.3f}"),
        ("torque lost at the speed limit, part of it", f"{found.viscous_friction:.3f}"),
        ("mass and inertia of the trunk, times", f"{found.trunk_mass:.3f}"),
        ("CoM of the trunk ahead, to the left, up", _all(1000.0 * found.com, "mm")),
        ("IMU turned about the same axes", _all(found.tilt * 180.0 / math.pi, "deg")),
        ("IMU late by", f"{1000.0 * found.imu_delay_s:.1f} ms"),
    ]


def _all(values: Array, unit: str) -> str:
    return f"{', '.join(f'{value:.2f}' for value in values.tolist())} {unit}"


def _deg(angle: float) -> str:
    return f"{math.degrees(angle):.2f} deg"
