"""The timeline of `gaitchain explain`: broken rules and signals before a fall."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gaitchain.analysis.fall_cause import RUN_UP_S, Explanation, when_fell
from gaitchain.analysis.record import WalkRecord, support_stays
from gaitchain.analysis.rule_checks import (
    asked_speeds,
    joint_limits,
    standing_margins,
    tracking_errors,
)
from gaitchain.analysis.rules import SIDES, RuleLimits
from gaitchain.figures.style import (
    FEET,
    MEASURED,
    PAPER,
    PLANNED,
    REGION_COLOURS,
    Axes,
    annotate,
    drawing,
    legend_beside,
)
from gaitchain.messages import CONTROL_PERIOD_S, GRAVITY
from gaitchain.robot.robot import Robot

_Rows = NDArray[np.bool_]
_BEFORE_S = 1.5  # time drawn before the run-up to a fall
_MOST_LANES = 10
_LETTER = 0.012  # of the drawn time: width of one letter of a region's name
_TILT, _MARGIN, _TORQUE, _SPEED = "#7a5195", "#5aa469", "#1f6fb4", "#d9772b"


def plot_timeline(
    explanation: Explanation, record: WalkRecord, robot: Robot, path: Path
) -> None:
    """Draw when each rule was broken, and the quantities that the rules judge.

    A walk with a fall is drawn from shortly before the run-up to it, a walk without a
    fall from beginning to end.

    Args:
        explanation: result of `fall_cause.explain` for the record.
        record: the walk.
        robot: the robot.
        path: the PNG.

    Raises:
        CommandError: the file cannot be written.
    """
    span = _span(explanation, record)
    rows = (record.time_s >= span[0]) & (record.time_s <= span[1])
    names = _lanes(explanation, span)
    with drawing(path, 7.4, 7.2 + 0.17 * len(names)) as figure:
        heights = (0.25 + 0.17 * max(len(names), 1), 1.0, 1.0, 1.0, 1.0, 1.0)
        axes = figure.subplots(6, 1, sharex=True, height_ratios=heights)
        _draw_lanes(axes[0], explanation, names, span)
        _draw_tilt(axes[1], record, rows)
        _draw_margin(axes[2], record, robot, rows)
        _draw_loads(axes[3], record, robot, rows)
        _draw_use(axes[4], record, robot, rows)
        _draw_tracking(axes[5], record, robot, rows)
        for i, one in enumerate(axes):
            _mark(one, explanation, names=i == 0)
        axes[0].set_xlim(*span)
        axes[-1].set_xlabel("time [s]")
        figure.align_ylabels(axes[1:])
        figure.suptitle(_title(explanation, robot))


def _title(explanation: Explanation, robot: Robot) -> str:
    fell_at_s, cause = explanation.fell_at_s, explanation.cause
    if fell_at_s is None or cause is None:
        return f"{robot.name}: {explanation.sentence}"
    return (
        f"{robot.name} fell {when_fell(fell_at_s)}: {cause.what}, {cause.how_much}\n"
        f"try {cause.advice}"
    )


def _span(explanation: Explanation, record: WalkRecord) -> tuple[float, float]:
    first, last = float(record.time_s[0]), float(record.time_s[-1])
    fell_at_s, cause = explanation.fell_at_s, explanation.cause
    if fell_at_s is None:
        return first, last + CONTROL_PERIOD_S
    begin = fell_at_s - RUN_UP_S
    begin = begin if cause is None else min(begin, cause.time_s)
    begin, end = max(first, begin - _BEFORE_S), max(last + CONTROL_PERIOD_S, fell_at_s)
    return begin, end + 0.01 * (end - begin)  # room for the line at the fall


def _lanes(explanation: Explanation, span: tuple[float, float]) -> list[str]:
    """Return the rules broken in the span, without joint names if there are many."""
    shown = [f for f in explanation.findings if f.until_s >= span[0]]
    names = list(dict.fromkeys(f.what for f in shown))
    if len(names) > _MOST_LANES:
        names = list(dict.fromkeys(f.rule.value for f in shown))
    done = (what for time_s, what in explanation.events if time_s >= span[0])
    return [*dict.fromkeys(done), *names]


def _draw_lanes(
    axes: Axes, explanation: Explanation, names: list[str], span: tuple[float, float]
) -> None:
    least = 0.004 * (span[1] - span[0])  # smallest visible length of a bar

    def draw(name: str, begin_s: float, end_s: float, colour: str, order: int) -> None:
        bar = [(begin_s, max(end_s - begin_s, least))]
        lane = names.index(name) - 0.35
        axes.broken_barh(bar, (lane, 0.7), color=colour, zorder=order)

    for finding in explanation.findings:
        name = finding.what if finding.what in names else finding.rule.value
        if name in names:
            leads = finding is explanation.cause
            colour, order = (MEASURED, 4) if leads else ("#a9a9a9", 3)
            draw(name, finding.time_s, finding.until_s, colour, order)
    for time_s, what in explanation.events:
        if what in names:
            draw(what, time_s, time_s, PAPER, 4)
    title = "rules broken" if explanation.cause is None else "rules broken,\nred: first"
    _label_lanes(axes, names, title)


def _label_lanes(axes: Axes, names: list[str], title: str) -> None:
    """Name the lanes, from above, and write a title beside them."""
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(max(len(names), 1) - 0.4, -0.6)
    axes.tick_params(axis="y", labelsize=7.5, length=0)
    axes.annotate(
        title,
        (1.0, 0.5),
        xycoords="axes fraction",
        xytext=(8, 0),
        textcoords="offset points",
        va="center",
        fontsize=8.0,
    )


def _mark(axes: Axes, explanation: Explanation, *, names: bool) -> None:
    marks = [(time_s, "", PAPER, "center") for time_s, _ in explanation.events]
    if explanation.cause is not None:
        marks.append((explanation.cause.time_s, "first", MEASURED, "right"))
    if explanation.fell_at_s is not None:
        marks.append((explanation.fell_at_s, "fall", "black", "left"))
    for time_s, what, colour, side in marks:
        axes.axvline(time_s, color=colour, linewidth=1.0, linestyle="--", zorder=2)
        if names:
            over = {"xytext": (0, 3), "textcoords": "offset points", "ha": side}
            style = {"fontsize": 7.5, "color": colour, "annotation_clip": True}
            annotate(axes, what, time_s, 1.0, va="baseline", **over, **style)


def _draw_tilt(axes: Axes, record: WalkRecord, rows: _Rows) -> None:
    time_s = record.time_s[rows]
    for i, (name, colour) in enumerate((("roll", _TILT), ("pitch", _SPEED))):
        axes.plot(time_s, np.degrees(record.tilt[rows, i]), color=colour, label=name)
        believed = np.degrees(record.estimated_tilt[rows, i])
        if np.isfinite(believed).any():
            label = f"{name}, estimated"
            axes.plot(time_s, believed, color=colour, linestyle=":", label=label)
    axes.axhline(0.0, color="#777777", linewidth=0.8)
    legend_beside(axes, "trunk's tilt\n[deg]")


def _draw_margin(axes: Axes, record: WalkRecord, robot: Robot, rows: _Rows) -> None:
    limit = 1e3 * RuleLimits.zmp_margin * robot.reduced.sole_length
    margin = 1e3 * standing_margins(robot, record)[rows]
    axes.plot(record.time_s[rows], margin, color=_MARGIN, label="to the edge")
    label = f"least, {limit:.0f} mm"
    axes.axhline(limit, color=MEASURED, linestyle=":", label=label)
    axes.set_ylim(min(0.0, float(np.nanmin(margin, initial=0.0))) - 5.0, None)
    legend_beside(axes, "ZMP margin\n[mm]")


def _draw_loads(axes: Axes, record: WalkRecord, robot: Robot, rows: _Rows) -> None:
    time_s = record.time_s[rows]
    load = 100.0 * record.foot_load[rows] / (robot.reduced.mass * GRAVITY)
    for i, side in enumerate(SIDES):
        axes.plot(time_s, load[:, i], color=FEET[i], label=f"{side} foot")
    letter_s = _LETTER * float(time_s[-1] - time_s[0])
    for name, begin, end in support_stays(record.support[rows]):
        first, last = float(time_s[begin]), float(time_s[end - 1])
        axes.axvspan(first, last, color=REGION_COLOURS[name], alpha=0.13, linewidth=0)
        if last - first > letter_s * len(name):
            style = {"va": "top", "fontsize": 7.0, "color": PLANNED}
            annotate(axes, name, 0.5 * (first + last), 0.97, **style)
    axes.set_ylim(0.0, min(1.25 * max(float(load.max()), 100.0), 400.0))
    legend_beside(axes, "load, % of weight\n(bands: plan)")


def _draw_use(axes: Axes, record: WalkRecord, robot: Robot, rows: _Rows) -> None:
    """Draw the largest torque and commanded speed of any joint, as parts of the limit.

    A commanded speed may exceed the limit.
    """
    torque_limit, speed_limit = joint_limits(robot, record)
    for values, limit, colour, name in (
        (np.abs(record.torque), torque_limit, _TORQUE, "torque"),
        (asked_speeds(record), speed_limit, _SPEED, "speed"),
    ):
        share = 100.0 * values[rows] / limit
        joint = record.joint_names[int(np.argmax(share.max(axis=0)))].replace("_", " ")
        label = f"{name}, most:\n{joint}"
        axes.plot(record.time_s[rows], share.max(axis=1), color=colour, label=label)
    axes.axhline(100.0, color=MEASURED, linestyle=":")
    axes.set_ylim(0.0, None)
    legend_beside(axes, "worst joint\n[% of limit]")


def _draw_tracking(axes: Axes, record: WalkRecord, robot: Robot, rows: _Rows) -> None:
    error = np.degrees(tracking_errors(robot, record)[rows])
    joint = record.joint_names[int(np.argmax(error.max(axis=0)))].replace("_", " ")
    limit = float(np.degrees(RuleLimits.tracking_rad))
    label = f"worst joint,\nmost: {joint}"
    axes.plot(record.time_s[rows], error.max(axis=1), color=_TILT, label=label)
    axes.axhline(limit, color=MEASURED, linestyle=":", label=f"limit, {limit:.0f} deg")
    axes.set_ylim(0.0, None)
    legend_beside(axes, "tracking error\nless sag [deg]")
