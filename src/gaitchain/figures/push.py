"""The polar plot of `gaitchain push`: the impulse that brings the robot down."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from gaitchain.build.push import PushResult
from gaitchain.figures.style import FEET, MEASURED, drawing


def plot_pushes(
    results: Sequence[PushResult], title: str, scale_ns: float, path: Path
) -> None:
    """Draw the 50 % impulse of each side, its interval, and each run.

    Args:
        results: of all sides in order.
        title: what was pushed.
        scale_ns: m sqrt(g h) of the robot [N s].
        path: the PNG.

    Raises:
        CommandError: the file cannot be written.
    """
    # A ring closes on itself, also for the eye.
    ring = [*results, results[0]]
    angle = np.radians([r.direction_deg for r in ring])
    low, high = np.array([r.interval_ns for r in ring]).T
    with drawing(path, 5.4, 5.2) as figure:
        # Forward is up.
        axes = figure.add_subplot(projection="polar", theta_offset=0.5 * math.pi)
        for i, result in enumerate(results):
            axes.plot(
                np.full(len(result.critical_ns), math.radians(result.direction_deg)),
                result.critical_ns,
                ".",
                color="#999999",
                markersize=3.0,
                label=None if i else "each run",
            )
        axes.fill_between(
            angle, low, high, color=FEET[0], alpha=0.25, lw=0, label="90 % interval"
        )
        median = [r.impulse_ns for r in ring]
        axes.plot(angle, median, color=MEASURED, marker="o", label="half of them fall")
        highest = np.concatenate([r.critical_ns for r in results]).max()
        axes.set_ylim(0.0, 1.05 * max(float(highest), 1.0))
        axes.set_xticks(angle[:-1], [_side(r.direction_deg) for r in results])
        axes.set_title(
            f"{title}\npush on the trunk [N s]; m sqrt(g h) = {scale_ns:.1f} N s"
        )
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.08), ncols=3)


def _side(direction_deg: float) -> str:
    names = {0.0: "forward", 90.0: "left", 180.0: "backward", 270.0: "right"}
    return names.get(direction_deg, f"{direction_deg:.0f}°")
