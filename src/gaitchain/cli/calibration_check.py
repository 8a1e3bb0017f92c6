"""Compare a calibration with the devices on the bus, without writing to any servo.

The robot must hang upright and still, so that the IMU's signals are known.
"""

import time
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import numpy as np

from gaitchain.backends.servos.bus import ServoBus
from gaitchain.backends.servos.calibration import (
    Calibration,
    ImuCalibration,
    JointCalibration,
)
from gaitchain.backends.servos.guide import angle_of
from gaitchain.backends.servos.imu import BusImu
from gaitchain.backends.servos.make import Make, make_named
from gaitchain.backends.servos.search import opened
from gaitchain.cli.console import print_table, say
from gaitchain.commission.imu import faults_at_rest, mean_of, samples
from gaitchain.messages import Array
from gaitchain.walker.upright import tilt_deg

_HEADS = (
    *("joint", "id", "model", "at [deg]", "from", "to"),
    *("[deg C]", "[V]", "what is wrong"),
)
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
        found = [
            _compared(bus, name, joint, models.get(joint.id))
            for name, joint in calibration.joints.items()
        ]
        if calibration.imu is not None:
            feels = _felt(bus, calibration.imu)
    wrong = [", ".join(joint.wrong) for joint in found if joint.wrong]
    if baud != calibration.baud:
        wrong.append("baud")
        say(f"the bus runs at {baud} bit/s, the file says {calibration.baud}")
    wrong += feels
    title = f"{calibration.robot} on {port}, as the gait library sees it"
    print_table(title, _HEADS, [joint.cells for joint in found], (0, 2, 8))
    say(_in_words(len(wrong)))
    joints = [asdict(joint) for joint in found]
    return 1 if wrong else 0, {"baud": baud, "joints": joints, "wrong": wrong}


@dataclass(frozen=True)
class _Compared:
    """A joint of the calibration, and its servo; None for what that did not say."""

    joint: str
    id: int
    model: str | None
    at_deg: float | None
    from_deg: float
    to_deg: float
    temperature_c: float | None
    supply_v: float | None
    wrong: tuple[str, ...]

    @property
    def cells(self) -> tuple[str, ...]:
        """Its row of the table."""
        return (
            *(self.joint, f"{self.id}", self.model or _MISSING),
            _cell(self.at_deg, 1),
            *(_cell(self.from_deg, 1), _cell(self.to_deg, 1)),
            *(_cell(self.temperature_c, 0), _cell(self.supply_v, 1)),
            ", ".join(self.wrong),
        )


def _cell(value: float | None, digits: int) -> str:
    return _MISSING if value is None else f"{value:.{digits}f}"


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


def _compared(
    bus: ServoBus, name: str, joint: JointCalibration, model: int | None
) -> _Compared:
    tables = None if model is None else _tables(bus, joint.id)
    if model is None or tables is None:
        ends = joint.lower, joint.upper
        silent = ("does not answer",)
        return _Compared(name, joint.id, None, None, *ends, None, None, silent)
    found = bus.make.models.get(model)
    angle = angle_of(joint, bus.make.measured(tables.present)[2])
    heat, volts = bus.make.supply_state(tables.supply)
    kind = f"model {model}" if found is None else found.name
    return _Compared(
        joint=name,
        id=joint.id,
        model=kind,
        at_deg=angle,
        from_deg=joint.lower,
        to_deg=joint.upper,
        temperature_c=heat,
        supply_v=volts,
        wrong=tuple(_wrong(bus.make, tables, joint, kind, angle)),
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
    came = samples(
        lambda: device.read(bus),
        lambda: time.sleep(_APART_S),
        lambda: bool(device.note),
    )
    if len(came):
        turning, pulling = mean_of(came)
        say(
            f"{name}: acceleration {_numbers(pulling)} m/s^2, "
            f"{np.linalg.norm(pulling):.2f} long, up is {tilt_deg(pulling):.0f} deg "
            f"from the trunk's z; turns by {_numbers(np.degrees(turning))} deg/s"
        )
    wrong = [f"{it.why}: {it.todo}" for it in faults_at_rest(came)]
    for words in wrong:
        say(f"{name}: {words}")
    return wrong


def _numbers(values: Array) -> str:
    return ", ".join(f"{value:z.2f}" for value in values.tolist())
