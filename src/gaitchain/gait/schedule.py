"""Schedules: what to walk, segment by segment.

The paper's walks are told a speed for a number of steps, "speed@cycles"; dynamic ones
a speed ahead, to the left and around for a time (`timed_schedule`).
"""

import math
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from gaitchain.errors import CommandError
from gaitchain.gait.timed_schedule import (
    TIMED_GRAMMAR,
    TimedSchedule,
    TimedSegment,
    format_timed,
    parse_timed,
)
from gaitchain.messages import Command

if TYPE_CHECKING:
    from typing_extensions import TypeIs  # in `typing` from Python 3.13 on

PAPER_WALK = "0.04@half,0.08@2,0.02@half"
"""The paper's walk: half step, two cycles, last half step (Sec. VI-B)."""

_SEGMENT = re.compile(r"^\s*([0-9.eE+-]+)\s*@\s*(half|[0-9.]+)\s*$")
_GRAMMAR = (
    'expected "speed@cycles" separated by commas, speed in m/s and cycles a multiple '
    f'of 0.5 or "half" (one step), as in "{PAPER_WALK}"'
)
_MAX_STEPS = 10_000


@dataclass(frozen=True)
class SpeedSegment:
    """One speed, kept for a number of steps (a cycle is two, left and right)."""

    speed_mps: float
    steps: int


SpeedSchedule = tuple[SpeedSegment, ...]
Schedule = SpeedSchedule | TimedSchedule


def parse_schedule(text: str, *, timed: bool | None = None) -> Schedule:
    """Read a schedule such as "0.04@half,0.08@2" or "0.3,0,0@5;0.2,0,0.3@4".

    Args:
        text: segments "speed@cycles" between commas, where "half" is half a cycle, one
            step; or "vx,vy,yaw@seconds" between semicolons. Speed 0 stands still. The
            walk begins and ends standing.
        timed: which of the two it has to be; None tells them apart by their commas and
            semicolons, and takes "0.1@2" for two cycles.

    Returns:
        The segments.

    Raises:
        CommandError: a segment cannot be read; the message shows the grammar.
    """
    looks_timed = ";" in text or re.search(r",[^@,]*,|^[^@]*,", text) is not None
    if timed is False or (timed is None and not looks_timed):
        return parse_speeds(text)
    try:
        return parse_timed(text)
    except CommandError as error:
        if timed is None and TIMED_GRAMMAR in str(error):
            raise CommandError(f"{error}; or {_GRAMMAR}") from None
        raise


def is_timed(schedule: Schedule) -> "TypeIs[TimedSchedule]":
    """Tell the two kinds of schedules apart."""
    return any(isinstance(segment, TimedSegment) for segment in schedule)


def parse_speeds(text: str) -> SpeedSchedule:
    """Read the paper's kind of schedule; see `parse_schedule`."""
    segments = []
    for part in text.split(","):
        match = _SEGMENT.match(part)
        if match is None:
            raise CommandError(f"schedule segment {part.strip()!r}: {_GRAMMAR}")
        try:
            speed = float(match[1])
            cycles = 0.5 if match[2] == "half" else float(match[2])
        except ValueError:
            raise CommandError(
                f"schedule segment {part.strip()!r}: {_GRAMMAR}"
            ) from None
        segments.append(SpeedSegment(_speed(speed, part), _steps(cycles, part)))
    return tuple(segments)


def check_speeds(schedule: SpeedSchedule, low: float, high: float) -> None:
    """Refuse a schedule that the library cannot walk.

    The first and the last half step may be slower than any steady walk.

    Raises:
        CommandError: a speed is outside the range, or all of them are 0.
    """
    for i, segment in enumerate(schedule):
        speed = segment.speed_mps
        # The range is measured; what rounds to its ends is inside.
        half_step = segment.steps == 1 and i in (0, len(schedule) - 1)
        lowest = 0.0 if half_step else low
        if speed != 0.0 and not lowest - 0.005 <= speed <= high + 0.005:
            raise CommandError(
                f"{speed:g} m/s in the schedule: this library walks {low:.3f} to "
                f"{high:.3f} m/s, and 0 to stand"
            )
    if all(segment.speed_mps == 0.0 for segment in schedule):
        raise CommandError("the schedule only stands; give a speed above 0")


def step_commands(schedule: SpeedSchedule) -> list[Command]:
    """Return one command per step, and a stop after the last."""
    commands = [Command(s.speed_mps) for s in schedule for _ in range(s.steps)]
    return [*commands, Command(0.0)]


def random_schedule(rng: np.random.Generator, low: float, high: float) -> SpeedSchedule:
    """Draw a schedule within a speed range, with starts and stops.

    A half step at half the first speed, two to four segments of one or two cycles
    (one in four of the inner ones stands still for a cycle), and a half step at a
    quarter of the last speed, as in the paper's walk.

    Args:
        rng: source of randomness.
        low: slowest speed [m/s].
        high: fastest speed [m/s].

    Returns:
        The schedule.
    """
    # Whole millimetres per second, inside the range, so that the text says it all.
    slow, fast = math.ceil(1000.0 * low), max(math.floor(1000.0 * high), 1)
    middle = []
    count = int(rng.integers(2, 5))
    for i in range(count):
        speed = int(rng.integers(min(slow, fast), fast + 1)) / 1000.0
        if 0 < i < count - 1 and rng.random() < 0.25:
            speed = 0.0
        steps = 2 if speed == 0.0 else 2 * int(rng.integers(1, 3))
        middle.append(SpeedSegment(speed, steps))
    first = SpeedSegment(max(slow, round(500 * middle[0].speed_mps)) / 1000.0, 1)
    last = SpeedSegment(max(slow, round(250 * middle[-1].speed_mps)) / 1000.0, 1)
    return (first, *middle, last)


def format_schedule(schedule: Schedule) -> str:
    """Write a schedule as `parse_schedule` reads it."""
    if is_timed(schedule):
        return format_timed(schedule)
    return ",".join(
        f"{s.speed_mps:g}@{'half' if s.steps == 1 else f'{s.steps / 2:g}'}"
        for s in schedule
    )


def _speed(speed: float, part: str) -> float:
    if not (math.isfinite(speed) and speed >= 0.0):
        raise CommandError(
            f"schedule segment {part.strip()!r}: a speed is 0 m/s or more"
        )
    return speed


def _steps(cycles: float, part: str) -> int:
    steps = 2.0 * cycles
    if not (1 <= steps <= _MAX_STEPS and steps == round(steps)):
        raise CommandError(
            f"schedule segment {part.strip()!r}: cycles are a multiple of 0.5, "
            f"0.5 to {_MAX_STEPS // 2}"
        )
    return int(steps)
