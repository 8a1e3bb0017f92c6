"""Style and output of figures; the only module that imports matplotlib."""

# ruff: noqa: PLC0415 - matplotlib loads only when a figure is drawn.

import json
import math
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from gaitchain.errors import CommandError, file_errors, needed_by

if TYPE_CHECKING:
    import matplotlib.axes
    import matplotlib.figure

Axes: TypeAlias = "matplotlib.axes.Axes"
"""A panel of a figure."""
_Figure: TypeAlias = "matplotlib.figure.Figure"
FEET = ("#1f6fb4", "#d9772b")
"""Colours of the left and the right foot."""
MEASURED, PLANNED, PAPER = "#c22f30", "#555555", "#8a3ab9"
REGION_COLOURS = {
    "rs": "#d9772b",
    "rl": "#7a9a3a",
    "ls": "#1f6fb4",
    "lr": "#8b5aa8",
    "stand": "#888888",
}
REGION_NAMES = {
    "rs": "rs: right foot alone",
    "rl": "rl: right to left, both feet",
    "ls": "ls: left foot alone",
    "lr": "lr: left to right, both feet",
    "stand": "standing",
}
_DPI = 200
_STYLE: dict[Any, Any] = {
    "font.size": 9.0,
    "axes.titlesize": 9.5,
    "figure.titlesize": 10.0,
    "axes.labelsize": 9.0,
    "legend.fontsize": 8.0,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e6e6e6",
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.3,
    "legend.frameon": False,
}


@contextmanager
def drawing(path: Path, width_in: float, height_in: float) -> Iterator[_Figure]:
    """Yield an empty figure and write it as a PNG at the end.

    Args:
        path: the PNG.
        width_in: width [inch].
        height_in: height [inch].

    Raises:
        CommandError: the file cannot be written.
    """
    with needed_by("a figure"):
        import matplotlib
        from matplotlib.figure import Figure

    with matplotlib.rc_context(_STYLE):
        figure = Figure(figsize=(width_in, height_in), layout="constrained")
        yield figure
        with file_errors(path, "written", CommandError), _boxes_for_lost_glyphs():
            path.parent.mkdir(parents=True, exist_ok=True)
            figure.savefig(path, dpi=_DPI, format="png", metadata={"Software": None})


@contextmanager
def _boxes_for_lost_glyphs() -> Iterator[None]:
    """Draw letters that the font lacks, as of a robot's name, as boxes and in peace."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing from", UserWarning)
        yield


def legend_beside(axes: Axes, label: str) -> None:
    """Put a legend to the right of a panel, and a label on its vertical axis."""
    axes.set_ylabel(label)
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))


def annotate(axes: Axes, text: str, x: float, height: float, **style: Any) -> None:
    """Write text at x in data units and a height as a part of the panel's."""
    place = {"xycoords": ("data", "axes fraction"), "ha": "center", "va": "bottom"}
    axes.annotate(text, (x, height), **{**place, **style})


def write_json(path: Path, data: dict[str, Any]) -> dict[str, Any]:
    """Write the numbers behind a figure and return them.

    Raises:
        CommandError: the file cannot be written.
    """
    text = json.dumps(data, indent=1, allow_nan=False)
    with file_errors(path, "written", CommandError):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"{text}\n", encoding="utf-8")
    return data


def rounded(values: Any, digits: int = 4) -> Any:
    """Convert an array to nested lists for JSON, with None for non-finite values."""
    if np.ndim(values):
        return [rounded(part, digits) for part in values]
    return round(float(values), digits) if math.isfinite(values) else None
