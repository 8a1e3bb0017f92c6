"""The map of `gaitchain qualify`: how many walks hold, by world and command."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from gaitchain.build.grid import EVERY_STEP
from gaitchain.figures.style import PLANNED, drawing
from gaitchain.gait.qualification import CellReport

_COLOURS = "cividis"  # one hue path for every eye, dark where walks fall
_ROW_IN, _COLUMN_IN = 0.21, 0.78
_BRIGHT = 0.55  # above it numbers are dark


def plot_pass_rates(cells: Sequence[CellReport], title: str, path: Path) -> None:
    """Draw a row for each world, a column for each group of commands.

    Args:
        cells: of a grid's report.
        title: what was walked.
        path: the PNG.

    Raises:
        CommandError: the file cannot be written.
    """
    found = {group for cell in cells for group in cell.groups}
    groups = sorted(found, key=lambda group: (group == EVERY_STEP, group))
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


def pass_rates(
    cells: Sequence[CellReport], groups: Sequence[str]
) -> np.ndarray[Any, np.dtype[np.float64]]:
    """(cells, groups) part of the walks that held, NaN where there was none."""
    rates = np.full((len(cells), len(groups)), np.nan)
    for i, cell in enumerate(cells):
        for j, group in enumerate(groups):
            runs, passes = cell.groups.get(group, (0, 0))
            rates[i, j] = passes / runs if runs else np.nan
    return rates


def _write_numbers(
    axes: Any,
    cells: Sequence[CellReport],
    groups: Sequence[str],
    rates: np.ndarray[Any, np.dtype[np.float64]],
) -> None:
    """Write passed / walked into each field."""
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
    """Draw a white line between the disturbances."""
    for i in range(1, len(cells)):
        if cells[i].kind != cells[i - 1].kind:
            axes.axhline(i - 0.5, color="white", linewidth=2.0)
