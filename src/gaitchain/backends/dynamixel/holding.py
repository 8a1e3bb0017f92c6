"""Turning the torque on without a jump, and off for sure."""

import struct
from collections.abc import Mapping, Sequence

import numpy as np

from gaitchain.backends.dynamixel.angles import Counts, ServoAngles
from gaitchain.backends.dynamixel.bus import ServoBus
from gaitchain.backends.dynamixel.calibration import JointCalibration
from gaitchain.backends.dynamixel.control_table import (
    FULL_PWM,
    GOAL,
    GOAL_PWM,
    PRESENT,
    PRESENT_FORMAT,
    PROFILE,
    PROFILE_AND_GOAL,
    TORQUE,
    WATCHDOG,
)
from gaitchain.backends.dynamixel.survey import (
    ServoSetup,
    label,
    read_surely,
    survey,
    write_surely,
)
from gaitchain.errors import BackendError
from gaitchain.messages import Array

_OUTSIDE_DEG = 5.0  # a joint further out of its limits is not held there
_OFF, _ON = b"\0", b"\1"
_WHY = "does not obey; overload, heat, supply, or outside its Position Limits(52, 48)?"


def goal_bytes(ids: Sequence[int], counts: Counts) -> dict[int, bytes]:
    """Return goals (n,) in counts as the servos take them, by id."""
    pairs = zip(ids, counts.tolist(), strict=True)
    return {n: count.to_bytes(GOAL.size, "little", signed=True) for n, count in pairs}


def hold_here(
    bus: ServoBus,
    joints: Mapping[str, JointCalibration],
    angles: ServoAngles,
    watchdog: int,
) -> None:
    """Turn the torque on where the servos stand.

    Every register is read back before the next step, so that a packet that was lost
    cannot leave an old goal behind: torque would drive the joint there at full speed.

    Args:
        bus: where the servos are.
        joints: their calibrations by name.
        angles: their limits.
        watchdog: time without packets after which they stop, in their unit.

    Raises:
        BackendError: a servo does not answer or obey, or a joint is far outside its
            limits.
    """
    names = {joint.id: label(name, joint) for name, joint in joints.items()}
    ids = list(names)
    found = read_surely(bus, ids, PRESENT)
    refuse(bus, names, [n for n in ids if n not in found], "does not answer")
    counts = np.array([struct.unpack(PRESENT_FORMAT, found[n])[2] for n in ids])
    _check_inside(list(joints), angles, angles.positions(counts))
    as_fast_as_it_can = bytes(PROFILE.size)
    goals = {n: as_fast_as_it_can + g for n, g in goal_bytes(ids, counts).items()}
    pwm = {j.id: round(j.pwm_limit / 100.0 * FULL_PWM) for j in joints.values()}
    for block, values in (
        (WATCHDOG, dict.fromkeys(ids, _OFF)),  # one that has tripped refuses goals
        (PROFILE_AND_GOAL, goals),
        (GOAL_PWM, {n: value.to_bytes(2, "little") for n, value in pwm.items()}),
        (WATCHDOG, dict.fromkeys(ids, bytes([watchdog]))),
        (TORQUE, dict.fromkeys(ids, _ON)),
    ):
        failed = write_surely(bus, block, values)
        refuse(bus, names, failed, _WHY)


def make_limp(
    bus: ServoBus, joints: Mapping[str, JointCalibration]
) -> list[ServoSetup]:
    """Find every servo and turn its torque off.

    Args:
        bus: where the servos are.
        joints: their calibrations by name.

    Returns:
        What the servos say about themselves, in the order of the joints.

    Raises:
        BackendError: one does not answer or obey, or is not what the calibration says.
    """
    setups = survey(bus, joints)
    names = {joint.id: label(name, joint) for name, joint in joints.items()}
    refuse(bus, names, let_go(bus, list(names)), "does not let go")
    off = write_surely(bus, WATCHDOG, dict.fromkeys(names, _OFF))
    refuse(bus, names, off, "keeps its bus watchdog")
    return setups


def let_go(bus: ServoBus, ids: Sequence[int]) -> list[int]:
    """Turn the torque off; return the ids that were not seen to obey.

    Raises:
        BackendError: the port is lost.
    """
    return write_surely(bus, TORQUE, dict.fromkeys(ids, _OFF))


def refuse(
    bus: ServoBus, names: Mapping[int, str], failed: Sequence[int], what: str
) -> None:
    """Name the servos that failed, if any did.

    Raises:
        BackendError: some did.
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
