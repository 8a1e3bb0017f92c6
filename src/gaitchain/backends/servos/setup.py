"""Find the servos of a calibration, and check how they are set up."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from gaitchain.backends.servos.bus import ServoBus
from gaitchain.backends.servos.bus_load import BusLoad
from gaitchain.backends.servos.calibration import MOST_PWM, JointCalibration
from gaitchain.backends.servos.make import Settings
from gaitchain.backends.servos.table import Model
from gaitchain.errors import BackendError


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
    return BusLoad(len(setups), bus.baud, delay_s, bus.fast, imu_bytes, make=bus.make)


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
