"""Serialise a robot for library and record files: a header and arrays."""

import math
from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gaitchain.errors import names_apart, short_name
from gaitchain.robot.box_robot import box_robot
from gaitchain.robot.identified import identified_from
from gaitchain.robot.leg_model import legs_from
from gaitchain.robot.reduced_biped import ReducedBiped, checked_name, quantity_limits
from gaitchain.robot.robot import Robot

_ABOVE_0 = "femur_length", "crus_length", "servo_stiffness"
PREFIX = "anatomy_"
"""Prefix of the array names of a full robot."""


def robot_facts(robot: Robot) -> dict[str, Any]:
    """Return the header of a robot; that of a full robot has a key "anatomy"."""
    if robot.of_file is not None:
        own = {**robot_facts(robot.of_file), "servo_gain": robot.servo_gain}
        found = robot.identified
        return own if found is None else {**own, "identified": found.facts()}
    numbers = robot.reduced.numbers()
    facts: dict[str, Any] = {"name": robot.name, "numbers": numbers}
    return facts if robot.boxes else {**facts, "anatomy": robot.legs.facts()}


def robot_arrays(robot: Robot) -> dict[str, NDArray[Any]]:
    """Return the arrays of a full robot; empty for a box robot."""
    if robot.in_file.boxes:
        return {}
    own = robot.in_file.legs.arrays()
    return {f"{PREFIX}{name}": np.ascontiguousarray(a) for name, a in own.items()}


def robot_from(facts: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> Robot:
    """Build a robot from its header and arrays.

    Raises:
        ValueError: a number is missing, unknown or not finite.
        GaitchainError: the arrays do not fit together.
    """
    robot, found = _of_file(facts, arrays), facts.get("identified")
    robot = robot.with_servo_gain(_servo_gain(facts.get("servo_gain", 1.0)))
    if found is None:
        return robot
    return robot.as_identified(identified_from(found, len(robot.legs.joint_names)))


def _servo_gain(given: object) -> float:
    """Return a part of the file's servo gains.

    Raises:
        ValueError: it cannot be one.
    """
    if isinstance(given, float) and 0.0 < given < np.inf:
        return given
    raise ValueError(
        f"servo gain of the robot is {given!r:.80}, must be a float above 0, finite"
    )


def _check_numbers(
    numbers: Mapping[str, float], given: Mapping[str, Any], *, boxes: bool
) -> None:
    """Refuse what no robot's file could have said.

    A box robot's file has limits. What others reduce to may be of any size.

    Raises:
        ValueError: a number is outside its limits.
    """
    for name, (low, high) in quantity_limits().items():
        number, shown = numbers[name], f"{name} of the robot is {given[name]!r:.80}"
        if not math.isfinite(number):
            raise ValueError(f"{shown}, must be finite")
        if name in _ABOVE_0 and not number > 0.0:
            raise ValueError(f"{shown}, must be above 0")
        if boxes and not low <= number <= high:
            raise ValueError(f"{shown}, must be {low:.6g} to {high:.6g}, in SI units")
        if low > 0.0 > number:
            raise ValueError(f"{shown}, must be 0 or more")


def _as_float(name: str, given: Any) -> float:
    """Return a number of JSON; one with too many digits is infinite.

    Raises:
        ValueError: it is none.
    """
    try:
        return float(given)
    except OverflowError:
        return math.inf
    except (TypeError, ValueError):
        raise ValueError(
            f"{short_name(name)} of the robot is {given!r:.80}, must be a number"
        ) from None


def _of_file(facts: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> Robot:
    wanted = {f.name for f in fields(ReducedBiped) if f.metadata}
    given = dict(facts["numbers"])
    numbers: dict[str, Any] = {name: _as_float(name, n) for name, n in given.items()}
    if set(numbers) != wanted:
        raise ValueError(f"numbers of the robot {names_apart(numbers, wanted)}")
    boxes = facts.get("anatomy") is None
    _check_numbers(numbers, given, boxes=boxes)
    name = checked_name(facts["name"])
    reduced = ReducedBiped(name=name, sources={}, **numbers)
    if boxes:
        return box_robot(reduced)
    own = {
        name.removeprefix(PREFIX): array
        for name, array in arrays.items()
        if name.startswith(PREFIX)
    }
    return Robot(reduced, legs_from(facts["anatomy"], own), boxes=False)
