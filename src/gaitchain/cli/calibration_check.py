"""Compare a calibration with the devices on the bus, without writing to any servo.

The robot must hang upright and still, so that the IMU's signals are known.
"""

import math
import time
from typing import Any

import numpy as np

from gaitchain.backends.dynamixel import control_table as table
from gaitchain.backends.dynamixel.bus import ServoBus
from gaitchain.backends.dynamixel.calibration import (
    Calibration,
    ImuCalibration,
    JointCalibration,
)
from gaitchain.backends.dynamixel.guide import angle_of, positions
from gaitchain.backends.dynamixel.imu import BusImu
from gaitchain.backends.dynamixel.search import opened
from gaitchain.cli.console import print_table, say
from gaitchain.cli.options import Calibrate
from gaitchain.messages import GRAVITY, Array

_HEADS = (
    *("joint", "id", "model", "at [deg]", "from", "to"),
    *("[deg C]", "[V]", "what is wrong"),
)
_KEYS = "joint", "id", "model", "at_deg", "from", "to", "deg_c", "v", "wrong"
_MISSING = "-"
# Averaging and tolerances of the IMU check.
_READS, _APART_S = 25, 0.01
_OFF = 1.0  # m/s^2; a robot held by hand sways a little
_MOST_TILT = 45.0  # deg; a walk counts 50 as a fall
_MOST_RATE = 5.0  # deg/s; larger than the bias of a gyro
_AXES = "xyz"


def compare(calibration: Calibration, options: Calibrate) -> tuple[int, dict[str, Any]]:
    """Print a row for each joint; the exit code is 1 if anything is wrong."""
    ids = [joint.id for joint in calibration.joints.values()]
    if calibration.imu is not None:
        ids.append(calibration.imu.id)
    bauds = [options.baud or calibration.baud]
    feels: list[str] = []
    port = options.port or ""
    with opened(port, bauds, ids) as (bus, baud, models):
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
    title = f"{calibration.robot} on {options.port}, as the gait library sees it"
    print_table(title, _HEADS, rows, (0, 2, 8))
    say(f"{len(wrong)} things are wrong" if wrong else "all as calibrated")
    joints = [dict(zip(_KEYS, row, strict=True)) for row in rows]
    return 1 if wrong else 0, {"baud": baud, "joints": joints, "wrong": wrong}


def _row(
    bus: ServoBus, name: str, joint: JointCalibration, model: int | None
) -> tuple[str, ...]:
    limits = f"{joint.lower:.1f}", f"{joint.upper:.1f}"
    if model is None:
        blank = (_MISSING,) * 2
        return (name, f"{joint.id}", *blank, *limits, *blank, "does not answer")
    found = table.MODELS.get(model)
    angle = angle_of(joint, positions(bus, [joint.id])[joint.id])
    supply = bus.read_surely([joint.id], table.SUPPLY).get(
        joint.id, bytes(table.SUPPLY.size)
    )
    kind = f"model {model}" if found is None else found.name
    return (
        *(name, f"{joint.id}", kind, f"{angle:.1f}", *limits),
        f"{table.TEMPERATURE.unsigned(supply, table.SUPPLY)}",
        f"{0.1 * table.VOLTAGE.unsigned(supply, table.SUPPLY):.1f}",
        ", ".join(_wrong(bus, joint, kind, angle)),
    )


def _wrong(
    bus: ServoBus, joint: JointCalibration, kind: str, angle: float
) -> list[str]:
    """Describe what differs from the calibration."""
    state = bus.read_surely([joint.id], table.STATE).get(
        joint.id, bytes(table.STATE.size)
    )
    mode = bus.read_surely([joint.id], table.OPERATING_MODE).get(joint.id, b"\0")[0]
    found = table.hardware_errors(table.HARDWARE_ERROR.unsigned(state, table.STATE))
    if joint.model and kind != joint.model:
        found.append(f"not a {joint.model}")
    if mode != table.POSITION_MODE:
        found.append(f"operating mode {mode}, not {table.POSITION_MODE}")
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
        rate, size = np.degrees(turning), float(np.linalg.norm(pulling))
        tilt = math.degrees(math.acos(min(max(pulling[2] / max(size, 1e-9), -1), 1)))
        say(
            f"{name}: acceleration {_numbers(pulling)} m/s^2, {size:.2f} long, up is "
            f"{tilt:.0f} deg from the trunk's z; turns by {_numbers(rate)} deg/s"
        )
        wrong = _nonsense(rate, pulling, size, tilt)
    for words in wrong:
        say(f"{name}: {words}")
    return wrong


def _averages(bus: ServoBus, device: BusImu) -> tuple[Array, Array]:
    """Return mean rate [rad/s] and acceleration [m/s^2]; NaN without any answer."""
    came = []
    for _ in range(_READS):
        both = np.array(device.read(bus))
        if np.isfinite(both).all():
            came.append(both)
        elif device.note:
            break
        time.sleep(_APART_S)
    turning, pulling = np.mean(came, axis=0) if came else np.full((2, 3), np.nan)
    return turning, pulling


def _nonsense(rate: Array, pulling: Array, size: float, tilt: float) -> list[str]:
    """Describe signals that are impossible at rest and upright, and what to check."""
    wrong = []
    if not abs(size - GRAVITY) <= _OFF:
        wrong.append(
            f"the acceleration is {size:.2f} m/s^2 long, at rest {GRAVITY}: check "
            "accelerometer_scale, its address and format, and that nobody moves the "
            "robot"
        )
    elif tilt > _MOST_TILT:
        most = int(np.argmax(np.abs(pulling)))
        up = f"{'-' if pulling[most] < 0.0 else '+'}{_AXES[most]}"
        wrong.append(
            f"up is near the trunk's {up}, {tilt:.0f} deg from its z: check axes, or "
            "hold the trunk upright"
        )
    if not np.abs(rate).max() <= _MOST_RATE:
        wrong.append(
            f"it turns by {np.abs(rate).max():.1f} deg/s, at rest {_MOST_RATE:g} at "
            "most: check gyro_scale, its address and format, and that nobody moves the "
            "robot"
        )
    return wrong


def _numbers(values: Array) -> str:
    return ", ".join(f"{value:.2f}" for value in values.tolist())
