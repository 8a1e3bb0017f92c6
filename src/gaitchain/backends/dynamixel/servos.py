"""Find and check the servos of a calibration, and turn their torque on and off."""

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from gaitchain.backends.dynamixel import control_table as table
from gaitchain.backends.dynamixel.angles import Counts, ServoAngles
from gaitchain.backends.dynamixel.bus import ServoBus
from gaitchain.backends.dynamixel.calibration import JointCalibration
from gaitchain.errors import BackendError
from gaitchain.messages import Array

_SHARE = 0.8  # largest part of a control period for reading
_DELAY_UNIT_S = 2e-6
_MODES = {
    **{0: "current", 1: "velocity", 4: "extended position"},
    **{5: "current-based position", 16: "PWM"},
}
_OUTSIDE_DEG = 5.0  # a joint further outside its limits is not engaged
_OFF, _ON = b"\0", b"\1"
_WHY = "does not obey; overload, heat, supply, or outside its Position Limits(52, 48)?"


@dataclass(frozen=True)
class ServoSetup:
    """Settings in a servo's control table."""

    model: table.Model
    return_delay_s: float
    temperature_limit: int
    """Above this the servo turns its torque off [deg C]."""
    lowest: int
    """Smallest accepted goal position, in counts."""
    highest: int


def survey(bus: ServoBus, joints: Mapping[str, JointCalibration]) -> list[ServoSetup]:
    """Find every servo of a calibration, and check that it can be driven.

    Args:
        bus: the servos' bus.
        joints: the calibration's joints by name.

    Returns:
        The servos' settings, in the order of the joints.

    Raises:
        BackendError: a servo does not answer, or differs from the calibration.
    """
    models = bus.scan(joint.id for joint in joints.values())
    silent = [label(name, j) for name, j in joints.items() if j.id not in models]
    if silent:
        none_answers = len(silent) == len(joints)
        everyone = " (none answers: supply, cable, baud?)" * none_answers
        raise BackendError(
            f"{bus.name}: no answer from {', '.join(silent)}{everyone}; `gaitchain "
            "calibrate` with --check shows who is there"
        )
    return [
        servo_setup(bus, joint.id, label(name, joint), models[joint.id], joint.model)
        for name, joint in joints.items()
    ]


def check_speed(bus: ServoBus, setups: Sequence[ServoSetup], period_s: float) -> None:
    """Check that all servos can be read in a control period.

    Args:
        bus: the servos' bus.
        setups: the servos' settings.
        period_s: control period [s].

    Raises:
        BackendError: the bus is too slow.
    """
    count = len(setups)
    delays_s = sum(setup.return_delay_s for setup in setups)
    needed = bus.line_s(count, table.PRESENT) + delays_s
    if needed > _SHARE * period_s:
        raise BackendError(
            f"{bus.name}: reading {count} servos takes {1e3 * needed:.1f} ms, allowed: "
            f"{_SHARE:.0%} of the period of {1e3 * period_s:g} ms; raise Baud Rate(8), "
            "or set Return Delay Time(9) to 0 with DYNAMIXEL Wizard"
        )


def label(name: str, joint: JointCalibration) -> str:
    """Return the name of a servo for messages."""
    return f"{name} (id {joint.id})"


def servo_setup(
    bus: ServoBus, number: int, name: str, found: int, wanted: str = ""
) -> ServoSetup:
    """Read a servo's settings.

    Args:
        bus: the servo's bus.
        number: id of the servo.
        name: name of the servo in messages.
        found: model number in the answer to the ping.
        wanted: expected model name; empty for any.

    Raises:
        BackendError: the servo has another model or mode, or does not answer reads.
    """
    model = table.MODELS.get(found)
    if model is None:
        raise BackendError(
            f"{bus.name}: {name} is of model {found}, no servo with the X series' "
            "table; such are xm430-w350, xl330-m288, mx-64 with protocol 2.0"
        )
    if wanted and model.name != wanted:
        raise BackendError(
            f"{bus.name}: {name} is a {model.name}, the calibration says {wanted}; "
            "check the id, or change the model in the file"
        )
    answer = bus.read_surely([number], table.SETUP).get(number)
    if answer is None:
        raise BackendError(
            f"{bus.name}: {name} answers pings but no reads; set its Status Return "
            "Level(68) to 2 with DYNAMIXEL Wizard"
        )
    mode = table.OPERATING_MODE.unsigned(answer, table.SETUP)
    _check_mode(mode, f"{bus.name}: {name}")
    return ServoSetup(
        model=model,
        return_delay_s=_DELAY_UNIT_S * table.RETURN_DELAY.unsigned(answer, table.SETUP),
        temperature_limit=table.TEMPERATURE_LIMIT.unsigned(answer, table.SETUP),
        lowest=table.LOWEST_POSITION.unsigned(answer, table.SETUP),
        highest=table.HIGHEST_POSITION.unsigned(answer, table.SETUP),
    )


def _check_mode(mode: int, label: str) -> None:
    if mode != table.POSITION_MODE:
        raise BackendError(
            f"{label} is in operating mode {mode} ({_MODES.get(mode, 'unknown')}); set "
            "its Operating Mode(11) to 3 (position) with DYNAMIXEL Wizard"
        )


def goal_bytes(ids: Sequence[int], counts: Counts) -> dict[int, bytes]:
    """Return the register bytes by id of goals (n,) in counts."""
    pairs = zip(ids, counts.tolist(), strict=True)
    return {
        n: count.to_bytes(table.GOAL.size, "little", signed=True) for n, count in pairs
    }


def hold_here(
    bus: ServoBus,
    joints: Mapping[str, JointCalibration],
    angles: ServoAngles,
    watchdog: int,
) -> None:
    """Turn the torque on, with the present positions as goals.

    Every register is read back before the next step. Otherwise a lost packet could
    leave an old goal, to which the torque would drive the joint at full speed.

    Args:
        bus: the servos' bus.
        joints: calibrations of the joints by name.
        angles: conversion to counts, with the servos' limits.
        watchdog: time without packets after which the servos stop, in units of
            `WATCHDOG_UNIT_S`.

    Raises:
        BackendError: a servo does not answer or confirm, or a joint is far outside its
            limits.
    """
    names = {joint.id: label(name, joint) for name, joint in joints.items()}
    ids = list(names)
    found = bus.read_surely(ids, table.PRESENT)
    refuse(bus, names, [n for n in ids if n not in found], "does not answer")
    counts = np.array([struct.unpack(table.PRESENT_FORMAT, found[n])[2] for n in ids])
    _check_inside(list(joints), angles, angles.positions(counts))
    as_fast_as_it_can = bytes(table.PROFILE.size)
    goals = {n: as_fast_as_it_can + g for n, g in goal_bytes(ids, counts).items()}
    pwm = {j.id: round(j.pwm_limit / 100.0 * table.FULL_PWM) for j in joints.values()}
    for block, values in (
        # A tripped watchdog refuses goals.
        (table.WATCHDOG, dict.fromkeys(ids, _OFF)),
        (table.PROFILE_AND_GOAL, goals),
        (table.GOAL_PWM, {n: value.to_bytes(2, "little") for n, value in pwm.items()}),
        (table.WATCHDOG, dict.fromkeys(ids, bytes([watchdog]))),
        (table.TORQUE, dict.fromkeys(ids, _ON)),
    ):
        failed = bus.write_surely(block, values)
        refuse(bus, names, failed, _WHY)


def make_limp(
    bus: ServoBus, joints: Mapping[str, JointCalibration]
) -> list[ServoSetup]:
    """Find every servo and turn its torque off.

    Args:
        bus: the servos' bus.
        joints: calibrations of the joints by name.

    Returns:
        The servos' settings, in the order of the joints.

    Raises:
        BackendError: a servo does not answer or confirm, or differs from the
            calibration.
    """
    setups = survey(bus, joints)
    names = {joint.id: label(name, joint) for name, joint in joints.items()}
    refuse(bus, names, let_go(bus, list(names)), "does not let go")
    off = bus.write_surely(table.WATCHDOG, dict.fromkeys(names, _OFF))
    refuse(bus, names, off, "keeps its bus watchdog")
    return setups


def let_go(bus: ServoBus, ids: Sequence[int]) -> list[int]:
    """Turn the torque off; return the ids that did not confirm it.

    Raises:
        BackendError: the port is lost.
    """
    return bus.write_surely(table.TORQUE, dict.fromkeys(ids, _OFF))


def refuse(
    bus: ServoBus, names: Mapping[int, str], failed: Sequence[int], what: str
) -> None:
    """Raise an error with the names of the servos that failed, if any.

    Raises:
        BackendError: at least one servo failed.
    """
    if failed:
        servos = ", ".join(names[number] for number in failed)
        raise BackendError(f"{bus.name}: {servos} {what}")


def _check_inside(names: Sequence[str], angles: ServoAngles, position: Array) -> None:
    limits = np.degrees([angles.lower, angles.upper]).T
    for name, at, (low, high) in zip(names, np.degrees(position), limits, strict=True):
        if not low - _OUTSIDE_DEG <= at <= high + _OUTSIDE_DEG:
            raise BackendError(
                f"{name} is at {at:.1f} deg, outside its limits {low:.1f} to "
                f"{high:.1f}: move it inside by hand, or calibrate again if that is "
                "wrong"
            )
