"""Rate, delay, jitter and lost answers, against what the library was qualified with."""

import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gaitchain.backends.base import Backend
from gaitchain.commission.bench import Bench, Verdict
from gaitchain.commission.lateness import Lateness, failed, lateness
from gaitchain.errors import BackendError
from gaitchain.gait.library import GaitLibrary
from gaitchain.live.clock import Clock, Pacer
from gaitchain.messages import CONTROL_PERIOD_S, Array
from gaitchain.robot.robot import Robot
from gaitchain.sim.robot_faults import world_of
from gaitchain.sim.world import World

_SECONDS = 4.0
_MOST_LOST, _LEAST_RATE = 0.01, 0.99
_DELAY, _JITTER, _BUS = "delay_s", "jitter_s", "bus_hz"


@dataclass(frozen=True)
class Timing:
    """What was measured of the control periods."""

    rate_hz: float
    delays_s: Array
    """(N,) from the begin of a read to the last byte of the goals [s]."""
    late_p99_s: float
    """How late periods begin: 99 of 100 are not later [s]."""
    lost: float
    """Part of the requested answers that did not arrive."""
    missed: Array
    """(2 n,) how often each joint did not answer."""
    imu_missed: int = 0
    """How often the IMU did not; 0 of one that never does, or is not on the bus."""
    late: Lateness | None = None
    """How late answers come by themselves; None where that is not known."""

    @property
    def delay_s(self) -> float:
        """Median of the delays [s]."""
        return float(np.median(self.delays_s))

    @property
    def jitter_s(self) -> float:
        """By how much 99 of 100 targets are not later than the median one [s]."""
        spread = float(np.percentile(self.delays_s, 99)) - self.delay_s
        return spread + self.late_p99_s


def qualified_delay_s(library: GaitLibrary) -> float:
    """Return the largest delay, with jitter, in which a library was passed [s].

    Those of the gate's worlds, and of the grid's worlds in which enough walks held. A
    robot that was identified walked there with its own delay in addition, of which its
    log tells what its bus took: the rest is of its servos, and not measured here.
    """
    gate = library.qualification.gate
    found: list[World] = []
    if gate is not None and gate.passed:
        delay_s, jitter_s = (_upper(gate.worlds.get(n)) for n in (_DELAY, _JITTER))
        found.append(World(delay_s=delay_s, jitter_s=jitter_s))
    found += [
        World(delay_s=at.get(_DELAY, 0.0), jitter_s=at.get(_JITTER, 0.0))
        for at in _passed_levels(library)
    ]
    walked = [world_of(_on_its_bus(library.robot), world) for world in found]
    return max((world.delay_s + world.jitter_s for world in walked), default=0.0)


def _on_its_bus(robot: Robot) -> Robot:
    """Return an identified robot whose delay is that of its bus, as far as known."""
    own = robot.identified
    if own is None or own.turnaround_s is None:
        return robot
    return robot.as_identified(replace(own, delay_s=own.turnaround_s))


def qualified_rate_hz(library: GaitLibrary) -> float:
    """Return the least rate of control at which a library was passed [Hz].

    All walks of a build have the control period of simulation; those of the grid's
    worlds of a slower bus, in which enough of them held, have its rate.
    """
    slower = [at[_BUS] for at in _passed_levels(library) if _BUS in at]
    return min([1.0 / CONTROL_PERIOD_S, *slower])


def _passed_levels(library: GaitLibrary) -> list[dict[str, float]]:
    """Return what is not nominal in each of the grid's worlds where enough held."""
    grid = library.qualification.grid
    if grid is None:
        return []
    passed = [c for c in grid.cells if c.passes >= grid.share * c.runs > 0]
    return [dict(cell.numbers) for cell in passed]


def _upper(span: Any) -> float:
    """Return the upper end of what a world draws from."""
    if span is None:
        return 0.0
    return float(np.max(span))


def measure(
    backend: Backend, write_s: float, period_s: float, seconds: float = _SECONDS
) -> Timing:
    """Read and write for a while, with the torque off.

    Args:
        backend: the robot, connected.
        write_s: time that goals take on the line [s].
        period_s: control period [s].
        seconds: for how long [s].

    Raises:
        BackendError: no servo answers.
    """
    pacer, delays, came, felt = Pacer(Clock(), period_s), [], [], []
    goal = np.nan_to_num(backend.read().joint_position)
    before, begin = backend.health(), time.monotonic()
    count = max(2, round(seconds / period_s))
    for _ in range(count):
        pacer.wait()
        start = time.monotonic()
        sensors = backend.read()
        angles = sensors.joint_position
        goal = np.where(np.isfinite(angles), angles, goal)
        backend.write(goal)
        delays.append(time.monotonic() - start + write_s)
        came.append(np.isfinite(angles))
        inertial = *sensors.angular_velocity, *sensors.acceleration
        felt.append(bool(np.isfinite(inertial).all()))
    took_s, after = time.monotonic() - begin, backend.health()
    lost = (after.lost - before.lost) / max(after.sent - before.sent, 1)
    return Timing(
        rate_hz=(count - 1) / max(took_s - delays[-1], 1e-9),
        delays_s=np.array(delays),
        late_p99_s=pacer.pace.late_p99_s,
        lost=lost,
        missed=count - np.sum(came, axis=0),
        imu_missed=felt.count(False) if any(felt) else 0,
    )


def check_timing(bench: Bench) -> Verdict:
    """Measure the control periods with the torque off, and judge them."""
    qualified_s = qualified_delay_s(bench.library)
    try:
        with bench.robot() as backend:
            bench.progress("rate and delay", 0, 1)
            timing = measure(backend, backend.load.write_s, bench.period_s)
            bench.progress("rate and delay", 1, 1)
    except BackendError as error:
        return failed(bench, str(error), "mend the bus; `--from bus` checks it")
    return judge(bench, replace(timing, late=lateness(bench)), qualified_s)


def judge(bench: Bench, timing: Timing, qualified_s: float) -> Verdict:
    """Compare what was measured with what the library was qualified with."""
    late, latest_s = timing.late, timing.delay_s + timing.jitter_s
    figures = {
        "rate_hz": timing.rate_hz,
        "qualified_rate_hz": qualified_rate_hz(bench.library),
        "delay_ms": 1e3 * timing.delay_s,
        "jitter_ms": 1e3 * timing.jitter_s,
        "qualified_delay_ms": 1e3 * qualified_s,
        "lost_percent": 100.0 * timing.lost,
        "answer_ms": 1e3 * late.load.turn_s if late and late.known else None,
    }
    said = (
        f"{timing.rate_hz:.1f} Hz; targets {1e3 * timing.delay_s:.1f} ms after the "
        f"measurement, 99 of 100 within {1e3 * latest_s:.1f} ms (qualified: "
        f"{1e3 * qualified_s:.0f} ms); {100.0 * timing.lost:.2f} % of the answers lost"
    )
    if late and late.said:
        said = f"{said}; {late.said}"
    todo = _remedy(bench, timing, qualified_s)
    return Verdict("no-go" if todo else "go", said, todo, figures)


def _remedy(bench: Bench, timing: Timing, qualified_s: float) -> str:
    """Say what to do about what was measured; empty if nothing.

    Late answers count as lost ones and delay control, so they come first.
    """
    wrong = _loss(bench, timing) or _slowness(bench, timing, qualified_s)
    if wrong and timing.late and timing.late.explains:
        return f"answers come late: {timing.late.todo}; then --from timing again"
    return wrong


def _loss(bench: Bench, timing: Timing) -> str:
    """Say what to do about lost answers; empty if few are."""
    periods = len(timing.delays_s)
    if max(timing.lost, timing.imu_missed / periods) <= _MOST_LOST:
        return ""
    names = *bench.library.robot.legs.joint_names, "the IMU"
    missed = [*timing.missed, timing.imu_missed]
    worst = int(np.argmax(missed))
    which = f"{names[worst]}, which missed {missed[worst]} of {periods}"
    where = f", most of all before {which}" if missed[worst] else ""
    return (
        f"at most {_MOST_LOST:.0%} may be lost, and of the IMU's: check cables and "
        f"plugs{where}; then supply, ground, and a lower baud rate"
    )


def _slowness(bench: Bench, timing: Timing, qualified_s: float) -> str:
    """Say what to do about control that is slow or late; empty if it is not."""
    slow = _too_slow(bench, timing)
    if slow:
        return slow
    if timing.delay_s + timing.jitter_s > qualified_s:
        return (
            "shorten the delay: latency timer 1 ms, Return Delay Time 0, a higher baud "
            "rate, a computer with less to do; or qualify the library for later "
            "targets: `gaitchain qualify` walks it with delays of 10 to 30 ms"
        )
    return ""


def _too_slow(bench: Bench, timing: Timing) -> str:
    """Say what to do about control periods that are longer than they should be."""
    least_hz = qualified_rate_hz(bench.library)
    if bench.rate_hz < _LEAST_RATE * least_hz:
        return (
            f"--rate {bench.rate_hz:g} is slower than the library was qualified for, "
            f"{least_hz:g} Hz: give --rate {least_hz:g} or more, or a library that "
            "holds on a slower bus: `gaitchain qualify` walks it with 33 and 50 Hz"
        )
    if timing.rate_hz < _LEAST_RATE * bench.rate_hz:
        return (
            f"{bench.rate_hz:g} Hz were asked for: set the adapter's latency timer to "
            "1 ms, raise the baud rate, end other programs, or lower --rate, to "
            f"{least_hz:g} at least"
        )
    return ""
