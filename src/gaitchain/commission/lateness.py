"""How late answers come, which loses them and slows control as a bad cable does. Ours.

A late answer counts as lost, so whoever only counts looks for cables; and bytes alone
do not tell it. So pings are timed, with the torque off.
"""

import math
from dataclasses import dataclass, replace
from itertools import cycle, islice
from pathlib import Path

from gaitchain.backends.servos.bus import ServoBus
from gaitchain.backends.servos.bus_load import SHARE, TURN_S, BusLoad
from gaitchain.backends.servos.make import make_named
from gaitchain.commission.bench import Bench, Verdict
from gaitchain.errors import BackendError

_PINGS, _TRIES = 25, 3
_LATE_S = 2.0 * TURN_S  # more than a busy computer makes of most answers
_PATIENCE_S, _VAIN_S = 0.25, 1.0  # for an answer, and for all that do not come
_PORT = "ttyUSB0"


@dataclass(frozen=True)
class Lateness:
    """How late answers come, and what that makes of a control period."""

    load: BusLoad
    """The packets of a period, with the turns as they were measured."""
    period_s: float
    """Control period [s]."""
    port: str
    """Serial port."""

    @property
    def known(self) -> bool:
        """Whether any servo answered."""
        return math.isfinite(self.load.turn_s)

    @property
    def full(self) -> bool:
        """Whether the packets do not even fit in the whole period."""
        return self.load.period_s > self.period_s

    @property
    def explains(self) -> bool:
        """Whether answers are so late that what is lost or slow may come of that."""
        late = self.load.turn_s > _LATE_S
        return late and self.load.period_s > SHARE * self.period_s

    @property
    def said(self) -> str:
        """How late answers come; empty where nobody answered."""
        if not self.known:
            return ""
        turn_ms = 1e3 * self.load.turn_s
        if not (self.explains or self.full):
            return f"answers come {turn_ms:.1f} ms after a request"
        return (
            f"answers come late, {turn_ms:.1f} ms after a request, where "
            f"{1e3 * TURN_S:g} ms can be: so the packets of a period take "
            f"{1e3 * self.load.period_s:.1f} of {1e3 * self.period_s:.1f} ms"
        )

    @property
    def todo(self) -> str:
        """How to make answers come sooner."""
        found = Path(self.port).resolve().name
        name = found if found.startswith(_PORT[:-1]) else _PORT
        return (
            "set the USB adapter's latency timer to 1 ms (FTDI's is 16): `echo 1 | "
            f"sudo tee /sys/bus/usb-serial/devices/{name}/latency_timer`, on Windows "
            "among the port's settings in the device manager; set the servos' "
            f"{self.load.make.delay_register} to 0; try another adapter, and no hub; "
            "end other programs"
        )


def lateness(bench: Bench) -> Lateness:
    """Time pings; where nobody answers, how late is not known."""
    found = _timed(bench)
    for _ in range(_TRIES - 1):
        if not found.explains:
            break
        # An adapter is late in each try, a busy computer now and then.
        found = min(found, _timed(bench), key=lambda one: one.load.turn_s)
    return found


def _timed(bench: Bench) -> Lateness:
    """Return how late answers come, of the median ping."""
    ids = [joint.id for joint in bench.calibration.joints.values()]
    load = bench.load
    bus = ServoBus(
        bench.port, load.baud, _PATIENCE_S, make=make_named(bench.calibration.make)
    )
    try:
        bus.open()
        with bus.hurried(_VAIN_S):
            turn_s = bus.turn_s(islice(cycle(ids), _PINGS))
    except BackendError:
        turn_s = math.nan
    finally:
        bus.close()
    own_s = max(turn_s - load.delay_s, 0.0) if math.isfinite(turn_s) else math.nan
    return Lateness(replace(load, turn_s=own_s), bench.period_s, bench.port)


def failed(bench: Bench, error: str, todo: str) -> Verdict:
    """Return the verdict on a bus that failed, and whether that is for late answers.

    Servos that may hold are not asked: their packets would keep the watchdogs quiet.

    Args:
        bench: the bench, its servos no longer connected.
        error: how it failed.
        todo: what to do where answers are not late.
    """
    late = None if bench.not_let_go else lateness(bench)
    if late is None or not late.explains:
        return Verdict("no-go", error, todo)
    measured = {"answer_ms": 1e3 * late.load.turn_s}
    return Verdict("no-go", f"{late.said}; then: {error}", late.todo, measured)
