"""What is on the bus, checked against the calibration before anything moves."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from gaitchain.backends.dynamixel.bus import ServoBus
from gaitchain.backends.dynamixel.calibration import JointCalibration
from gaitchain.backends.dynamixel.control_table import (
    HIGHEST_POSITION,
    LOWEST_POSITION,
    MODELS,
    OPERATING_MODE,
    POSITION_MODE,
    PRESENT,
    RETURN_DELAY,
    SETUP,
    TEMPERATURE_LIMIT,
    Block,
    Model,
    unsigned,
)
from gaitchain.errors import BackendError

_TRIES = 4
_BUDGET_S = 0.5
_SHARE = 0.8  # of a control period that reading may take
_FRAME, _REQUEST, _BITS = 11, 14, 10.0  # bytes around answers, in a request; bits
_DELAY_UNIT_S = 2e-6
_MODES = {
    **{0: "current", 1: "velocity", 4: "extended position"},
    **{5: "current-based position", 16: "PWM"},
}


@dataclass(frozen=True)
class ServoSetup:
    """What a servo says about itself."""

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
        What the servos say, in the order of the joints.

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


def check_speed(
    bus: ServoBus, baud: int, setups: Sequence[ServoSetup], period_s: float
) -> None:
    """Refuse a bus that cannot be read in a control period.

    Args:
        bus: where the servos are.
        baud: its rate [bit/s].
        setups: what they say about themselves.
        period_s: control period [s].

    Raises:
        BackendError: it is too slow.
    """
    byte_s, count = _BITS / baud, len(setups)
    line_s = (_REQUEST + count + count * (_FRAME + PRESENT.size)) * byte_s
    needed = line_s + sum(setup.return_delay_s for setup in setups)
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
    bus: ServoBus, number: int, label: str, found: int, wanted: str = ""
) -> ServoSetup:
    """Read what a servo says about itself.

    Args:
        bus: where it is.
        number: its id.
        label: what messages call it.
        found: the model that answered the ping.
        wanted: the model that it should be, empty for any.

    Raises:
        BackendError: it is another model, in another mode, or does not answer reads.
    """
    model = MODELS.get(found)
    if model is None:
        raise BackendError(
            f"{bus.name}: {label} is of model {found}, no servo with the X series' "
            "table; such are xm430-w350, xl330-m288, mx-64 with protocol 2.0"
        )
    if wanted and model.name != wanted:
        raise BackendError(
            f"{bus.name}: {label} is a {model.name}, the calibration says {wanted}; "
            "check the id, or change the model in the file"
        )
    answer = read_surely(bus, [number], SETUP).get(number)
    if answer is None:
        raise BackendError(
            f"{bus.name}: {label} answers pings but no reads; set its Status Return "
            "Level(68) to 2 with DYNAMIXEL Wizard"
        )
    _check_mode(unsigned(answer, OPERATING_MODE, SETUP), f"{bus.name}: {label}")
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


def read_surely(bus: ServoBus, ids: list[int], block: Block) -> dict[int, bytes]:
    """Read a part of many tables, asking again those whose answers are lost.

    Raises:
        BackendError: the port is lost.
    """
    found: dict[int, bytes] = {}
    for _ in range(_TRIES):
        missing = [number for number in ids if number not in found]
        if not missing:
            break
        answers = bus.read_all(missing, block, _BUDGET_S)
        found |= {number: answer.data for number, answer in answers.items()}
    return found


def write_surely(bus: ServoBus, block: Block, values: Mapping[int, bytes]) -> list[int]:
    """Write a part of many tables, again to those that do not show it.

    Returns:
        The ids whose table still shows something else, or that do not answer.

    Raises:
        BackendError: the port is lost.
    """
    left = dict(values)
    for _ in range(_TRIES):
        bus.write_all(block, left)
        shown = bus.read_all(list(left), block, _BUDGET_S)
        left = {
            number: data
            for number, data in left.items()
            if number not in shown or shown[number].data != data
        }
        if not left:
            break
    return list(left)
