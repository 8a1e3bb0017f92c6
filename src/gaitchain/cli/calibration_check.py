"""A calibration beside what is on the bus; nothing is written to any servo."""

from gaitchain.backends.dynamixel.bus import ServoBus
from gaitchain.backends.dynamixel.calibration import Calibration, JointCalibration
from gaitchain.backends.dynamixel.control_table import (
    HARDWARE_ERROR,
    MODELS,
    OPERATING_MODE,
    POSITION_MODE,
    STATE,
    SUPPLY,
    TEMPERATURE,
    VOLTAGE,
    hardware_errors,
    unsigned,
)
from gaitchain.backends.dynamixel.guide import angle_of, positions
from gaitchain.backends.dynamixel.search import opened
from gaitchain.backends.dynamixel.survey import read_surely
from gaitchain.cli.calibrate_options import Calibrate
from gaitchain.cli.console import print_table, say
from gaitchain.cli.imu_check import felt

_HEADS = (
    *("joint", "id", "model", "at [deg]", "from", "to"),
    *("[deg C]", "[V]", "what is wrong"),
)
_MISSING = "-"


def compare(calibration: Calibration, options: Calibrate) -> int:
    """Print a row for each joint; return 1 if anything is wrong."""
    ids = [joint.id for joint in calibration.joints.values()]
    if calibration.imu is not None:
        ids.append(calibration.imu.id)
    bauds = [options.baud or calibration.baud]
    feels: list[str] = []
    with opened(options.port, bauds, ids) as (bus, baud, models):
        rows = [
            _row(bus, name, joint, models.get(joint.id))
            for name, joint in calibration.joints.items()
        ]
        if calibration.imu is not None:
            feels = felt(bus, calibration.imu)
    wrong = [row[-1] for row in rows if row[-1]]
    if baud != calibration.baud:
        wrong.append("baud")
        say(f"the bus runs at {baud} bit/s, the file says {calibration.baud}")
    wrong += feels
    title = f"{calibration.robot} on {options.port}, as the gait library sees it"
    print_table(title, _HEADS, rows, (0, 2, 8))
    say(f"{len(wrong)} things are wrong" if wrong else "all as calibrated")
    return 1 if wrong else 0


def _row(
    bus: ServoBus, name: str, joint: JointCalibration, model: int | None
) -> tuple[str, ...]:
    limits = f"{joint.lower:.1f}", f"{joint.upper:.1f}"
    if model is None:
        blank = (_MISSING,) * 2
        return (name, f"{joint.id}", *blank, *limits, *blank, "does not answer")
    found = MODELS.get(model)
    angle = angle_of(joint, positions(bus, [joint.id])[joint.id])
    supply = read_surely(bus, [joint.id], SUPPLY).get(joint.id, bytes(SUPPLY.size))
    kind = f"model {model}" if found is None else found.name
    return (
        *(name, f"{joint.id}", kind, f"{angle:.1f}", *limits),
        f"{unsigned(supply, TEMPERATURE, SUPPLY)}",
        f"{0.1 * unsigned(supply, VOLTAGE, SUPPLY):.1f}",
        ", ".join(_wrong(bus, joint, kind, angle)),
    )


def _wrong(
    bus: ServoBus, joint: JointCalibration, kind: str, angle: float
) -> list[str]:
    """Return what is not as it should be, in words."""
    state = read_surely(bus, [joint.id], STATE).get(joint.id, bytes(STATE.size))
    mode = read_surely(bus, [joint.id], OPERATING_MODE).get(joint.id, b"\0")[0]
    found = hardware_errors(unsigned(state, HARDWARE_ERROR, STATE))
    if joint.model and kind != joint.model:
        found.append(f"not a {joint.model}")
    if mode != POSITION_MODE:
        found.append(f"operating mode {mode}, not {POSITION_MODE}")
    if not joint.lower <= angle <= joint.upper:
        found.append("outside its limits")
    return found
