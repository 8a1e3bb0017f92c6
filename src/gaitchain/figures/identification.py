"""What replays of an exercise miss, with the numbers of the file and of a fit."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from gaitchain.figures.style import MEASURED, PLANNED, drawing
from gaitchain.messages import CONTROL_PERIOD_S, Array

_WIDTH_IN, _ROW_IN = 2.4, 1.1


def plot_missed(
    joint_names: Sequence[str],
    motions: Sequence[tuple[str, Array, Array]],
    robot: str,
    path: Path,
) -> None:
    """Draw what replays miss of each joint: a row for each, a column for each motion.

    Args:
        joint_names: (2 n,) leg joints.
        motions: for each its name, and (N, 2 n) measured less replayed, with the file's
            numbers and with the identified ones [rad].
        robot: its name.
        path: the PNG.

    Raises:
        CommandError: the file cannot be written.
    """
    rows, columns = len(joint_names), len(motions)
    with drawing(path, 1.2 + _WIDTH_IN * columns, 1.0 + _ROW_IN * rows) as figure:
        panels = figure.subplots(
            rows, columns, sharex="col", sharey="row", squeeze=False
        )
        for column, (name, before, after) in zip(panels.T, motions, strict=True):
            time_s = CONTROL_PERIOD_S * np.arange(len(before))
            column[0].set_title(name)
            column[-1].set_xlabel("time [s]")
            for joint, axes in enumerate(column):
                for table, colour, label in (
                    (before, PLANNED, "with the file's numbers"),
                    (after, MEASURED, "with identified ones"),
                ):
                    missed = np.degrees(table[:, joint])
                    axes.plot(time_s, missed, color=colour, label=label, lw=0.6)
        for axes, name in zip(panels[:, 0], joint_names, strict=True):
            axes.set_ylabel(f"{name}\n[deg]")
        handles, labels = panels[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=2)
        figure.suptitle(f"{robot}: measured less replayed")
