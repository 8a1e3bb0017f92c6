"""Compare two robots and describe what differs."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gaitchain.messages import Array
from gaitchain.robot.leg_model import LegModel
from gaitchain.robot.robot import Robot

# On another computer the last digits of a standing pose may differ.
_RELATIVE, _ABSOLUTE = 1e-6, 1e-9
# A robot that differs by no more is one of those that a library is trained for, whose
# gains and links are off (`World.gain_error`, `model_error`), or its file is rounded.
_PARTS = {
    **dict.fromkeys(("stiffness", "damping"), 0.1),
    **dict.fromkeys(("link_mass", "inertia", "trunk_mass", "trunk_inertia"), 0.05),
}
_LEGS = {"com": 0.005, "trunk_com": 0.005, "at": 0.001, "foot_at": 0.001}  # legs
_STAND_RAD = 0.005
_WIDER = {"torque_limit": 1.0, "speed_limit": 1.0, "upper": 1.0, "lower": -1.0}  # signs
_JOINT_ARRAYS = {
    "stiffness": "kp of {} [N m/rad]",
    "damping": "kv of {} [N m s/rad]",
    "joint_damping": "damping of the joint {} [N m s/rad]",
    "torque_limit": "torque limit of {} [N m]",
    "speed_limit": "speed limit of {} [rad/s]",
    "lower": "lower end of {} [rad]",
    "upper": "upper end of {} [rad]",
    "armature": "armature of {} [kg m^2]",
    "friction_loss": "friction of {} [N m]",
    "stand": "standing angle of {} [rad]",
}
_LINK_ARRAYS = {
    "link_mass": "mass of the link at {} [kg]",
    "com": "CoM of the link at {} [m]",
    "inertia": "inertia of the link at {} [kg m^2]",
    "at": "place of {} [m]",
    "axis": "axis of {}",
}
_ROBOT_ARRAYS = {
    "trunk_com": "CoM of the trunk [m]",
    "trunk_inertia": "inertia of the trunk [kg m^2]",
    "foot_at": "place of the ankle point [m]",
    "foot_turn": "axes of the sole",
    "base_at": "place of the hips in the base [m]",
    "base_turn": "axes of the pelvis in the base",
}


def differences(one: Robot, other: Robot) -> list[str]:
    """Describe what differs between two robots.

    Args:
        one: the first robot.
        other: the second robot.

    Returns:
        One text for each difference, with the value of `one` before that of `other`;
        empty if the robots are the same up to rounding.
    """
    if one.fingerprint == other.fingerprint:
        return []
    if one.boxes != other.boxes:
        return [f"{_kind(one)} / {_kind(other)}"]
    found = [] if one.boxes else list(_leg_differences(one.legs, other.legs))
    numbers = one.reduced.numbers(), other.reduced.numbers()
    return [*found, *_table_differences(*numbers, "{}")]


def differences_that_matter(one: Robot, other: Robot) -> list[str]:
    """Describe what differs by more than between the robots that training draws.

    Masses and inertia may differ by 5 %, gains of servos by 10 %, each CoM by 0.005 and
    each joint's place and the ankles' height over the soles by 0.001 legs; the other
    robot's limits may be wider. Of robots of boxes all matters.

    Args:
        one: the robot that a library was built for.
        other: the robot that is to walk by it.

    Returns:
        See `differences`.
    """
    found = differences(one, other)
    if not found or one.boxes or other.boxes:
        return found
    if one.legs.joint_names != other.legs.joint_names:
        return found
    return differences(one, _where_it_matters(one, other))


def _where_it_matters(one: Robot, other: Robot) -> Robot:
    """Return the other robot, with numbers of the first where it differs by little."""
    leg, legs = one.reduced.leg_length, dict[str, Any]()
    for name, own in {**one.legs.arrays(), "trunk_mass": one.legs.trunk_mass}.items():
        others = getattr(other.legs, name)
        alike = _matters_not(name, np.asarray(own), np.asarray(others), leg)
        legs[name] = np.where(alike, own, others)
    legs["trunk_mass"] = float(legs["trunk_mass"])
    own, others = one.reduced.ankle_height, other.reduced.ankle_height
    off = abs(others - own) > _LEGS["at"] * leg
    # All else of a full robot's reduced biped follows from its joints and links.
    reduced = replace(
        one.reduced,
        ankle_height=others if off else own,
        sole_length=other.reduced.sole_length,
        sole_width=other.reduced.sole_width,
        sole_offset=other.reduced.sole_offset,
    )
    return replace(other, reduced=reduced, legs=replace(other.legs, **legs))


def _matters_not(name: str, own: Array, others: Array, leg: float) -> NDArray[np.bool_]:
    """Return of which elements of a leg model's array the difference is too small."""
    if name in _WIDER:
        return np.asarray(_WIDER[name] * others >= _WIDER[name] * own)
    most = _LEGS.get(name, 0.0) * leg + (_STAND_RAD if name == "stand" else 0.0)
    size = np.abs(own)
    if own.shape[-2:] == (3, 3):  # small products of inertia beside large moments
        size = size.max(axis=(-2, -1), keepdims=True)
    return np.asarray(np.abs(others - own) <= most + _PARTS.get(name, 0.0) * size)


def _kind(robot: Robot) -> str:
    if robot.boxes:
        return "a robot of boxes"
    return f"{len(robot.legs.joint_names)} joints of a full robot"


def _leg_differences(one: LegModel, other: LegModel) -> Iterator[str]:
    names = one.joint_names
    if names != other.joint_names:
        if len(names) != len(other.joint_names):
            yield f"leg joints {len(names)} / {len(other.joint_names)}"
            return
        pairs = zip(names, other.joint_names, strict=True)
        changed = [f"{a} / {b}" for a, b in pairs if a != b]
        yield f"leg joint {changed[0]}{_more(len(changed))}"
        return
    if one.knee != other.knee:
        yield f"knee {names[one.knee]} / {names[other.knee]}"
    yield from _number_differences(
        {"trunk's mass [kg]": (one.trunk_mass, other.trunk_mass)}, "{}"
    )
    for words in (_JOINT_ARRAYS, _LINK_ARRAYS):
        for name, what in words.items():
            rows = [getattr(a, name).reshape(len(names), -1) for a in (one, other)]
            yield from _row_differences(names, rows[0], rows[1], what)
    for name, what in _ROBOT_ARRAYS.items():
        rows = [getattr(a, name).reshape(1, -1) for a in (one, other)]
        yield from _row_differences(("",), rows[0], rows[1], what)
    yield from _table_differences(one.held, other.held, "held angle of {} [rad]")
    corners = _corners(one), _corners(other)
    yield from _table_differences(*corners, "corner {} sole [m]")


def _corners(legs: LegModel) -> dict[str, float]:
    """Return the coordinates of the soles' corners by name."""
    return {
        f"{i + 1} of the {side}, {axis}": value
        for side, sole in zip(("left", "right"), legs.soles, strict=False)
        for i, corner in enumerate(sole)
        for axis, value in zip("xy", corner, strict=True)
    }


def _table_differences(
    one: Mapping[str, float], other: Mapping[str, float], what: str
) -> Iterator[str]:
    alone = [*(n for n in one if n not in other), *(n for n in other if n not in one)]
    if alone:
        yield f"{what.format(alone[0])} only in one{_more(len(alone))}"
    yield from _number_differences(
        {n: (one[n], other[n]) for n in one if n in other}, what
    )


def _number_differences(
    pairs: Mapping[str, tuple[float, float]], what: str
) -> Iterator[str]:
    for name, (own, others) in pairs.items():
        if not _same(np.array(own), np.array(others)):
            yield f"{what.format(name)} {own:.6g} / {others:.6g}"


def _row_differences(
    names: tuple[str, ...], one: Array, other: Array, what: str
) -> Iterator[str]:
    """Describe the first row that differs, and how many rows do."""
    rows = [i for i in range(len(names)) if not _same(one[i], other[i])]
    if rows:
        own, others = one[rows[0]], other[rows[0]]
        at = int(np.argmax(np.nan_to_num(np.abs(own - others))))
        amounts = f"{own[at]:.6g} / {others[at]:.6g}"
        yield f"{what.format(names[rows[0]])} {amounts}{_more(len(rows))}"


def _same(one: Array, other: Array) -> bool:
    return bool(np.allclose(one, other, rtol=_RELATIVE, atol=_ABSOLUTE))


def _more(count: int) -> str:
    return f" and {count - 1} more such" if count > 1 else ""
