"""Motion of the base in a recorded walk, and the time until the feet stand still.

Displacements are expressed in the heading of the base at each moment, so that "ahead"
and "to the left" mean the same as in a `Command`, however the robot has turned.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from gaitchain.analysis.record import WalkRecord
from gaitchain.gait.schedule import Schedule, counts_steps, due_commands
from gaitchain.messages import CONTROL_PERIOD_S, Array, Command
from gaitchain.robot.turn import in_heading

STILL_M = 0.002
"""A foot that moves less than this stands still [m]."""
_STILL_S = 0.5  # standing time at the end of a record from which the robot has stopped


@dataclass(frozen=True)
class Stretch:
    """One command of a schedule, and the rows of the record in which it was active."""

    command: Command
    begin: int
    """First row."""
    end: int
    """Row after the last; after a fall it may lie beyond the end of the record."""

    @property
    def duration_s(self) -> float:
        """Duration in the schedule [s]."""
        return (self.end - self.begin) * CONTROL_PERIOD_S

    @property
    def speed(self) -> float:
        """Magnitude of the commanded velocity [m/s]."""
        return math.hypot(self.command.vx, self.command.vy)


def stretches(
    step_ticks: Sequence[int], schedule: Schedule, first: int = 0
) -> tuple[Stretch, ...]:
    """Return the segments of a schedule with their rows in a record.

    Args:
        step_ticks: rows at which steps began, for a schedule in steps.
        schedule: the commands.
        first: row at which a timed schedule began.
    """
    commands = [segment.command for segment in schedule]
    if counts_steps(schedule):
        bounds = np.cumsum([0, *(segment.steps for segment in schedule)])
        rows = [step_ticks[i] for i in bounds]
    else:
        due = due_commands(schedule, step_s=0.0)
        rows = [first + round(time_s / CONTROL_PERIOD_S) for time_s, _ in due]
    return tuple(
        Stretch(command, begin, end)
        for command, (begin, end) in zip(commands, pairwise(rows), strict=False)
    )


def own_motion(qpos: Array) -> Array:
    """Integrate the motion of the base in its own heading.

    Args:
        qpos: (N, 7 or more) place of the base in the world [m], its quaternion, and
            what else a record has there.

    Returns:
        (N, 3) distance ahead [m], to the left [m], turn to the left [rad]; 0 in row 0.
    """
    w, x, y, z = qpos[:, 3:7].T
    yaw = np.unwrap(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))
    moved = np.diff(qpos[:, :2], axis=0)
    facing = 0.5 * (yaw[1:] + yaw[:-1])
    ahead, left = in_heading(facing, *moved.T)
    motion = np.column_stack([yaw - yaw[0], np.zeros((len(yaw), 2))])[:, [1, 2, 0]]
    motion[1:, :2] = np.cumsum(np.column_stack([ahead, left]), axis=0)
    return motion


def world_motion(record: WalkRecord) -> Array:
    """Return the displacement of the base in the world, in the form of `own_motion`."""
    yaw = own_motion(record.qpos)[:, 2]
    return np.column_stack([record.qpos[:, :2] - record.qpos[0, :2], yaw])


def achieved(motion: Array, stretch: Stretch, until: int | None = None) -> Command:
    """Return the mean speeds over a stretch; NaN if the robot fell before its end.

    Args:
        motion: (N, 3) as returned by `own_motion`.
        stretch: the rows.
        until: row up to which the displacement counts, while the time is that of the
            stretch; the end of the stretch by default.
    """
    end = stretch.end if until is None else until
    if end > len(motion) - 1 or end <= stretch.begin:
        return Command(math.nan, math.nan, math.nan)
    moved = motion[end] - motion[stretch.begin]
    return Command(*(moved / stretch.duration_s).tolist())


def along(command: Command, motion: Command) -> float:
    """Return the speed in the commanded direction [m/s]; NaN without a direction."""
    speed = math.hypot(command.vx, command.vy)
    dot = command.vx * motion.vx + command.vy * motion.vy
    return dot / speed if speed > 0.0 else math.nan


def pace(
    motion: Array, parts: tuple[Stretch, ...], run_in_s: float = 0.0
) -> tuple[float, float]:
    """Return the mean speed in the commanded direction, and its mean absolute error.

    Args:
        motion: (N, 3) as returned by `own_motion`.
        parts: stretches of the schedule; those cut short by a fall are left out.
        run_in_s: time at the beginning that is left out [s].

    Returns:
        Speed and error, weighted by duration [m/s]; NaN if no stretch is left.
    """
    begin = round(run_in_s / CONTROL_PERIOD_S)
    counted = [replace(p, begin=max(p.begin, begin)) for p in parts if p.speed > 0.0]
    paces = [along(part.command, achieved(motion, part)) for part in counted]
    errors = [abs(pace - p.speed) for pace, p in zip(paces, counted, strict=True)]
    durations_s = [part.duration_s for part in counted]
    return known_mean(paces, durations_s), known_mean(errors, durations_s)


def known_mean(values: Sequence[float], weights: Sequence[float]) -> float:
    """Return the weighted mean of all values but NaN; NaN if none is left."""
    known = ~np.isnan(values)
    kept, share = np.array(values)[known], np.array(weights)[known]
    return float(np.average(kept, weights=share)) if share.any() else math.nan


def drift(motion: Array, parts: tuple[Stretch, ...], axis: int) -> float:
    """Return the motion beyond the commanded one, up to the end or the fall.

    Args:
        motion: (N, 3) as returned by `own_motion`.
        parts: stretches of the schedule.
        axis: 1 for the distance to the left [m], 2 for the turn to the left [rad].
    """
    rows = len(motion) - 1
    asked = 0.0
    for part in parts:
        held = max(min(part.end, rows) - part.begin, 0) * CONTROL_PERIOD_S
        asked += held * (0.0, part.command.vy, part.command.yaw_rate)[axis]
    return float(motion[-1, axis] - asked)


def stop_time(record: WalkRecord, parts: tuple[Stretch, ...]) -> float:
    """Return the time from the stop command until both feet stand still [s].

    From then on each foot stays within 2 mm of its final position, horizontally and
    vertically.

    Args:
        record: the walk.
        parts: stretches of the schedule; the stop follows the last one with a motion.

    Returns:
        The time; NaN if the robot fell, or its feet moved until the end.
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
