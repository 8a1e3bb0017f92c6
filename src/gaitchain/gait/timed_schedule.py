"""Timed schedules: a speed ahead, to the left and around, each for some seconds.

They are for dynamic walks; `schedule` reads them and the paper's.
"""

import math
import re
from collections.abc import Iterable
from dataclasses import astuple, dataclass

import numpy as np

from gaitchain.errors import CommandError
from gaitchain.gait.library import CommandRange
from gaitchain.messages import Command

TIMED_GRAMMAR = (
    'expected "vx,vy,yaw@seconds" separated by semicolons, in m/s ahead and to the '
    "left and rad/s to the left (vy and yaw may be left out), as in "
    '"0.3,0,0@5;0.2,0,0.3@4"'
)
LONGEST_S = 3600.0
"""Of a segment [s]."""
SHORTEST_S = 0.01
"""A control period [s]."""
_SEGMENT = re.compile(r"^([^,@]+)(?:,([^,@]+))?(?:,([^,@]+))?@([^,@]+)$")
_UNITS = {"vx": "m/s ahead", "vy": "m/s to the left", "yaw_rate": "rad/s to the left"}
_ROUND = 0.005  # m/s, rad/s: a range is measured; what rounds to its ends is inside
_ROUND_SHARE = 0.02  # the same, of the most at once


@dataclass(frozen=True)
class TimedSegment:
    """One command, kept for a time."""

    command: Command
    duration_s: float


TimedSchedule = tuple[TimedSegment, ...]


def parse_timed(text: str) -> TimedSchedule:
    """Read a schedule such as "0.3@5;0.2,0,0.3@4"; see `schedule.parse_schedule`."""
    parts = text.strip().removesuffix(";").split(";")
    return tuple(_parse_segment(part.strip()) for part in parts)


def format_timed(schedule: TimedSchedule) -> str:
    """Write a schedule as `parse_timed` reads it, every digit of it."""
    return ";".join(
        f"{','.join(map(_digits, astuple(s.command)))}@{_digits(s.duration_s)}"
        for s in schedule
    )


def command_times(schedule: TimedSchedule) -> list[tuple[float, Command]]:
    """Return when each command is due [s], and a stop after the last."""
    ends = np.cumsum([segment.duration_s for segment in schedule]).round(6).tolist()
    commands = [*(segment.command for segment in schedule), Command()]
    return list(zip([0.0, *ends], commands, strict=True))


def check_commands(schedule: TimedSchedule, most: CommandRange) -> None:
    """Refuse a schedule that the library cannot walk.

    Raises:
        CommandError: a number is outside the range, a command asks for more than can
            be done at once, or all of them stand.
    """
    for segment in schedule:
        _check_command(segment.command, most)
    if all(segment.command.stops for segment in schedule):
        raise CommandError("the schedule only stands; give a speed other than 0")


def share(command: Command, most: CommandRange) -> float:
    """Return how much of the most that can be done at once a command asks for.

    Each number's part of the most in its direction, added up; inf where there is none.
    """
    total = 0.0
    for name in _UNITS:
        value, (low, high) = getattr(command, name), getattr(most, name)
        end = high if value > 0.0 else low
        if value != 0.0:
            total += value / end if end * value > 0.0 else math.inf
    return total


def random_timed(
    rng: np.random.Generator,
    most: CommandRange,
    seconds: float = 30.0,
    every_s: float = 2.0,
) -> TimedSchedule:
    """Draw a new command every so often, uniformly over all that a library can do.

    The parts of the most add up to at most 1: commands fill a cross polytope. Numbers
    are whole millimetres and milliradians per second, so that the text says it all.

    Args:
        rng: source of randomness.
        most: the library's range.
        seconds: time in all [s].
        every_s: time per command, the last one's may be shorter [s].

    Returns:
        The schedule.
    """
    count = max(math.ceil(round(seconds / every_s, 6)), 1)
    left = round(seconds - (count - 1) * every_s, 6)
    # A rest too short to be a segment of its own is left out.
    rest = [left] if left >= SHORTEST_S or count == 1 else []
    times = [every_s] * (count - 1) + rest
    return tuple(TimedSegment(_draw(rng, most), time_s) for time_s in times)


def show_walk(most: CommandRange) -> TimedSchedule:
    """Return a walk that shows what a library can do: ahead, aside, around, and stop.

    Directions that it does not know are left out.
    """
    parts = [(0.7, 0.0, 0.0), (0.0, 0.7, 0.0), (0.0, -0.7, 0.0), (0.5, 0.0, 0.4)]
    parts += [(0.0, 0.0, -0.8), (0.5, 0.2, 0.0), (-0.7, 0.0, 0.0)]
    shown: list[TimedSegment] = []
    for part in parts:
        command = _part_of(part, most)
        if not command.stops and (not shown or command != shown[-1].command):
            shown.append(TimedSegment(command, 4.0))
    return tuple(shown)


def _draw(rng: np.random.Generator, most: CommandRange) -> Command:
    ranges = np.array([most.vx, most.vy, most.yaw_rate])
    ranges = np.column_stack([ranges[:, 0].clip(max=0), ranges[:, 1].clip(min=0)])
    width = ranges[:, 1] - ranges[:, 0]
    # Each part of space between the axes has a volume like the product of its ends.
    ahead = rng.random(3) * width < ranges[:, 1]
    parts = np.zeros(3)
    known = width > 0.0
    parts[known] = rng.dirichlet(np.ones(known.sum() + 1))[:-1]
    return _part_of(np.where(ahead, parts, -parts), most)


def _part_of(parts: Iterable[float], most: CommandRange) -> Command:
    """Return parts of the most, signed, in whole thousandths towards 0."""
    values = []
    for name, part in zip(_UNITS, map(float, parts), strict=True):
        low, high = getattr(most, name)
        end = max(high, 0.0) if part > 0.0 else max(-low, 0.0)
        values.append(math.trunc(1000.0 * part * end + 1e-9) / 1000.0)
    return Command(*values)


def _check_command(command: Command, most: CommandRange) -> None:
    for name, unit in _UNITS.items():
        value, (low, high) = getattr(command, name), getattr(most, name)
        if value != 0.0 and not low - _ROUND <= value <= high + _ROUND:
            raise CommandError(
                f"{value:g} {unit}: this library walks {low:.3f} to "
                f"{high:.3f} {unit}, and 0"
            )
    asked = share(command, _widened(most))
    if asked > 1.0 + _ROUND_SHARE:
        less = Command(*(math.trunc(1e3 * v / asked) / 1e3 for v in astuple(command)))
        raise CommandError(
            f"{_short(command)} asks for {asked:.2f} of what this library can do at "
            f"once, at most 1: give {_short(less)} or less"
        )


def _widened(most: CommandRange) -> CommandRange:
    ends = ((low - _ROUND, high + _ROUND) for low, high in astuple(most))
    return CommandRange(*ends)


def _parse_segment(part: str) -> TimedSegment:
    match = _SEGMENT.match(part)
    if match is None:
        raise CommandError(f"schedule segment {part!r}: {TIMED_GRAMMAR}")
    try:
        numbers = [float(text or "0") for text in match.groups()]
    except ValueError:
        raise CommandError(f"schedule segment {part!r}: {TIMED_GRAMMAR}") from None
    *values, duration_s = numbers
    if not all(map(math.isfinite, values)):
        raise CommandError(f"schedule segment {part!r}: a speed is a finite number")
    if not SHORTEST_S <= duration_s <= LONGEST_S:
        raise CommandError(
            f"schedule segment {part!r}: a time is {SHORTEST_S:g} to {LONGEST_S:g} s"
        )
    return TimedSegment(Command(*values), duration_s)


def _short(command: Command) -> str:
    return ",".join(map(_digits, astuple(command)))


def _digits(value: float) -> str:
    """Write a number shortly, so that reading it gives the same."""
    return repr(float(value) + 0.0).removesuffix(".0")
