"""Compare a calibration with the devices on the bus, without writing to any servo.

The robot must hang upright and still, so that the IMU's signals are known.
"""

import time
from typing import Any, NamedTuple

import numpy as np

from gaitchain.backends.dynamixel.bus import ServoBus
from gaitchain.backends.dynamixel.calibration import (
    Calibration,
    ImuCalibration,
    JointCalibration,
)
from gaitchain.backends.dynamixel.guide import angle_of
from gaitchain.backends.dynamixel.imu import BusImu
from gaitchain.backends.dynamixel.make import Make, make_named
from gaitchain.backends.dynamixel.search import opened
from gaitchain.cli.console import print_table, say
from gaitchain.commission.imu import READS, implausible
from gaitchain.messages import Array
from gaitchain.walker.upright import tilt_deg

_HEADS = (
    *("joint", "id", "model", "at [deg]", "from", "to"),
    *("[deg C]", "[V]", "what is wrong"),
)
_KEYS = "joint", "id", "model", "at_deg", "from", "to", "deg_c", "v", "wrong"
_MISSING = "-"
_APART_S = 0.01


def compare(
    calibration: Calibration, port: str, given_baud: int | None
) -> tuple[int, dict[str, Any]]:
    """Print a row for each joint; the exit code is 1 if anything is wrong."""
    ids = [joint.id for joint in calibration.joints.values()]
    if calibration.imu is not None:
        ids.append(calibration.imu.id)
    bauds = [calibration.baud if given_baud is None else given_baud]
    feels: list[str] = []
    make = make_named(calibration.make)
    with opened(port, bauds, ids, make) as (bus, baud, models):
        rows = [
            _row(bus, name, joint, models.get(joint.id))
            for name, joint in calibration.joints.items()
        ]
        if calibration.imu is not None:
            feels = _felt(bus, calibration.imu)
    wrong = [row[-1] for row in rows if row[-1]]
    if baud != calibration.baud:
        wrong.append("baud")
        say(f"the bus runs at {baud} bit/s, the file says {calibration.baud}")
    wrong += feels
    title = f"{calibration.robot} on {port}, as the gait library sees it"
    print_table(title, _HEADS, rows, (0, 2, 8))
    say(_in_words(len(wrong)))
    joints = [dict(zip(_KEYS, row, strict=True)) for row in rows]
    return 1 if wrong else 0, {"baud": baud, "joints": joints, "wrong": wrong}


def _in_words(wrong: int) -> str:
    if not wrong:
        return "all as calibrated"
    return "1 thing is wrong" if wrong == 1 else f"{wrong} things are wrong"


class _Tables(NamedTuple):
    """What a servo answers to the questions of a comparison."""

    present: bytes
    state: bytes
    setup: bytes
    supply: bytes


def _tables(bus: ServoBus, number: int) -> _Tables | None:
    """Read a servo; None if it stops answering: what is missing is no zero."""
    make, found = bus.make, []
    for block in (make.present, make.state, make.setup, make.supply):
        data = bus.read_surely([number], block).get(number)
        if data is None:
            return None
        found.append(data)
    return _Tables(*found)


def _row(
    bus: ServoBus, name: str, joint: JointCalibration, model: int | None
) -> tuple[str, ...]:
    limits = f"{joint.lower:.1f}", f"{joint.upper:.1f}"
    tables = None if model is None else _tables(bus, joint.id)
    if model is None or tables is None:
        blank = (_MISSING,) * 2
        return (name, f"{joint.id}", *blank, *limits, *blank, "does not answer")
    found = bus.make.models.get(model)
    angle = angle_of(joint, bus.make.measured(tables.present)[2])
    heat, volts = bus.make.heat(tables.supply)
    kind = f"model {model}" if found is None else found.name
    return (
        *(name, f"{joint.id}", kind, f"{angle:.1f}", *limits),
        f"{heat:.0f}",
        f"{volts:.1f}",
        ", ".join(_wrong(bus.make, tables, joint, kind, angle)),
    )


def _wrong(
    make: Make, tables: _Tables, joint: JointCalibration, kind: str, angle: float
) -> list[str]:
    """Describe what differs from the calibration."""
    mode = make.settings(tables.setup).mode
    found = make.error_words(make.status(tables.state).errors)
    if joint.model and kind != joint.model:
        found.append(f"not a {joint.model}")
    if mode != make.position_mode:
        found.append(f"operating mode {mode}, not {make.position_mode}")
    if not joint.lower <= angle <= joint.upper:
        found.append("outside its limits")
    return found


def _felt(bus: ServoBus, imu: ImuCalibration) -> list[str]:
    """Print an IMU's mean signals over a quarter of a second; return problems."""
    name, device = f"imu (id {imu.id})", BusImu(imu)
    turning, pulling = _averages(bus, device)
    if not np.isfinite([turning, pulling]).all():
        wrong = ["does not answer, or with what are no numbers: check id and format"]
    else:
        say(
            f"{name}: acceleration {_numbers(pulling)} m/s^2, "
            f"{np.linalg.norm(pulling):.2f} long, up is {tilt_deg(pulling):.0f} deg "
            f"from the trunk's z; turns by {_numbers(np.degrees(turning))} deg/s"
        )
        wrong = [f"{it.why}: {it.todo}" for it in implausible(turning, pulling)]
    for words in wrong:
        say(f"{name}: {words}")
    return wrong


def _averages(bus: ServoBus, device: BusImu) -> tuple[Array, Array]:
    """Return mean rate [rad/s] and acceleration [m/s^2]; NaN without any answer."""
    came = []
    for _ in range(READS):
        both = np.array(device.read(bus))
        if np.isfinite(both).all():
            came.append(both)
        elif device.note:
            break
        time.sleep(_APART_S)
    turning, pulling = np.mean(came, axis=0) if came else np.full((2, 3), np.nan)
    return turning, pulling


def _numbers(values: Array) -> str:
    return ", ".join(f"{value:.2f}" for value in values.tolist())
