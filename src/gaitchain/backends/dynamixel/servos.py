"""Find and check the servos of a calibration, and turn their torque on and off."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from gaitchain.backends.dynamixel.angles import Counts, ServoAngles
from gaitchain.backends.dynamixel.bus import ServoBus
from gaitchain.backends.dynamixel.bus_load import BusLoad
from gaitchain.backends.dynamixel.calibration import MOST_PWM, JointCalibration
from gaitchain.backends.dynamixel.control_table import Model
from gaitchain.backends.dynamixel.make import OFF, Make, Settings
from gaitchain.errors import BackendError
from gaitchain.messages import Array

_OUTSIDE_DEG = 5.0  # a joint further outside its limits is not engaged


@dataclass(frozen=True)
class ServoSetup:
    """Settings in a servo's control table."""

    model: Model
    return_delay_s: float
    temperature_limit: int
    """Above this the servo turns its torque off [deg C]."""
    lowest: int
    """Smallest accepted goal position, in counts."""
    highest: int
    pwm_limit: float = MOST_PWM
    """Largest part of the supply voltage that may be asked for [%]."""


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
    models = bus.find(joint.id for joint in joints.values())
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


def bus_load(
    bus: ServoBus, setups: Sequence[ServoSetup], imu_bytes: int = 0
) -> BusLoad:
    """Return how long the packets of a control period keep a bus.

    Args:
        bus: the servos' bus.
        setups: the servos' settings.
        imu_bytes: data of a read of the IMU; 0 without an IMU.
    """
    delay_s = float(np.mean([setup.return_delay_s for setup in setups]))
    return BusLoad(len(setups), bus.baud, delay_s, bus.fast, imu_bytes, bus.make)


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
    make, model = bus.make, _model_of(bus, name, found, wanted)
    settings = _settings_of(bus, number, name)
    mode = settings.mode
    if mode != make.position_mode:
        raise BackendError(
            f"{bus.name}: {name} is in operating mode {mode} "
            f"({make.modes.get(mode, 'unknown')}); set its {make.mode_register}"
        )
    return ServoSetup(
        model=model,
        return_delay_s=settings.return_delay_s,
        temperature_limit=settings.temperature_limit,
        lowest=settings.lowest,
        highest=settings.highest,
        pwm_limit=settings.pwm_limit,
    )


def _model_of(bus: ServoBus, name: str, found: int, wanted: str) -> Model:
    """Return the model of a number; refuse one that is unknown, or not the wanted."""
    make = bus.make
    model = make.models.get(found)
    if model is None:
        raise BackendError(
            f"{bus.name}: {name} is of model {found}, no {make.name} servo with a "
            f"table that is known; such are {make.examples}"
        )
    if wanted and model.name != wanted:
        raise BackendError(
            f"{bus.name}: {name} is a {model.name}, the calibration says {wanted}; "
            "check the id, or change the model in the file"
        )
    return model


def _settings_of(bus: ServoBus, number: int, name: str) -> Settings:
    """Read the registers of a servo's settings."""
    make = bus.make
    answer = bus.read_surely([number], make.setup).get(number)
    if answer is None:
        raise BackendError(
            f"{bus.name}: {name} answers pings but no reads; set its "
            f"{make.level_register}"
        )
    return make.settings(answer)


def goal_bytes(make: Make, ids: Sequence[int], counts: Counts) -> dict[int, bytes]:
    """Return the register bytes by id of goals (n,) in counts."""
    pairs = zip(ids, counts.tolist(), strict=True)
    return {number: make.goal_data(count) for number, count in pairs}


def hold_here(
    bus: ServoBus,
    joints: Mapping[str, JointCalibration],
    angles: ServoAngles,
    watchdog: int,
    pwm_limits: Mapping[int, float],
) -> None:
    """Turn the torque on, with the present positions as goals.

    Every register is read back before the next step. Otherwise a lost packet could
    leave an old goal, to which the torque would drive the joint at full speed.

    Args:
        bus: the servos' bus.
        joints: calibrations of the joints by name.
        angles: conversion to counts, with the servos' limits.
        watchdog: time without packets after which the servos stop, where they have
            such a watchdog, in units of `WATCHDOG_UNIT_S`.
        pwm_limits: torque limits by id [%].

    Raises:
        BackendError: a servo does not answer or confirm, or a joint is far outside its
            limits or beyond its servo's zero.
    """
    names = {joint.id: label(name, joint) for name, joint in joints.items()}
    ids = list(names)
    make = bus.make
    found = bus.read_surely(ids, make.present)
    refuse(bus, names, [n for n in ids if n not in found], "does not answer")
    counts = np.array([make.measured(found[n])[2] for n in ids])
    _check_inside(list(joints), angles, angles.positions(counts))
    _check_turn(bus, list(names.values()), angles, counts)
    goals = dict(zip(ids, counts.tolist(), strict=True))
    for block, values in make.holding(goals, pwm_limits, watchdog):
        failed = bus.write_surely(block, values)
        refuse(bus, names, failed, make.obeys_not)


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
    if bus.make.watchdog is not None:
        off = bus.write_surely(bus.make.watchdog, dict.fromkeys(names, OFF))
        refuse(bus, names, off, "keeps its bus watchdog")
    return setups


def let_go(bus: ServoBus, ids: Sequence[int]) -> list[int]:
    """Turn the torque off; return the ids that did not confirm it.

    Raises:
        BackendError: the port is lost.
    """
    return bus.write_surely(bus.make.torque, dict.fromkeys(ids, OFF))


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


def _check_turn(
    bus: ServoBus, labels: Sequence[str], angles: ServoAngles, counts: Array
) -> None:
    beyond = angles.beyond_zero(counts)
    for name, count, is_beyond in zip(labels, counts, beyond, strict=True):
        if is_beyond:
            raise BackendError(
                f"{bus.name}: {name} is beyond its servo's zero (count {count}), over "
                "which the servo does not turn back: turn the joint inside its limits "
                "by hand and switch the supply off and on, or remount the horn"
            )
