"""Run a walker on the simulator, tick by tick, and record what happens."""

from itertools import groupby

from gaitchain.analysis.record import WalkRecord
from gaitchain.analysis.recorder import Recorder, observe
from gaitchain.backends.mujoco import CONTROL_PERIOD_S, MujocoBackend
from gaitchain.gait.schedule import Schedule, SpeedSchedule, is_timed, step_commands
from gaitchain.gait.timed_schedule import TimedSchedule, command_times
from gaitchain.messages import Array, Command
from gaitchain.walker.walker import Walker

SETTLE_S = 1.0
"""Standing still before the first and after the last step [s]."""
STOP_S, STOP_STEPS = 3.0, 3.0
"""How long a robot may take to a stand after a timed schedule, the longer one."""
_SETTLE_TICKS = round(SETTLE_S / CONTROL_PERIOD_S)


def run_schedule(
    walker: Walker, backend: MujocoBackend, schedule: Schedule
) -> WalkRecord:
    """Walk a schedule from standing to standing, or until the robot falls.

    The speeds of the paper's kind are known to the walker beforehand; a timed command
    comes when it is due, and after the last one the robot has 3 s, or three steps, to
    come to a stand.

    Args:
        walker: a fresh walker.
        backend: the simulator.
        schedule: the commands.

    Returns:
        The record; it ends at the fall if there is one.
    """
    if is_timed(schedule):
        return _run_timed(walker, backend, schedule)
    return _run_speeds(walker, backend, schedule)


def run_unrecorded(
    walker: Walker, backend: MujocoBackend, schedule: TimedSchedule
) -> float | None:
    """Walk a timed schedule, without a stop at its end and without a record.

    Args:
        walker: a fresh walker.
        backend: the simulator.
        schedule: the commands.

    Returns:
        When the robot fell; None if it did not [s].
    """
    loop = _Loop(walker, backend)
    *commands, (end_s, _) = command_times(schedule)
    for time_s, command in commands:
        loop.run_until(_tick(time_s))
        walker.command(command)
    loop.run_until(_tick(end_s))
    return loop.fell_at_s


def _run_speeds(
    walker: Walker, backend: MujocoBackend, schedule: SpeedSchedule
) -> WalkRecord:
    """One command per step; all steps take the same time."""
    step_s = walker.generator.library.timing.step
    commands = step_commands(schedule)
    steps = len(commands) - 1
    step_ticks = tuple(_tick(step_s) * i for i in range(steps + 1))
    ticks = step_ticks[-1] + _SETTLE_TICKS
    loop = _RecordedLoop(walker, backend)
    walker.follow(commands)
    timed = zip((step_s * i for i in range(steps + 1)), commands, strict=True)
    loop.commands += [next(same) for _, same in groupby(timed, lambda pair: pair[1])]
    loop.run_until(ticks)
    return loop.record(step_ticks)


def _run_timed(
    walker: Walker, backend: MujocoBackend, schedule: TimedSchedule
) -> WalkRecord:
    """Each command at its time, a stop, and time to come to a stand."""
    commands = command_times(schedule)
    stop_s = max(STOP_S, STOP_STEPS * walker.generator.library.timing.step)
    loop = _RecordedLoop(walker, backend)
    for time_s, command in commands:
        loop.run_until(_tick(time_s))
        walker.command(command)
        loop.commands.append((time_s, command))
    latest, stood = loop.ticks + _tick(stop_s) + _SETTLE_TICKS, 0
    while stood < _SETTLE_TICKS and loop.ticks < latest:
        if not loop.run_until(loop.ticks + 1):
            break
        # A robot may stand, and then take a step to put its feet right.
        stood = stood + 1 if walker.standing else 0
    end = loop.ticks - stood
    return loop.record((*loop.step_ticks, end))


class _Loop:
    """Sensors to the walker and targets to the simulator, period after period."""

    def __init__(self, walker: Walker, backend: MujocoBackend) -> None:
        """Stand, let the robot settle, and start the clock of the pushes."""
        self.walker, self.backend = walker, backend
        stand = walker.stand
        backend.connect(stand)
        backend.stop_clock()
        for _ in range(_SETTLE_TICKS):
            backend.write(stand)
        for _ in range(_SETTLE_TICKS if walker.generator.library.dynamic else 0):
            # Standing still, the walker learns the vertical and the gyro's bias.
            backend.write(walker.step(backend.read()).position)
        backend.start_clock()
        self._start_s = backend.read().time
        self.ticks = 0
        self.fell_at_s: float | None = None

    def run_until(self, ticks: int) -> bool:
        """Go on to a number of ticks or to the fall; return whether it still stands."""
        while self.ticks < ticks and self.fell_at_s is None:
            sensors = self.backend.read()
            targets = self.walker.step(sensors)
            self.note(sensors.time - self._start_s, targets.position)
            self.backend.write(targets.position)
            self.ticks += 1
            if self.backend.fallen:
                self.fell_at_s = self.ticks * CONTROL_PERIOD_S
        return self.fell_at_s is None

    def note(self, time_s: float, target: Array) -> None:
        """See what the walker decided; nothing by default."""


class _RecordedLoop(_Loop):
    """The same, all of it recorded."""

    def __init__(self, walker: Walker, backend: MujocoBackend) -> None:
        super().__init__(walker, backend)
        self._library = walker.generator.library
        self._recorder = Recorder(self._library.biped, backend)
        self._steps = 0
        self.step_ticks: list[int] = []
        """Ticks in which a step began."""
        self.commands: list[tuple[float, Command]] = []
        """What was asked for, and when [s]."""

    def note(self, time_s: float, target: Array) -> None:
        """Record the robot as it is now, before it gets the target."""
        self._recorder.add(observe(time_s, target, self.walker, self.backend))
        if self.walker.steps > self._steps:
            self._steps = self.walker.steps
            self.step_ticks.append(self.ticks)

    def record(self, step_ticks: tuple[int, ...]) -> WalkRecord:
        """Return what was recorded, with the rows at which steps began."""
        pushes = tuple(
            (p.at_s, f"a push of {p.impulse_ns:g} N s to {p.direction_deg:g} deg")
            for p in self.backend.world.push
        )
        given = tuple(c for c in self.commands if _tick(c[0]) <= self.ticks)
        return self._recorder.record(
            step_ticks, self.fell_at_s, self._library.timing, pushes, given
        )


def _tick(time_s: float) -> int:
    return round(time_s / CONTROL_PERIOD_S)
