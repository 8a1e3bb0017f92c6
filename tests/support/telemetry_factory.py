"""Telemetry of a walk in MuJoCo, and of no walk at all, without the loop's process."""

import math
from types import SimpleNamespace

from msgspec.structs import replace

from gaitchain.live.driver_lease import DriverLease
from gaitchain.live.messages import Event, Mode, Pace, Telemetry, TroubleKind
from gaitchain.live.safe_backend import SafeBackend
from gaitchain.live.telemetry_builder import TelemetryBuilder
from gaitchain.messages import Command

BEGAN_NS = 1_700_000_000_000_000_000
FALLEN = {
    "mode": Mode.STOPPED,
    "reason": "fell: the trunk leans by 51 deg, limit 50",
    "trouble": TroubleKind.FALL,
}
GIVEN_UP = FALLEN | {"reason": "given up: it does not stand after 3 tries"}
PACE = Pace(0.004, 10, 0, 1e-4, 2e-4, 1e-3, 250.0)


def told(robot, time_s=0.0, **changes):
    """One telemetry of a robot that stands and whose loop knows nothing else."""
    count = len(robot.legs.joint_names)
    stand = tuple(robot.legs.stand.tolist())
    values = {
        "time_s": time_s,
        "stamp_ns": BEGAN_NS + round(1e9 * time_s),
        "mode": Mode.STANDING,
        "reason": "",
        "driver": "",
        "asked": (0.0, 0.0, 0.0),
        "command": (0.0, 0.0, 0.0),
        "note": "",
        "status": "",
        "joint_position": stand,
        "joint_velocity": (0.0,) * count,
        "joint_target": stand,
        "joint_load": (math.nan,) * count,
        "angular_velocity": (0.0, 0.0, 0.0),
        "acceleration": (0.0, 0.0, 9.81),
        "estimated_tilt": (0.0, 0.0),
        "planned_zmp": (math.nan, math.nan),
        "support": "stand",
        "steps": 0,
        "choice": None,
        "pace": PACE,
        "link_sent": 0,
        "link_lost": 0,
        "link_note": "",
    }
    return Telemetry(**{**values, **changes})


def seen(walker, backend, time_s, target, *, truth=True, **changes):
    """The telemetry of a walker and the simulator as they are now."""
    safe = SafeBackend(backend, len(target))
    modes = SimpleNamespace(
        mode=Mode.WALKING,
        reason="",
        trouble=None,
        lease=DriverLease(),
        command=Command(),
        target=target,
        trip=SimpleNamespace(going=None),
        can_get_up=False,
    )
    events = SimpleNamespace(
        time_s=lambda: time_s,
        stamp_ns=lambda: BEGAN_NS + round(1e9 * time_s),
        recalled=tuple,
        take=tuple,
        take_refused=tuple,
    )
    builder = TelemetryBuilder(walker, safe, modes, events, PACE.period_s)
    row = builder.build(backend.read(), "", PACE)
    return replace(row, **({} if truth else {"truth": None}), **changes)


def walked(walker, backend, ticks, *, period_s=0.01, began_s=0.0, each=1):
    """Walk for so many control periods; yield the telemetry of each, up to the fall.

    Args:
        walker: with its command.
        backend: connected, of the same control period.
        ticks: at most.
        period_s: control period.
        began_s: what the loop's clock said before.
        each: of so many rows one has the simulator's truth.
    """
    for tick in range(ticks):
        target = walker.step(backend.read()).position
        time_s = began_s + tick * period_s
        if backend.fallen:
            yield seen(
                walker,
                backend,
                time_s,
                target,
                **FALLEN,
            )
            return
        yield seen(walker, backend, time_s, target, truth=tick % each == 0)
        backend.write(target)


def event(time_s, kind, text):
    """One event of the loop's clock."""
    return Event(time_s, BEGAN_NS + round(1e9 * time_s), kind, text)
