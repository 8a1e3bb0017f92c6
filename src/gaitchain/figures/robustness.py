"""Robustness of a walk: pass rates of `qualify`, impulses of `push`."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from gaitchain.build.grid import EVERY_STEP
from gaitchain.build.push import PushResult
from gaitchain.errors import CommandError
from gaitchain.figures.style import FEET, MEASURED, PLANNED, drawing
from gaitchain.gait.qualification import CellReport
from gaitchain.messages import Array
from gaitchain.sim.bodies import ANY_BODY
from gaitchain.sim.push import Push

_COLOURS = "cividis"  # readable with any colour vision, dark for falls
_ROW_IN, _COLUMN_IN = 0.21, 0.78
_BEYOND = 2.0  # times the hardest run: how far from the middle an interval is shown
_BRIGHT = 0.55  # pass rate above which the numbers are dark


def plot_pass_rates(cells: Sequence[CellReport], title: str, path: Path) -> None:
    """Draw a row for each world, a column for each group of commands.

    Args:
        cells: cells of a grid's report.
        title: title of the figure.
        path: the PNG.

    Raises:
        CommandError: the file cannot be written, or the cells have no walks.
    """
    found = {group for cell in cells for group in cell.groups}
    groups = sorted(found, key=lambda group: (group == EVERY_STEP, group))
    if not groups:
        raise CommandError(f"{path}: no walks to draw; give the cells of a report")
    rates = pass_rates(cells, groups)
    size = 2.6 + _COLUMN_IN * len(groups), 1.5 + _ROW_IN * len(cells)
    with drawing(path, *size) as figure:
        axes = figure.add_subplot()
        image = axes.imshow(rates, cmap=_COLOURS, vmin=0.0, vmax=1.0, aspect="auto")
        axes.grid(visible=False)
        axes.spines[:].set_visible(False)
        axes.set_xticks(range(len(groups)), [g.replace(" ", "\n", 1) for g in groups])
        axes.set_yticks(range(len(cells)), [cell.name for cell in cells])
        axes.tick_params(length=0, top=True, labeltop=True, bottom=False)
        axes.tick_params(labelbottom=False)
        for label, cell in zip(axes.get_yticklabels(), cells, strict=True):
            label.set_fontweight("bold" if cell.required else "normal")
        _write_numbers(axes, cells, groups, rates)
        _part_kinds(axes, cells)
        axes.set_title(f"{title}\nwalks that held; bold rows are required")
        bar = figure.colorbar(image, ax=axes, fraction=0.03, pad=0.02)
        bar.set_label("part of the walks that held")
        bar.outline.set_visible(False)


def pass_rates(cells: Sequence[CellReport], groups: Sequence[str]) -> Array:
    """Return the pass rates, (cells, groups), NaN without walks."""
    counts = [[cell.groups.get(group, (0, 0)) for group in groups] for cell in cells]
    runs, passes = np.moveaxis(np.array(counts, dtype=np.float64), -1, 0)
    return np.asarray(passes / np.where(runs > 0.0, runs, np.nan))


def _write_numbers(
    axes: Any, cells: Sequence[CellReport], groups: Sequence[str], rates: Array
) -> None:
    """Write "passed / walked" into each field."""
    for i, cell in enumerate(cells):
        for j, group in enumerate(groups):
            runs, passes = cell.groups.get(group, (0, 0))
            colour = "black" if rates[i, j] > _BRIGHT else "white"
            style = {"ha": "center", "va": "center", "fontsize": 7.0}
            if runs:
                axes.text(j, i, f"{passes}/{runs}", color=colour, **style)
            else:
                axes.text(j, i, "-", color=PLANNED, **style)


def _part_kinds(axes: Any, cells: Sequence[CellReport]) -> None:
    """Draw a white line between different disturbances."""
    for i in range(1, len(cells)):
        if cells[i].kind != cells[i - 1].kind:
            axes.axhline(i - 0.5, color="white", linewidth=2.0)


def plot_pushes(
    results: Sequence[PushResult],
    title: str,
    scale_ns: float,
    path: Path,
    interval: str = "90 % interval",
    body: str = Push.body,
) -> None:
    """Draw the 50 % impulse of each side, its interval, and each run.

    Args:
        results: results of all directions in order.
        title: title of the figure.
        scale_ns: m sqrt(g h) of the robot [N s].
        path: the PNG.
        interval: name of the interval.
        body: name of the body that was pushed, or `bodies.ANY_BODY`.

    Raises:
        CommandError: the file cannot be written, or there are no results.
    """
    if not results:
        raise CommandError(f"{path}: no pushes to draw; give one result or more")
    # Repeat the first direction to close the curve.
    ring = [*results, results[0]]
    angle = np.radians([r.direction_deg for r in ring])
    low, high = np.array([r.interval_ns for r in ring]).T
    with drawing(path, 5.4, 5.2) as figure:
        # Forward points up.
        axes = figure.add_subplot(projection="polar", theta_offset=0.5 * math.pi)
        _draw_runs(axes, results)
        rim, cut = _rim(results)
        name = f"{interval}, beyond the rim too" if cut else interval
        axes.fill_between(angle, low, high, color=FEET[0], alpha=0.25, lw=0, label=name)
        median = [r.impulse_ns for r in ring]
        axes.plot(angle, median, color=MEASURED, marker="o", label="half of them fall")
        axes.set_ylim(0.0, rim)
        axes.set_xticks(angle[:-1], [_side(r.direction_deg) for r in results])
        pushed = "a body drawn for each run" if body == ANY_BODY else body
        axes.set_title(
            f"{title}\npush on {pushed} [N s]; m sqrt(g h) = {scale_ns:.1f} N s"
        )
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.08), ncols=3)


def _rim(results: Sequence[PushResult]) -> tuple[float, bool]:
    """Return the impulse at the rim [N s], and whether an interval goes beyond it.

    Few runs leave intervals beside which nothing else would be seen.
    """
    runs = float(np.concatenate([r.critical_ns for r in results]).max())
    ends = np.array([r.interval_ns[1] for r in results])
    end = float(ends.max(initial=0.0, where=~np.isnan(ends)))
    most = _BEYOND * max(runs, 1.0)
    return 1.05 * max(runs, min(end, most), 1.0), end > 1.05 * most


def _draw_runs(axes: Any, results: Sequence[PushResult]) -> None:
    """Draw the impulse at which each run begins to fall, along its direction."""
    for i, result in enumerate(results):
        axes.plot(
            np.full(len(result.critical_ns), math.radians(result.direction_deg)),
            result.critical_ns,
            ".",
            color="#999999",
            markersize=3.0,
            label=None if i else "each run",
        )


def _side(direction_deg: float) -> str:
    names = {0.0: "forward", 90.0: "left", 180.0: "backward", 270.0: "right"}
    return names.get(direction_deg, f"{direction_deg:.0f}°")
