"""Run a walker in the simulator and record the walk."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby, repeat

from gaitchain.analysis.record import WalkRecord
from gaitchain.analysis.recorder import Recorder, WalkSample, observe
from gaitchain.backends.base import Backend
from gaitchain.backends.model import ModelBackend
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.errors import CommandError
from gaitchain.gait.schedule import Schedule, counts_steps, due_commands, step_commands
from gaitchain.messages import CONTROL_PERIOD_S, Array, Command
from gaitchain.walker.gait import EndedStep
from gaitchain.walker.place import Place
from gaitchain.walker.walker import Walker
from gaitchain.walker.waypoints import Near, Way

SETTLE_S = 1.0
"""Standing time before the first and after the last step [s]."""
SETTLE_TICKS = round(SETTLE_S / CONTROL_PERIOD_S)
"""The same in control periods."""
STOP_S, STOP_STEPS = 3.0, 3.0
"""Time limit for coming to a stand after a timed schedule: the longer of these seconds
and these steps."""
# Of the time limit for a way point. RES takes 7 to 18 s more than at full speed, for
# turning, slowing down and coming to a stand; after a slip or a push, more.
_WAY_S, _WAY_PARTS = 60.0, 2.0
_LOOK_TICKS = 10  # between two looks at the way to a way point
_BASE = 7  # generalised coordinates of the trunk


@dataclass(frozen=True)
class Walked:
    """Result of a walk that was not recorded."""

    steps: tuple[tuple[int, int], ...]
    """First and last pose of each step that was begun."""
    fell_at_s: float | None
    """Time of the fall [s]; None without one."""
    ended: tuple[EndedStep, ...] = ()
    """What each step was off that ended and was followed by another."""
    base: tuple[tuple[float, ...], ...] = ()
    """(7) pose of the base in each control period, of a walk that was followed: place
    in the world [m] and quaternion."""
    stood: bool = False
    """Whether a walk that was followed ended standing for `SETTLE_S`."""


def run_schedule(
    walker: Walker, backend: MujocoBackend, schedule: Schedule
) -> WalkRecord:
    """Walk a schedule from standing to standing, or until the robot falls.

    A schedule in steps is given to the walker at the start; the commands of a timed one
    at their times, and after the last one the robot has 3 s, or three steps, to stop.

    Args:
        walker: a walker in its initial state.
        backend: the simulator.
        schedule: the commands.

    Returns:
        The record; it ends at the fall if there is one. Of a robot that falls while it
        settles it has that, with times below 0.
    """
    loop = _RecordedLoop(walker, backend)
    return loop.record(_carry_out(loop, schedule))


def follow_schedule(
    walker: Walker, backend: MujocoBackend, schedule: Schedule
) -> Walked:
    """Walk as `run_schedule` does, without a record: in half the time.

    Arguments are those of `run_schedule`.
    """
    loop = _FollowedLoop(walker, backend)
    *_, rest = _carry_out(loop, schedule)
    stood = loop.fell_at_s is None and loop.ticks - rest >= SETTLE_TICKS
    return replace(loop.walked(), stood=stood)


def _carry_out(loop: "WatchedLoop", schedule: Schedule) -> tuple[int, ...]:
    """Walk a schedule; return the periods in which steps began, or were to begin."""
    timing = loop.walker.library.timing
    due = due_commands(schedule, timing.step)
    if counts_steps(schedule):
        return _count_steps(loop, schedule, due)
    loop.give(due)
    stop_s = max(STOP_S, STOP_STEPS * timing.step)
    latest, stood = loop.ticks + _tick(stop_s) + SETTLE_TICKS, 0
    while stood < SETTLE_TICKS and loop.ticks < latest:
        if not loop.run_until(loop.ticks + 1):
            break
        # A robot that stands may make another step to put its feet side by side.
        stood = stood + 1 if loop.walker.standing else 0
    return (*loop.step_ticks, loop.ticks - stood)


@dataclass(frozen=True)
class Visit:
    """How a robot came to a way point."""

    goal: Place
    place: Place
    """Where it is by its own steps."""
    off: Place
    """The way point from where it really is."""
    time_s: float
    """Since the start of the walk [s]."""
    arrived: bool
    """Whether it stood there within the time limit."""
    given_up_s: float | None = None
    """The time limit, where it did not but walked on [s]."""


def run_waypoints(
    walker: Walker,
    backend: MujocoBackend,
    goals: Sequence[Place],
    near: Near | None = None,
    seconds: float | None = None,
    crouch: float = 0.0,
) -> tuple[WalkRecord, list[Visit]]:
    """Walk from way point to way point, and stand at each.

    Args:
        walker: a walker of strides in its initial state.
        backend: the simulator.
        goals: the way points, from where the robot stands.
        near: how near a way point counts as there; see `Walker.go_to`.
        seconds: time limit for each; by default 60 s and twice the time that the way
            takes at full speed [s].
        crouch: hips lower by this on the way [m].

    Returns:
        The record, which ends at the fall if there is one, and how it came to each way
        point until then.

    Raises:
        CommandError: the gait does not measure where the robot is.
    """
    if walker.place is None or walker.stop_place is None:
        raise CommandError("way points need a library of strides, as `brisk` builds")
    loop = _RecordedLoop(walker, backend)
    start, visits = _true_place(backend), list[Visit]()
    for goal in goals:
        way = Way.of(walker.library, goal, near, crouch)
        limit_s = _time_limit(way, walker.place) if seconds is None else seconds
        arrived, latest = False, loop.ticks + _tick(limit_s)
        while not arrived and loop.ticks < latest and loop.fell_at_s is None:
            there = way.ends_at(walker.place)
            loop.give_now(way.command(walker.stop_place, stepping=walker.gait.stepping))
            loop.run_until(loop.ticks + _LOOK_TICKS)
            arrived = there and walker.standing
        off, time_s = goal.seen_from(_true_place(backend).seen_from(start)), loop.time_s
        given_up_s = None if arrived or loop.fell_at_s is not None else limit_s
        visits.append(Visit(goal, walker.place, off, time_s, arrived, given_up_s))
        if loop.fell_at_s is not None:
            break
    return loop.record((*loop.step_ticks, loop.ticks)), visits


def _time_limit(way: Way, place: Place) -> float:
    """Return the time after which a way point is given up [s]."""
    fast_s = way.time_from(place)
    return _WAY_S + (_WAY_PARTS * fast_s if math.isfinite(fast_s) else 0.0)


def _true_place(backend: MujocoBackend) -> Place:
    """Return the middle between the feet and the trunk's heading, in the world."""
    x, y, _ = backend.foot_positions().mean(axis=0).tolist()
    return Place(x, y, backend.heading)


def run_unrecorded(
    walker: Walker, backend: MujocoBackend | ModelBackend, schedule: Schedule
) -> Walked:
    """Walk a schedule without a record; a timed one ends without a stop.

    Args:
        walker: a walker in its initial state.
        backend: the simulator.
        schedule: the commands.
    """
    loop = WatchedLoop(walker, backend)
    *due, (end_s, _) = due_commands(schedule, walker.library.timing.step)
    if counts_steps(schedule):
        walker.follow(step_commands(schedule))
        end_s += SETTLE_S
    else:
        loop.give(due)
    loop.run_until(_tick(end_s))
    return loop.walked()


def _count_steps(
    loop: "WatchedLoop", schedule: Schedule, due: list[tuple[float, Command]]
) -> tuple[int, ...]:
    """Walk a schedule in steps, which have one command each and equal duration."""
    commands = step_commands(schedule)
    step_s = loop.walker.library.timing.step
    step_ticks = tuple(_first_tick(i * step_s) for i in range(len(commands)))
    loop.walker.follow(commands)
    loop.commands += [next(same) for _, same in groupby(due, lambda pair: pair[1])]
    loop.run_until(step_ticks[-1] + SETTLE_TICKS)
    return step_ticks


def settling(walker: Walker, backend: Backend) -> Iterator[Array]:
    """Yield the targets of a robot that settles, each to be written before the next.

    It is held in its stand until it is still; then its walker runs, standing, until it
    knows the vertical.
    """
    yield from repeat(walker.standing_targets.position, SETTLE_TICKS)
    for _ in range(_tick(walker.gait.rest_s)):
        yield walker.step(backend.read()).position


class WatchedLoop:
    """The control loop of a walker and a simulator."""

    def __init__(self, walker: Walker, backend: MujocoBackend | ModelBackend) -> None:
        """Let the robot stand and settle, then start the clock of the pushes."""
        self.walker, self.backend = walker, backend
        self.ticks = 0
        self.fell_at_s: float | None = None
        backend.connect(walker.stand)
        backend.stop_clock()
        self.settle()
        backend.start_clock()
        self._start_s = backend.read().time
        self.steps: list[tuple[int, int]] = []
        """First and last pose of each step so far."""
        self.ended: list[EndedStep] = []
        """What the steps before the latest were off."""
        self.step_ticks: list[int] = []
        """Control period in which each step began."""
        self.commands: list[tuple[float, Command]] = []
        """(time [s], command) of the commands given so far."""
        self._noted_steps = 0

    def settle(self) -> None:
        """Let the robot stand until it is still and the walker knows its vertical."""
        for target in settling(self.walker, self.backend):
            self.backend.write(target)

    def give(self, due: list[tuple[float, Command]]) -> None:
        """Run the loop and give each command at its time."""
        for time_s, command in due:
            self.run_until(_tick(time_s))
            self.walker.command(command)
            self.commands.append((time_s, command))

    def give_now(self, command: Command) -> None:
        """Give a command, and note it where it is the first one or a step has begun."""
        self.walker.command(command)
        if not self.commands or len(self.steps) > self._noted_steps:
            self.commands.append((self.time_s, command))
            self._noted_steps = len(self.steps)

    @property
    def time_s(self) -> float:
        """Since the start of the walk [s]."""
        return self.ticks * CONTROL_PERIOD_S

    def run_until(self, ticks: int) -> bool:
        """Run up to a number of periods or to a fall; return whether none occurred."""
        while self.ticks < ticks and self.fell_at_s is None:
            sensors = self.backend.read()
            targets = self.walker.step(sensors)
            self.note(sensors.time - self._start_s, targets.position)
            self.backend.write(targets.position)
            self.ticks += 1
            if self.backend.fallen:
                self.fell_at_s = self.time_s
        return self.fell_at_s is None

    def walked(self) -> Walked:
        """Return what was walked."""
        return Walked(tuple(self.steps), self.fell_at_s, tuple(self.ended))

    def note(self, time_s: float, target: Array) -> None:
        """Store the step that the walker has just begun, if any."""
        gait = self.walker.gait
        if gait.steps > len(self.steps):
            self.steps.append((gait.state.first, gait.state.target))
            self.step_ticks.append(self.ticks)
            if gait.ended is not None:
                self.ended.append(gait.ended)


class _FollowedLoop(WatchedLoop):
    """The same loop, which notes where the base is."""

    def __init__(self, walker: Walker, backend: MujocoBackend) -> None:
        super().__init__(walker, backend)
        self._base = backend.data.qpos[:_BASE]
        self._noted: list[tuple[float, ...]] = []

    def note(self, time_s: float, target: Array) -> None:
        """Note the base before the target is written."""
        self._noted.append(tuple(self._base.tolist()))
        super().note(time_s, target)

    def walked(self) -> Walked:
        return replace(super().walked(), base=tuple(self._noted))


class _RecordedLoop(WatchedLoop):
    """The same loop with a record."""

    def __init__(self, walker: Walker, backend: MujocoBackend) -> None:
        self._simulator, library = backend, walker.library
        self._recorder = Recorder(library.robot, backend, gait=library.family.name)
        self._before: list[WalkSample] = []
        super().__init__(walker, backend)

    def settle(self) -> None:
        """Let the robot stand; if it falls, that is recorded in place of a walk."""
        gait, rows = self.walker.gait, []
        rest, targets = _tick(gait.rest_s), settling(self.walker, self.backend)
        for tick, target in enumerate(targets, start=-SETTLE_TICKS - rest):
            time_s = tick * CONTROL_PERIOD_S
            row = observe(time_s, target, gait, self._simulator)
            if tick < -rest:  # the walker has not measured anything yet
                row = row._replace(estimated_tilt=(math.nan, math.nan))
            rows.append(row)
            self.backend.write(target)
            if self.backend.fallen:
                self.fell_at_s, self._before = time_s + CONTROL_PERIOD_S, rows
                return

    def note(self, time_s: float, target: Array) -> None:
        """Record the state of the robot before the target is written."""
        self._recorder.add(observe(time_s, target, self.walker.gait, self._simulator))
        super().note(time_s, target)

    def record(self, step_ticks: tuple[int, ...]) -> WalkRecord:
        """Return the record, with the rows at which steps began."""
        pushes = tuple((p.at_s, str(p)) for p in self._simulator.known_pushes)
        given = tuple(c for c in self.commands if _tick(c[0]) <= self.ticks)
        if self._before:
            given = ((self._before[0].time_s, Command()),)
        for sample in self._before:
            self._recorder.add(sample)
        began = tuple(len(self._before) + tick for tick in step_ticks)
        timing = self.walker.library.timing
        return self._recorder.record(began, self.fell_at_s, timing, pushes, given)


def _tick(time_s: float) -> int:
    return round(time_s / CONTROL_PERIOD_S)


def _first_tick(time_s: float) -> int:
    """Return the first control period that does not begin before a time."""
    return math.ceil(round(time_s / CONTROL_PERIOD_S, 6))
