"""Where a recorded walk went, as the robot itself faces, and when its feet stood still.

Positions of the base are added up in the heading that it has at each moment, so that
"ahead" and "to the left" mean the same as in a `Command` whatever way the robot turned.
"""

import math
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from gaitchain.analysis.record import WalkRecord
from gaitchain.gait.schedule import Schedule, counts_steps, due_commands
from gaitchain.messages import CONTROL_PERIOD_S, Array, Command

STILL_M = 0.002
"""A foot that moves less than this stands still [m]."""
_STILL_S = 0.5  # a record must end with so much of it to say that the robot stopped


@dataclass(frozen=True)
class Stretch:
    """One command of a schedule, and the rows of the record in which it held."""

    command: Command
    begin: int
    end: int
    """The row after the last; beyond the record where a fall cut it short."""

    @property
    def duration_s(self) -> float:
        """Time that it held, in the schedule [s]."""
        return (self.end - self.begin) * CONTROL_PERIOD_S

    @property
    def speed(self) -> float:
        """Commanded speed, whatever its direction [m/s]."""
        return math.hypot(self.command.vx, self.command.vy)


def stretches(record: WalkRecord, schedule: Schedule) -> tuple[Stretch, ...]:
    """Return the schedule's segments with their rows."""
    commands = [segment.command for segment in schedule]
    if counts_steps(schedule):
        bounds = np.cumsum([0, *(segment.steps for segment in schedule)])
        rows = [record.step_ticks[i] for i in bounds]
    else:
        due = due_commands(schedule, step_s=0.0)
        rows = [round(time_s / CONTROL_PERIOD_S) for time_s, _ in due]
    return tuple(
        Stretch(command, begin, end)
        for command, (begin, end) in zip(commands, pairwise(rows), strict=False)
    )


def own_motion(record: WalkRecord) -> Array:
    """Return how far the base has come, as it faced all along.

    Returns:
        (N, 3) ahead [m], to the left [m], turned to the left [rad], 0 in row 0.
    """
    w, x, y, z = record.qpos[:, 3:7].T
    yaw = np.unwrap(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))
    moved = np.diff(record.qpos[:, :2], axis=0)
    facing = 0.5 * (yaw[1:] + yaw[:-1])
    cos, sin = np.cos(facing), np.sin(facing)
    ahead = cos * moved[:, 0] + sin * moved[:, 1]
    left = cos * moved[:, 1] - sin * moved[:, 0]
    motion = np.column_stack([yaw - yaw[0], np.zeros((len(yaw), 2))])[:, [1, 2, 0]]
    motion[1:, :2] = np.cumsum(np.column_stack([ahead, left]), axis=0)
    return motion


def world_motion(record: WalkRecord) -> Array:
    """Return how far the base has come in the world, as `own_motion` returns it."""
    yaw = own_motion(record)[:, 2]
    return np.column_stack([record.qpos[:, :2] - record.qpos[0, :2], yaw])


def achieved(motion: Array, stretch: Stretch, until: int | None = None) -> Command:
    """Return the mean speeds over a stretch; NaN where the robot fell before its end.

    Args:
        motion: as `own_motion` returns it.
        stretch: the rows.
        until: row up to which the way counts, in the stretch's time; its end by
            default.
    """
    end = stretch.end if until is None else until
    if end > len(motion) - 1 or end <= stretch.begin:
        return Command(math.nan, math.nan, math.nan)
    moved = motion[end] - motion[stretch.begin]
    return Command(*(moved / stretch.duration_s).tolist())


def along(command: Command, motion: Command) -> float:
    """Return the speed in the direction that is commanded; NaN without one [m/s]."""
    speed = math.hypot(command.vx, command.vy)
    dot = command.vx * motion.vx + command.vy * motion.vy
    return dot / speed if speed > 0.0 else math.nan


def pace(
    motion: Array, parts: tuple[Stretch, ...], run_in_s: float = 0.0
) -> tuple[float, float]:
    """Return the mean speed in the commanded direction, and its mean absolute error.

    Args:
        motion: as `own_motion` returns it.
        parts: of the schedule; those that the robot walked to their end count.
        run_in_s: how much of the beginning does not count [s].

    Returns:
        Mean speed, and error of each stretch weighted by duration; NaN if none [m/s].
    """
    begin = round(run_in_s / CONTROL_PERIOD_S)
    counted = [replace(p, begin=max(p.begin, begin)) for p in parts if p.speed > 0.0]
    paces = [along(part.command, achieved(motion, part)) for part in counted]
    known = [
        (p, pace)
        for p, pace in zip(counted, paces, strict=True)
        if not math.isnan(pace)
    ]
    total_s = sum(part.duration_s for part, _ in known)
    if not total_s:
        return math.nan, math.nan
    way = sum(pace * part.duration_s for part, pace in known)
    off = sum(abs(pace - part.speed) * part.duration_s for part, pace in known)
    return way / total_s, off / total_s


def drift(motion: Array, parts: tuple[Stretch, ...], axis: int) -> float:
    """Return what the robot moved beyond its commands, up to the end or the fall.

    Args:
        motion: as `own_motion` returns it.
        parts: of the schedule.
        axis: 1 for the way to the left [m], 2 for the turn to the left [rad].
    """
    rows = len(motion) - 1
    asked = 0.0
    for part in parts:
        held = max(min(part.end, rows) - part.begin, 0) * CONTROL_PERIOD_S
        asked += held * (0.0, part.command.vy, part.command.yaw_rate)[axis]
    return float(motion[-1, axis] - asked)


def stop_time(record: WalkRecord, parts: tuple[Stretch, ...]) -> float:
    """Return the time from the stop until both feet stand still for good [s].

    From then on each foot stays within 2 mm of where it stands at the end, along the
    floor and above it.

    Args:
        record: the walk.
        parts: of the schedule; the stop comes after the last one that goes anywhere.

    Returns:
        The time; NaN if the robot fell, or its feet moved to the end.
    """
    stop = max((part.end for part in parts if not part.command.stops), default=0)
    if record.fell_at_s is not None or stop >= len(record.time_s):
        return math.nan
    foot = np.concatenate([record.feet[..., :2], record.foot_height[..., None]], -1)
    moving = np.linalg.norm(foot - foot[-1], axis=-1).max(axis=1) > STILL_M
    still_from = int(np.max(np.flatnonzero(moving), initial=-1)) + 1
    if (len(moving) - still_from) * CONTROL_PERIOD_S < _STILL_S:
        return math.nan
    return max(still_from - stop, 0) * CONTROL_PERIOD_S
