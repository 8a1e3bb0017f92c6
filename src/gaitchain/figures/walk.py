"""The overview plot of `gaitchain walk`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gaitchain.biped import Biped
from gaitchain.errors import CommandError
from gaitchain.figures.footing import draw_ground, draw_sole
from gaitchain.figures.steps import walked_steps
from gaitchain.figures.style import FEET, MEASURED, PLANNED, drawing
from gaitchain.measure import WalkSummary, summarise, zmp_margins
from gaitchain.schedule import Schedule, format_schedule

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from gaitchain.control import WalkRecord

_SPEED_WINDOW = 50  # rows of 10 ms that the drawn speed is averaged over


def plot_walk(record: WalkRecord, biped: Biped, schedule: Schedule, path: Path) -> None:
    """Draw the overview of a walk: footprints and ZMP, speed, joint speeds, margin.

    Args:
        record: the walk, to its end or to the fall.
        biped: the robot.
        schedule: what was commanded.
        path: the PNG.

    Raises:
        CommandError: the file cannot be written.
    """
    summary = summarise(biped, record, schedule)
    with drawing(path, 7.4, 7.6) as figure:
        grid = figure.add_gridspec(4, 1, height_ratios=(1.25, 1.0, 0.8, 0.8))
        ground = figure.add_subplot(grid[0])
        _draw_way(ground, record, biped)
        speed = figure.add_subplot(grid[1])
        _draw_speed(speed, record, summary)
        joints = figure.add_subplot(grid[2], sharex=speed)
        _draw_joint_speed(joints, record, biped)
        margin = figure.add_subplot(grid[3], sharex=speed)
        _draw_margin(margin, record, biped)
        for axes in (speed, joints):
            axes.tick_params(labelbottom=False)
        margin.set_xlabel("time [s]")
        end = summary.cause or (
            f"{summary.distance_m:.2f} m, ZMP inside the planned support "
            f"{100 * summary.zmp_inside_support:.0f} % of the time"
        )
        figure.suptitle(
            f"{biped.name}: {format_schedule(schedule)}\n{end}", fontsize=10
        )


def _draw_way(axes: Axes, record: WalkRecord, biped: Biped) -> None:
    try:
        steps = walked_steps(record)
    except CommandError:  # it fell in its first step; where it stood still shows
        steps = []
    for step in steps:
        foot = record.feet[step.midstance, step.support_foot]
        draw_sole(axes, biped, foot, step.support_foot)
    for row in (0, -1):
        for side in (0, 1):
            draw_sole(axes, biped, record.feet[row, side], side)
    draw_ground(axes, record, slice(0, len(record.time_s)))
    axes.set_title("from above: soles where they stood, measured ZMP")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))


def _draw_speed(axes: Axes, record: WalkRecord, summary: WalkSummary) -> None:
    time_s, x = record.time_s, record.qpos[:, 0]
    window = min(_SPEED_WINDOW, len(x) - 1)
    speed = (x[window:] - x[:-window]) / (time_s[window:] - time_s[:-window])
    middle = 0.5 * (time_s[window:] + time_s[:-window])
    axes.plot(middle, speed, color="#bbbbbb", linewidth=1.0, label="base, 0.5 s mean")
    begin = 0.0
    for i, segment in enumerate(summary.segments):
        span = [begin, begin + segment.duration_s]
        begin = span[1]
        for value, colour, style, name in (
            (segment.commanded_mps, PLANNED, "--", "commanded"),
            (segment.achieved_mps, MEASURED, "-", "achieved"),
        ):
            label = None if i else f"{name}, segment mean"
            axes.plot(
                span, [value] * 2, color=colour, linestyle=style, lw=1.8, label=label
            )
    axes.set_ylabel("forward speed\n[m/s]")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))


def _draw_joint_speed(axes: Axes, record: WalkRecord, biped: Biped) -> None:
    fastest = np.degrees(np.abs(record.joint_velocity).max(axis=1))
    limit = float(np.degrees(biped.joint_speed_limit))
    axes.plot(record.time_s, fastest, color=FEET[0], label="fastest joint")
    axes.axhline(limit, color=MEASURED, linestyle=":", label=f"limit, {limit:g} deg/s")
    axes.set_ylim(0.0, 1.1 * max(limit, float(fastest.max())))
    axes.set_ylabel("joint speed\n[deg/s]")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))


def _draw_margin(axes: Axes, record: WalkRecord, biped: Biped) -> None:
    margin = 1e3 * zmp_margins(biped, record)
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
    axes.set_ylabel("support margin\n[mm]")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
