"""What replays of an exercise show and miss, with the file's numbers and a fit's."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from gaitchain.figures.style import FEET, MEASURED, PLANNED, Axes, drawing
from gaitchain.messages import CONTROL_PERIOD_S, Array

_WIDTH_IN, _ROW_IN, _WORST_IN = 2.4, 1.1, 2.6
_LEAST_WIDTH_IN = 6.0  # for the legends
_WORST_S = 4.0  # so long that a fast sine of an exercise is seen as one
_BEFORE, _AFTER = "with the file's numbers", "with identified ones"


class Compared(NamedTuple):
    """One motion of a log, and what replays miss of it."""

    name: str
    measured: Array
    """(N, 2 n) angles of the joints [rad]; NaN where none came."""
    before: Array
    """(N, 2 n) measured less replayed, with the file's numbers [rad]."""
    after: Array
    """The same with the identified ones."""


class Excerpt(NamedTuple):
    """Some seconds of one joint in one motion."""

    motion: int
    joint: int
    rows: slice
    rms: float
    """What the replay with the identified numbers misses in all of the motion [rad]."""


def plot_missed(
    joint_names: Sequence[str],
    motions: Sequence[Compared],
    robot: str,
    path: Path,
) -> None:
    """Draw the joint that is fitted worst, and what replays miss of each one.

    The former is measured against replayed, for the seconds that are missed most; of
    the latter there is a row for each joint, a column for each motion.

    Args:
        joint_names: (2 n,) leg joints.
        motions: what was measured and replayed.
        robot: its name.
        path: the PNG.

    Raises:
        CommandError: the file cannot be written.
    """
    below_in = 1.0 + _ROW_IN * len(joint_names)
    width_in = max(1.2 + _WIDTH_IN * len(motions), _LEAST_WIDTH_IN)
    with drawing(path, width_in, _WORST_IN + below_in) as figure:
        heights = _WORST_IN, below_in
        (top,), (below,) = figure.subfigures(2, 1, squeeze=False, height_ratios=heights)
        _draw_worst(top.subplots(), joint_names, motions)
        top.legend(loc="outside lower center", ncols=3)
        panels = below.subplots(
            len(joint_names), len(motions), sharex="col", sharey="row", squeeze=False
        )
        for column, motion in zip(panels.T, motions, strict=True):
            _draw_missed(column, motion)
        for axes, name in zip(panels[:, 0], joint_names, strict=True):
            axes.set_ylabel(f"{name}\n[deg]")
        handles, labels = panels[0, 0].get_legend_handles_labels()
        below.legend(handles, labels, loc="outside lower center", ncols=2)
        below.suptitle("measured less replayed")
        figure.suptitle(robot)


def worst_excerpt(motions: Sequence[Compared]) -> Excerpt:
    """Return where the replay with the identified numbers misses a joint most.

    Args:
        motions: what was measured and replayed.
    """
    squares = [np.nan_to_num(motion.after) ** 2 for motion in motions]
    rows = [np.maximum(np.isfinite(m.after).sum(axis=0), 1) for m in motions]
    means = [own.sum(axis=0) / count for own, count in zip(squares, rows, strict=True)]
    motion, joint = np.unravel_index(np.argmax(means), np.shape(means))
    missed = squares[motion][:, joint]
    length = min(round(_WORST_S / CONTROL_PERIOD_S), len(missed))
    begin = int(np.argmax(np.convolve(missed, np.ones(length), "valid")))
    rms = float(np.sqrt(means[motion][joint]))
    return Excerpt(int(motion), int(joint), slice(begin, begin + length), rms)


def _draw_worst(
    axes: Axes, joint_names: Sequence[str], motions: Sequence[Compared]
) -> None:
    at, joint, rows, rms = worst_excerpt(motions)
    name, measured, before, after = motions[at]
    time_s = CONTROL_PERIOD_S * np.arange(rows.start, rows.stop)

    def draw(angle: Array, colour: str, label: str, lw: float) -> None:
        shown = np.degrees(angle[rows, joint])
        axes.plot(time_s, shown, color=colour, label=label, lw=lw)

    draw(measured, FEET[0], "measured", 2.4)
    draw(measured - before, PLANNED, f"replayed {_BEFORE}", 0.9)
    draw(measured - after, MEASURED, f"replayed {_AFTER}", 0.9)
    axes.set_title(
        f"{joint_names[joint]}, {name}: fitted worst, {np.degrees(rms):.2g} deg RMS"
    )
    axes.set_xlabel("time [s]")
    axes.set_ylabel("angle [deg]")


def _draw_missed(column: Sequence[Axes], motion: Compared) -> None:
    """Draw what is missed of each joint in a motion, one below the other."""
    time_s = CONTROL_PERIOD_S * np.arange(len(motion.after))
    column[0].set_title(motion.name)
    column[-1].set_xlabel("time [s]")
    for joint, axes in enumerate(column):
        for table, colour, label in (
            (motion.before, PLANNED, _BEFORE),
            (motion.after, MEASURED, _AFTER),
        ):
            missed = np.degrees(table[:, joint])
            axes.plot(time_s, missed, color=colour, label=label, lw=0.6)
