"""Turn the torque of servos on, at the positions that they have, and off."""

from collections.abc import Mapping, Sequence

import numpy as np

from gaitchain.backends.servos.angles import Counts, ServoAngles
from gaitchain.backends.servos.bus import ServoBus
from gaitchain.backends.servos.calibration import JointCalibration
from gaitchain.backends.servos.make import OFF, Make
from gaitchain.backends.servos.setup import ServoSetup, label, refuse, survey
from gaitchain.errors import BackendError
from gaitchain.messages import Array

_OUTSIDE_DEG = 5.0  # a joint further outside its limits is not engaged


def goal_bytes(make: Make, ids: Sequence[int], counts: Counts) -> dict[int, bytes]:
    """Return the register bytes by id of goals (n,) in counts."""
    pairs = zip(ids, counts.tolist(), strict=True)
    return {number: make.goal_data(count) for number, count in pairs}


def hold_here(
    bus: ServoBus,
    joints: Mapping[str, JointCalibration],
    angles: ServoAngles,
    watchdog_s: float,
    pwm_limits: Mapping[int, float],
) -> None:
    """Turn the torque on, with the present positions as goals.

    Every register is read back before the next step. Otherwise a lost packet could
    leave an old goal, to which the torque would drive the joint at full speed.

    Args:
        bus: the servos' bus.
        joints: calibrations of the joints by name.
        angles: conversion to counts, with the servos' limits.
        watchdog_s: time without packets after which the servos stop, where they have
            such a watchdog [s].
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
    for block, values in make.holding(goals, pwm_limits, watchdog_s):
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
