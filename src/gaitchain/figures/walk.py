"""The overview plot of `gaitchain walk`."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from textwrap import fill

import numpy as np

from gaitchain.analysis.base_motion import own_motion
from gaitchain.analysis.record import WalkRecord
from gaitchain.analysis.rule_checks import joint_limits
from gaitchain.analysis.walk_metrics import (
    SegmentResult,
    WalkSummary,
    percent,
    summarise,
    zmp_margins,
)
from gaitchain.errors import CommandError
from gaitchain.figures.footing import draw_ground, draw_sole
from gaitchain.figures.steps import walked_steps
from gaitchain.figures.style import (
    FEET,
    MEASURED,
    PLANNED,
    Axes,
    drawing,
    legend_beside,
)
from gaitchain.gait.schedule import (
    Schedule,
    counts_steps,
    due_commands,
    format_schedule,
)
from gaitchain.messages import Array
from gaitchain.robot.robot import Robot

_SPEED_WINDOW = 50  # rows of 10 ms over which the drawn speed is averaged
_RAW = "#bbbbbb"
_MOTIONS = (
    ("vx", "ahead\n[m/s]"),
    ("vy", "to the left\n[m/s]"),
    ("yaw_rate", "turning left\n[rad/s]"),
)
_LEAST_SPAN = 0.05  # m/s, rad/s; least range of the axis, so that noise looks small
_LONGEST_TITLE, _LINE = 48, 88  # most characters of a schedule, and of a line


def plot_walk(record: WalkRecord, robot: Robot, schedule: Schedule, path: Path) -> None:
    """Draw the overview of a walk: footprints and ZMP, speed, joint speeds, margin.

    A walk of key poses shows the forward speed; a timed walk shows the three commanded
    velocities, in the frame of the robot's heading.

    Args:
        record: the walk, up to its end or the fall.
        robot: the robot.
        schedule: what was commanded.
        path: the PNG.

    Raises:
        CommandError: the file cannot be written.
    """
    summary = summarise(robot, record, schedule)
    speeds = [1.0] if counts_steps(schedule) else [0.65] * len(_MOTIONS)
    heights = 1.25, *speeds, 0.8, 0.8
    with drawing(path, 7.4, 4.2 + 0.85 * len(heights)) as figure:
        grid = figure.add_gridspec(len(heights), 1, height_ratios=heights)
        _draw_way(figure.add_subplot(grid[0]), record, robot)
        first = figure.add_subplot(grid[1])
        more = range(2, len(heights))
        rows = [first, *(figure.add_subplot(grid[i], sharex=first) for i in more)]
        *moving, joints, margin = rows
        if counts_steps(schedule):
            _draw_speed(first, record, summary)
        else:
            _draw_motion(moving, record, schedule, summary)
        _draw_joint_speed(joints, record, robot)
        _draw_margin(margin, record, robot)
        for axes in rows[:-1]:
            axes.tick_params(labelbottom=False)
        margin.set_xlabel("time [s]")
        end = summary.cause or (
            f"{summary.distance_m:.2f} m, ZMP inside the planned support "
            f"{percent(summary.zmp_inside_support)} of the time"
        )
        title = f"{robot.name}: {_title(schedule)}\n{fill(end, _LINE)}"
        figure.suptitle(title)


def _title(schedule: Schedule) -> str:
    """Return a schedule as text, shortened to the segments that fit."""
    text, between = format_schedule(schedule), "," if counts_steps(schedule) else ";"
    if len(text) <= _LONGEST_TITLE:
        return text
    room = text[: _LONGEST_TITLE + 1].rpartition(between)[0]
    return f"{room}{between} ... ({len(schedule)} segments)"


def _draw_way(axes: Axes, record: WalkRecord, robot: Robot) -> None:
    try:
        steps = walked_steps(record)
    except CommandError:  # fell in the first step: there is no step to draw
        steps = []
    for step in steps:
        foot = record.feet[step.midstance, step.support_foot]
        draw_sole(axes, robot, foot, step.support_foot)
    for row in (0, -1):
        for side in (0, 1):
            draw_sole(axes, robot, record.feet[row, side], side)
    draw_ground(axes, record, slice(0, len(record.time_s)))
    axes.set_title("from above: soles where they stood, measured ZMP")
    legend_beside(axes, "y, left [m]")


def _draw_speed(axes: Axes, record: WalkRecord, summary: WalkSummary) -> None:
    time_s, x = record.time_s, record.qpos[:, 0]
    window = min(_SPEED_WINDOW, len(x) - 1)
    speed = (x[window:] - x[:-window]) / (time_s[window:] - time_s[:-window])
    middle = 0.5 * (time_s[window:] + time_s[:-window])
    axes.plot(middle, speed, color=_RAW, linewidth=1.0, label="base, 0.5 s mean")
    for i, (span, segment) in enumerate(_spans(summary)):
        for value, colour, style, name in (
            (segment.commanded_mps, PLANNED, "--", "commanded"),
            (segment.achieved_mps, MEASURED, "-", "achieved"),
        ):
            label = None if i else f"{name}, segment mean"
            axes.plot(
                span, [value] * 2, color=colour, linestyle=style, lw=1.8, label=label
            )
    legend_beside(axes, "forward speed\n[m/s]")


def _draw_motion(
    rows: Sequence[Axes], record: WalkRecord, schedule: Schedule, summary: WalkSummary
) -> None:
    """Draw the three measured and commanded velocities of a timed walk."""
    middle, speeds = _mean_motion(record)
    given = record.commands or due_commands(schedule, 0.0)
    asked_at = [time for time, _ in given] + [float(record.time_s[-1])]
    for axes, speed, (name, label) in zip(rows, speeds.T, _MOTIONS, strict=True):
        axes.plot(middle, speed, color=_RAW, lw=1.0, label="base, mean over a cycle")
        asked = [getattr(command, name) for _, command in given]
        axes.step(
            asked_at,
            [*asked, asked[-1]],
            where="post",
            color=PLANNED,
            linestyle="--",
            label="commanded",
        )
        for i, (span, segment) in enumerate(_spans(summary)):
            did = [getattr(segment.achieved, name)] * 2
            mean = None if i else "achieved, segment mean"
            axes.plot(span, did, color=MEASURED, lw=1.8, label=mean)
        for time, what in record.events:
            axes.axvline(time, color=FEET[1], lw=0.9, label=what)
        low, high = axes.get_ylim()
        axes.set_ylim(min(low, -_LEAST_SPAN), max(high, _LEAST_SPAN))
        axes.set_ylabel(label)
    rows[0].legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))


def _spans(summary: WalkSummary) -> Iterator[tuple[list[float], SegmentResult]]:
    """Yield begin and end of each segment [s], and the segment."""
    begin = 0.0
    for segment in summary.segments:
        span = [begin, begin + segment.duration_s]
        begin = span[1]
        yield span, segment


def _mean_motion(record: WalkRecord) -> tuple[Array, Array]:
    """Return times (N,) [s], and the velocities (N, 3) over a cycle around each."""
    time_s, motion = record.time_s, own_motion(record.qpos)
    window = min(_cycle(record), len(time_s) - 1)
    passed = (time_s[window:] - time_s[:-window])[:, None]
    middle: Array = 0.5 * (time_s[window:] + time_s[:-window])
    return middle, (motion[window:] - motion[:-window]) / passed


def _cycle(record: WalkRecord) -> int:
    """Return the number of rows of two steps, over which the sway averages out."""
    if record.timing is None or len(record.time_s) < 2:
        return _SPEED_WINDOW
    period_s = float(np.diff(record.time_s[:2])[0])
    return max(round(2.0 * record.timing.step / period_s), 1)


def _draw_joint_speed(axes: Axes, record: WalkRecord, robot: Robot) -> None:
    """Draw the speed of the fastest joint; if limits differ, as part of its limit."""
    speeds = np.degrees(np.abs(record.joint_velocity))
    limits = np.degrees(joint_limits(robot, record)[1])
    label, unit, limit = "fastest joint", "deg/s", float(limits.max())
    if limits.min() < limit:
        speeds, label, unit, limit = speeds / limits, "nearest joint", "of limit", 1.0
    fastest = speeds.max(axis=1)
    axes.plot(record.time_s, fastest, color=FEET[0], label=label)
    if np.isfinite(limit):
        name = f"limit, {limit:g} {unit}" if unit == "deg/s" else "limit of each"
        axes.axhline(limit, color=MEASURED, linestyle=":", label=name)
    else:
        limit = 0.0
    axes.set_ylim(0.0, 1.1 * max(limit, float(fastest.max())) or 1.0)
    legend_beside(axes, f"joint speed\n[{unit}]")


def _draw_margin(axes: Axes, record: WalkRecord, robot: Robot) -> None:
    margin = 1e3 * zmp_margins(robot, record)
    margin[~np.isfinite(margin)] = np.nan
    axes.plot(record.time_s, margin, color="#5aa469", label="ZMP to the edge")
    axes.fill_between(
        record.time_s,
        margin,
        0.0,
        where=(margin < 0.0).tolist(),
        color=MEASURED,
        alpha=0.35,
        linewidth=0,
        label="outside the region",
    )
    axes.axhline(0.0, color="#777777", linewidth=0.8)
    legend_beside(axes, "support margin\n[mm]")
