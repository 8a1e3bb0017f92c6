"""The servos of a calibration: found and checked, held where they stand, let go."""

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from gaitchain.backends.dynamixel.angles import Counts, ServoAngles
from gaitchain.backends.dynamixel.bus import ServoBus
from gaitchain.backends.dynamixel.calibration import JointCalibration
from gaitchain.backends.dynamixel.control_table import (
    FULL_PWM,
    GOAL,
    GOAL_PWM,
    HIGHEST_POSITION,
    LOWEST_POSITION,
    MODELS,
    OPERATING_MODE,
    POSITION_MODE,
    PRESENT,
    PRESENT_FORMAT,
    PROFILE,
    PROFILE_AND_GOAL,
    RETURN_DELAY,
    SETUP,
    TEMPERATURE_LIMIT,
    TORQUE,
    WATCHDOG,
    Model,
    unsigned,
)
from gaitchain.errors import BackendError
from gaitchain.messages import Array

_SHARE = 0.8  # of a control period that reading may take
_DELAY_UNIT_S = 2e-6
_MODES = {
    **{0: "current", 1: "velocity", 4: "extended position"},
    **{5: "current-based position", 16: "PWM"},
}
_OUTSIDE_DEG = 5.0  # a joint further out of its limits is not held there
_OFF, _ON = b"\0", b"\1"
_WHY = "does not obey; overload, heat, supply, or outside its Position Limits(52, 48)?"


@dataclass(frozen=True)
class ServoSetup:
    """Settings in a servo's table."""

    model: Model
    return_delay_s: float
    temperature_limit: int
    """It lets go beyond [deg C]."""
    lowest: int
    """Least goal that it takes, in counts."""
    highest: int


def survey(bus: ServoBus, joints: Mapping[str, JointCalibration]) -> list[ServoSetup]:
    """Find every servo of a calibration, and check that it can be driven.

    Args:
        bus: where they are.
        joints: the calibration's joints by name.

    Returns:
        Their settings, in the order of the joints.

    Raises:
        BackendError: one does not answer, or is not what the calibration says.
    """
    models = bus.scan(joint.id for joint in joints.values())
    silent = [label(name, j) for name, j in joints.items() if j.id not in models]
    if silent:
        everyone = " (none answers: supply, cable, baud?)" * (
            len(silent) == len(joints)
        )
        raise BackendError(
            f"{bus.name}: no answer from {', '.join(silent)}{everyone}; `gaitchain "
            "calibrate` with --check shows who is there"
        )
    return [
        servo_setup(bus, joint.id, label(name, joint), models[joint.id], joint.model)
        for name, joint in joints.items()
    ]


def check_speed(bus: ServoBus, setups: Sequence[ServoSetup], period_s: float) -> None:
    """Refuse a bus that cannot be read in a control period.

    Args:
        bus: where the servos are.
        setups: their settings.
        period_s: control period [s].

    Raises:
        BackendError: it is too slow.
    """
    count = len(setups)
    delays_s = sum(setup.return_delay_s for setup in setups)
    needed = bus.line_s(count, PRESENT) + delays_s
    if needed > _SHARE * period_s:
        raise BackendError(
            f"{bus.name}: reading {count} servos takes {1e3 * needed:.1f} ms, allowed: "
            f"{_SHARE:.0%} of the period of {1e3 * period_s:g} ms; raise Baud Rate(8), "
            "or set Return Delay Time(9) to 0 with DYNAMIXEL Wizard"
        )


def label(name: str, joint: JointCalibration) -> str:
    """Return what messages call a servo."""
    return f"{name} (id {joint.id})"


def servo_setup(
    bus: ServoBus, number: int, name: str, found: int, wanted: str = ""
) -> ServoSetup:
    """Read a servo's settings.

    Args:
        bus: where it is.
        number: its id.
        name: what messages call it.
        found: the model that answered the ping.
        wanted: the model that it should be, empty for any.

    Raises:
        BackendError: it is another model, in another mode, or does not answer reads.
    """
    model = MODELS.get(found)
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
    answer = bus.read_surely([number], SETUP).get(number)
    if answer is None:
        raise BackendError(
            f"{bus.name}: {name} answers pings but no reads; set its Status Return "
            "Level(68) to 2 with DYNAMIXEL Wizard"
        )
    _check_mode(unsigned(answer, OPERATING_MODE, SETUP), f"{bus.name}: {name}")
    return ServoSetup(
        model=model,
        return_delay_s=_DELAY_UNIT_S * unsigned(answer, RETURN_DELAY, SETUP),
        temperature_limit=unsigned(answer, TEMPERATURE_LIMIT, SETUP),
        lowest=unsigned(answer, LOWEST_POSITION, SETUP),
        highest=unsigned(answer, HIGHEST_POSITION, SETUP),
    )


def _check_mode(mode: int, label: str) -> None:
    if mode != POSITION_MODE:
        raise BackendError(
            f"{label} is in operating mode {mode} ({_MODES.get(mode, 'unknown')}); set "
            "its Operating Mode(11) to 3 (position) with DYNAMIXEL Wizard"
        )


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
    found = bus.read_surely(ids, PRESENT)
    refuse(bus, names, [n for n in ids if n not in found], "does not answer")
    counts = np.array([struct.unpack(PRESENT_FORMAT, found[n])[2] for n in ids])
    _check_inside(list(joints), angles, angles.positions(counts))
    as_fast_as_it_can = bytes(PROFILE.size)
    goals = {n: as_fast_as_it_can + g for n, g in goal_bytes(ids, counts).items()}
    pwm = {j.id: round(j.pwm_limit / 100.0 * FULL_PWM) for j in joints.values()}
    for block, values in (
        (
            WATCHDOG,
            dict.fromkeys(ids, _OFF),
        ),  # one that has tripped refuses goals
        (PROFILE_AND_GOAL, goals),
        (GOAL_PWM, {n: value.to_bytes(2, "little") for n, value in pwm.items()}),
        (WATCHDOG, dict.fromkeys(ids, bytes([watchdog]))),
        (TORQUE, dict.fromkeys(ids, _ON)),
    ):
        failed = bus.write_surely(block, values)
        refuse(bus, names, failed, _WHY)


def make_limp(
    bus: ServoBus, joints: Mapping[str, JointCalibration]
) -> list[ServoSetup]:
    """Find every servo and turn its torque off.

    Args:
        bus: where the servos are.
        joints: their calibrations by name.

    Returns:
        The servos' settings, in the order of the joints.

    Raises:
        BackendError: one does not answer or obey, or is not what the calibration says.
    """
    setups = survey(bus, joints)
    names = {joint.id: label(name, joint) for name, joint in joints.items()}
    refuse(bus, names, let_go(bus, list(names)), "does not let go")
    off = bus.write_surely(WATCHDOG, dict.fromkeys(names, _OFF))
    refuse(bus, names, off, "keeps its bus watchdog")
    return setups


def let_go(bus: ServoBus, ids: Sequence[int]) -> list[int]:
    """Turn the torque off; return the ids that did not confirm it.

    Raises:
        BackendError: the port is lost.
    """
    return bus.write_surely(TORQUE, dict.fromkeys(ids, _OFF))


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
