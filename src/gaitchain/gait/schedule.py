"""Schedules: commands to walk, segment by segment.

A segment holds a command for a time, "vx,vy,yaw@seconds", or for a number of steps as
in the paper's walks, "speed@cycles" (a cycle is two steps, left and right).
"""

import math
import re
from dataclasses import dataclass, replace

import numpy as np

from gaitchain.errors import CommandError
from gaitchain.gait.command_range import CommandRange, command_text, digits, ends_text
from gaitchain.messages import Command

PAPER_WALK = "0.04@half,0.08@2,0.02@half"
"""The paper's walk: half step, two cycles, last half step (Sec. VI-B)."""
LONGEST_S = 3600.0
"""Longest segment [s]."""
SHORTEST_S = 0.01
"""Shortest segment: one control period [s]."""
_MAX_STEPS = 10_000
_STEPPED = re.compile(r"^\s*([0-9.eE+-]+)\s*@\s*(half|[0-9.]+)\s*$")
_TIMED = re.compile(r"^([^,@]+)(?:,([^,@]+))?(?:,([^,@]+))?(?:,([^,@]+))?@([^,@]+)$")
_STEPPED_GRAMMAR = (
    'expected "speed@cycles" separated by commas, speed in m/s and cycles a multiple '
    f'of 0.5 or "half" (one step), as in "{PAPER_WALK}"'
)
_TIMED_GRAMMAR = (
    'expected "vx,vy,yaw@seconds" separated by semicolons, in m/s ahead and to the '
    "left and rad/s to the left (vy and yaw may be left out), as in "
    '"0.3,0,0@5;0.2,0,0.3@4"; a fourth number lowers the hips, in m'
)
_SHOWN = (
    *((0.7, 0.0, 0.0), (0.0, 0.7, 0.0), (0.0, -0.7, 0.0), (0.5, 0.0, 0.4)),
    *((0.0, 0.0, -0.8), (0.5, 0.2, 0.0), (-0.7, 0.0, 0.0)),
)
_SHOWN_S = 4.0


@dataclass(frozen=True)
class Segment:
    """One command, held for a time or for a number of steps."""

    command: Command
    duration_s: float = 0.0
    """Duration [s]; 0 if the segment counts steps."""
    steps: int = 0
    """Number of steps; 0 if the segment counts time."""


Schedule = tuple[Segment, ...]


def counts_steps(schedule: Schedule) -> bool:
    """Whether the length of the segments is given in steps, not in seconds."""
    return any(segment.steps for segment in schedule)


def parse_schedule(text: str, *, steps: bool | None = None) -> Schedule:
    """Read a schedule such as "0.04@half,0.08@2" or "0.3,0,0@5;0.2,0,0.3@4".

    Args:
        text: segments "speed@cycles" separated by commas, where "half" is half a
            cycle, one step; or "vx,vy,yaw@seconds" separated by semicolons. Speed 0
            stands still. The walk begins and ends standing.
        steps: whether the segments must be in steps or must be in seconds; None
            distinguishes them by their commas and semicolons, and reads "0.1@2" as two
            cycles.

    Returns:
        The segments.

    Raises:
        CommandError: a segment cannot be parsed; the message shows the grammar.
    """
    looks_timed = ";" in text or re.search(r",[^@,]*,|^[^@]*,", text) is not None
    if steps or (steps is None and not looks_timed):
        return tuple(map(_stepped_segment, text.split(",")))
    try:
        parts = text.strip().removesuffix(";").split(";")
        return tuple(_timed_segment(part.strip()) for part in parts)
    except CommandError as error:
        if steps is None and _TIMED_GRAMMAR in str(error):
            raise CommandError(f"{error}; or {_STEPPED_GRAMMAR}") from None
        raise


def format_schedule(schedule: Schedule) -> str:
    """Format a schedule for `parse_schedule`, with all digits."""
    if counts_steps(schedule):
        return ",".join(
            f"{digits(s.command.vx)}@{'half' if s.steps == 1 else digits(s.steps / 2)}"
            for s in schedule
        )
    return ";".join(
        f"{command_text(s.command)}@{digits(s.duration_s)}" for s in schedule
    )


def due_commands(schedule: Schedule, step_s: float) -> list[tuple[float, Command]]:
    """Return (start time [s], command) of each segment, and a stop after the last.

    Args:
        schedule: the segments.
        step_s: time of a step, for segments that count steps [s].
    """
    times = [s.duration_s or s.steps * step_s for s in schedule]
    ends = np.cumsum(times).round(6).tolist()
    commands = [*(segment.command for segment in schedule), Command()]
    return list(zip([0.0, *ends], commands, strict=True))


def ends_at(schedule: Schedule, step_s: float) -> float:
    """Return when the last command of a schedule ends [s].

    Args:
        schedule: the segments.
        step_s: time of a step, for segments that count steps [s].
    """
    return due_commands(schedule, step_s)[-1][0]


def step_commands(schedule: Schedule) -> list[Command]:
    """Return one command per step, and a stop after the last."""
    commands = [s.command for s in schedule for _ in range(s.steps)]
    return [*commands, Command(0.0)]


def lowered(schedule: Schedule, crouch: float) -> Schedule:
    """Return a schedule with lower hips in every segment that lowers none itself.

    Args:
        schedule: the segments.
        crouch: how much lower [m].
    """
    if not crouch:
        return schedule
    return tuple(
        replace(s, command=replace(s.command, crouch=s.command.crouch or crouch))
        for s in schedule
    )


def check_schedule(schedule: Schedule, most: CommandRange) -> None:
    """Refuse a schedule that a library cannot walk.

    The first and the last step of a schedule in steps may be slower than the slowest
    steady walk, as they are half steps.

    Raises:
        CommandError: a command is outside the range, or all of them are stops.
    """
    for i, segment in enumerate(schedule):
        half_step = segment.steps == 1 and i in (0, len(schedule) - 1)
        if segment.steps:
            _check_speed(segment.command.vx, 0.0 if half_step else most.vx[0], most)
        else:
            most.check(segment.command)
    if all(segment.command.stops for segment in schedule):
        above = "above" if counts_steps(schedule) else "other than"
        raise CommandError(f"the schedule only stands; give a speed {above} 0")


def random_steps(rng: np.random.Generator, low: float, high: float) -> Schedule:
    """Draw a schedule in steps within a speed range, with starts and stops.

    It has a half step at half the first speed, two to four segments of one or two
    cycles (one in four of the inner ones stands still for a cycle), and a half step at
    a quarter of the last speed, as in the paper's walk.

    Args:
        rng: source of randomness.
        low: slowest speed [m/s].
        high: fastest speed [m/s].

    Returns:
        The schedule.
    """
    # Whole millimetres per second within the range, so that the schedule's text is
    # exact.
    slow, fast = math.ceil(1000.0 * low), max(math.floor(1000.0 * high), 1)
    middle = []
    count = int(rng.integers(2, 5))
    for i in range(count):
        speed = int(rng.integers(min(slow, fast), fast + 1)) / 1000.0
        if 0 < i < count - 1 and rng.random() < 0.25:
            speed = 0.0
        steps = 2 if speed == 0.0 else 2 * int(rng.integers(1, 3))
        middle.append(Segment(Command(speed), steps=steps))
    ends = 500 * middle[0].command.vx, 250 * middle[-1].command.vx
    first, last = (
        Segment(Command(max(slow, round(end)) / 1000.0), steps=1) for end in ends
    )
    return (first, *middle, last)


def random_commands(
    rng: np.random.Generator,
    most: CommandRange,
    seconds: float = 30.0,
    every_s: float = 2.0,
) -> Schedule:
    """Draw a schedule of commands, uniformly distributed over a library's range.

    Args:
        rng: source of randomness.
        most: the library's range.
        seconds: total time [s].
        every_s: time per command [s]; the last one may be shorter.

    Returns:
        The schedule, rounded to 0.001 so that its text is exact.
    """
    count = max(math.ceil(round(seconds / every_s, 6)), 1)
    left = round(seconds - (count - 1) * every_s, 6)
    # A remainder too short for a segment of its own is left out.
    rest = [left] if left >= SHORTEST_S or count == 1 else []
    times = [every_s] * (count - 1) + rest
    return tuple(Segment(most.draw(rng), time_s) for time_s in times)


def show_walk(most: CommandRange) -> Schedule:
    """Return a schedule that demonstrates a range: ahead, aside, around, and stop.

    Directions that the range does not have are left out.
    """
    shown: list[Segment] = []
    for parts in _SHOWN:
        command = most.rounded_at(parts)
        if not command.stops and (not shown or command != shown[-1].command):
            shown.append(Segment(command, _SHOWN_S))
    return tuple(shown)


def _check_speed(speed: float, lowest: float, most: CommandRange) -> None:
    low, high = most.vx
    # The range is measured: values that round to its ends are accepted.
    far = high + 0.005 if high > 0.0 else 0.0
    if speed != 0.0 and not lowest - 0.005 <= speed <= far:
        raise CommandError(
            f"{speed:g} m/s in the schedule: this library walks "
            f"{ends_text(low, high, 'm/s')}, and 0 to stand"
        )


def _stepped_segment(part: str) -> Segment:
    where = f"schedule segment {part.strip()!r}"
    match = _STEPPED.match(part)
    try:
        speed = float(match[1]) if match else math.nan
        cycles = (
            0.5 if match and match[2] == "half" else float(match[2] if match else "")
        )
    except ValueError:
        raise CommandError(f"{where}: {_STEPPED_GRAMMAR}") from None
    if not (math.isfinite(speed) and speed >= 0.0):
        raise CommandError(f"{where}: a speed is 0 m/s or more")
    steps = 2.0 * cycles
    if not (1 <= steps <= _MAX_STEPS and steps == round(steps)):
        raise CommandError(
            f"{where}: cycles are a multiple of 0.5, 0.5 to {_MAX_STEPS // 2}"
        )
    return Segment(Command(speed), steps=int(steps))


def _timed_segment(part: str) -> Segment:
    where = f"schedule segment {part!r}"
    match = _TIMED.match(part)
    try:
        numbers = [float(text or "0") for text in (match.groups() if match else "?")]
    except ValueError:
        raise CommandError(f"{where}: {_TIMED_GRAMMAR}") from None
    *values, duration_s = numbers
    if not all(map(math.isfinite, values)):
        raise CommandError(f"{where}: a speed or a crouch is a finite number")
    if not SHORTEST_S <= duration_s <= LONGEST_S:
        raise CommandError(f"{where}: a time is {SHORTEST_S:g} to {LONGEST_S:g} s")
    return Segment(Command(*values), duration_s)
