"""Fig. 11: the path of the ZMP on the ground, through the planned support regions."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from gaitchain.analysis.record import WalkRecord, support_stays
from gaitchain.analysis.walk_metrics import zmp_margins
from gaitchain.figures.steps import WalkedStep, outline, step_plan, two_cycles
from gaitchain.figures.style import (
    FEET,
    PLANNED,
    REGION_COLOURS,
    REGION_NAMES,
    Axes,
    drawing,
    rounded,
    write_json,
)
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.zmp import to_world
from gaitchain.messages import Array
from gaitchain.robot.robot import Robot

_EVERY = 4  # rows of 10 ms: 25 Hz in the JSON
_SMOOTH = 11  # rows of 10 ms
_DASHED: dict[str, Any] = {"color": PLANNED, "linewidth": 0.8, "dashes": (3, 2)}
_QUANTILES = (0.0, 0.05, 0.25, 0.5, 0.75, 0.95, 1.0)
_CLAIM = {
    "fraction_inside": 1.0,
    "support_sequence": ["rs", "rl", "ls", "lr"],
    "text": "Over two gait cycles the ZMP moves from one supporting foot to the other "
    "through the regions rs, rl, ls, lr and keeps inside the stable region.",
}


def figure_11(out: Path, record: WalkRecord, library: GaitLibrary) -> dict[str, Any]:
    """Draw the ZMP of two gait cycles in the horizontal plane (Fig. 11).

    The cycles are the second to the fifth step, or all steps of a shorter walk. The
    planned ZMP is transformed to the measured pose of the support foot.

    Args:
        out: folder for fig11.png and fig11.json.
        record: the walk.
        library: the library that was walked.

    Returns:
        The numbers, as in the JSON.

    Raises:
        CommandError: the robot finished no step.
    """
    steps = two_cycles(record)
    plans = [_in_world(record, library, step) for step in steps]
    _draw(out / "fig11.png", record, library.robot, steps, plans)
    rows = slice(steps[0].rows.start, steps[-1].rows.stop)
    every = slice(rows.start, rows.stop, _EVERY)
    margins = zmp_margins(library.robot, record)[rows]
    standing = margins[np.isfinite(margins)]
    support = record.support[rows]
    result = {
        "time_s": rounded(record.time_s[every]),
        "zmp_x_m": rounded(record.zmp[every, 0]),
        "zmp_y_m": rounded(record.zmp[every, 1]),
        "planned_x_m": [rounded(full[::_EVERY, 0]) for full, _ in plans],
        "planned_y_m": [rounded(full[::_EVERY, 1]) for full, _ in plans],
        "planned_from_s": [rounded(record.time_s[s.rows.start]) for s in steps],
        "period_s": rounded(_EVERY * np.diff(record.time_s[:2]).item()),
        "support": record.support[every].tolist(),
        "support_sequence": [name for name, _, _ in support_stays(support)],
        "fraction_inside": rounded(np.mean(margins >= 0.0)),
        "fraction_inside_by_region": _inside_by_region(support, margins),
        "margin_quantiles_mm": {
            f"{p:g}": rounded(1e3 * np.quantile(standing, p), 2) for p in _QUANTILES
        },
        "planned_to_measured_rms_mm": _single_support_rms(record, steps, plans),
        "interpolated_to_multi_link_rms_mm": rounded(
            _rms_mm([fast - full for full, fast in plans]), 2
        ),
        "ours": f"{np.mean(margins >= 0.0):.0%} of the time inside",
        "paper": _CLAIM,
    }
    return write_json(out / "fig11.json", result)


def draw_ground(axes: Axes, record: WalkRecord, rows: slice) -> None:
    """Draw the measured ZMP from above, coloured by the planned support region."""
    smooth, named = _smooth(record.zmp), set[str]()
    for name, begin, end in support_stays(record.support[rows], rows.start):
        label = None if name in named else REGION_NAMES[name]
        named.add(name)
        _draw_zmp(axes, name, record.zmp[begin : end + 1].T, {"alpha": 0.35, "lw": 0.6})
        _draw_zmp(axes, name, smooth[begin : end + 1].T, {"label": label, "lw": 1.6})
    axes.set(aspect="equal", xlabel="x, forward [m]", ylabel="y, left [m]")


def draw_sole(axes: Axes, robot: Robot, foot: Array, side: int) -> None:
    """Draw a footprint, side 0 for left."""
    x, y = outline(robot, foot).T
    axes.fill(x, y, facecolor=FEET[side], alpha=0.08, zorder=1)
    axes.plot(x, y, color=FEET[side], linewidth=1.0, alpha=0.7, zorder=2)


def _draw_zmp(axes: Axes, name: str, xy: Any, style: dict[str, Any]) -> None:
    axes.plot(*xy, color=REGION_COLOURS[name], zorder=4, **style)


def _draw(
    path: Path,
    record: WalkRecord,
    robot: Robot,
    steps: Sequence[WalkedStep],
    plans: Sequence[tuple[Array, Array]],
) -> None:
    rows = slice(steps[0].rows.start, steps[-1].rows.stop)
    with drawing(path, 7.4, 5.6) as figure:
        grid = figure.add_gridspec(2, 2, height_ratios=(1.0, 0.85))
        ground = figure.add_subplot(grid[0, :])
        _draw_footprints(ground, record, robot, steps)
        draw_ground(ground, record, rows)
        for i, (full, _) in enumerate(plans):
            label = None if i else "planned, multi-link, from where the foot stands"
            ground.plot(*full.T, label=label, zorder=3, **_DASHED)
        ground.margins(0.03, 0.13)
        for axis, name in enumerate(("x, forward", "y, left")):
            axes = figure.add_subplot(grid[1, axis])
            _draw_coordinate(axes, record, steps, plans, axis)
            axes.set_ylabel(f"ZMP {name} [m]")
        figure.legend(loc="outside lower center", ncols=3)
        figure.suptitle(
            f"Fig. 11: measured ZMP of steps {steps[0].number} to {steps[-1].number}, "
            "world frame (thin: every 10 ms, bold: 0.1 s mean)"
        )


def _draw_footprints(
    axes: Axes, record: WalkRecord, robot: Robot, steps: Sequence[WalkedStep]
) -> None:
    """Draw the support sole of each step, and the soles where the cycles end."""
    for step in steps:
        foot = record.feet[step.midstance, step.support_foot]
        draw_sole(axes, robot, foot, step.support_foot)
        outer = 0.75 * robot.reduced.sole_width * (1.0 if step.left_support else -1.0)
        place = to_world(
            np.array([robot.reduced.sole_offset, outer]), foot, left_support=True
        )
        name = f"step {step.number}"
        axes.text(place[0], place[1], name, fontsize=7.5, ha="center", va="center")
    last = steps[-1]
    row = min(last.rows.stop, len(record.time_s) - 1)
    other = 1 - last.support_foot
    draw_sole(axes, robot, record.feet[row, other], other)


def _draw_coordinate(
    axes: Axes,
    record: WalkRecord,
    steps: Sequence[WalkedStep],
    plans: Sequence[tuple[Array, Array]],
    axis: int,
) -> None:
    rows = slice(steps[0].rows.start, steps[-1].rows.stop)
    time_s, raw, smooth = record.time_s, record.zmp[:, axis], _smooth(record.zmp)
    for name, begin, end in support_stays(record.support[rows], rows.start):
        stay = slice(begin, end + 1)
        _draw_zmp(axes, name, (time_s[stay], raw[stay]), {"alpha": 0.35, "lw": 0.6})
        _draw_zmp(axes, name, (time_s[stay], smooth[stay, axis]), {"lw": 1.6})
    for step, (full, _) in zip(steps, plans, strict=True):
        axes.plot(time_s[step.rows], full[:, axis], zorder=5, **_DASHED)
    axes.set_xlabel("time [s]")


def _in_world(
    record: WalkRecord, library: GaitLibrary, step: WalkedStep
) -> tuple[Array, Array]:
    time_s = record.time_s[step.rows] - record.time_s[step.rows.start]
    feet = record.feet[step.rows, step.support_foot]
    full, fast = step_plan(library, step, time_s)
    left = step.left_support
    return to_world(full, feet, left), to_world(fast, feet, left)


def _smooth(points: Array) -> Array:
    """Average over 0.1 s for the picture only; the JSON is not smoothed."""
    known = ~np.isnan(points[:, 0])
    kernel = np.ones(_SMOOTH)
    weight = np.convolve(known, kernel, "same")
    filled = np.where(known[:, None], points, 0.0)
    sums = np.stack([np.convolve(c, kernel, "same") for c in filled.T], axis=1)
    mean = sums / np.maximum(weight, 1.0)[:, None]
    return np.asarray(np.where(weight[:, None] > 0.0, mean, np.nan))


def _inside_by_region(support: Any, margins: Array) -> dict[str, float]:
    names = [name for name in REGION_NAMES if (support == name).any()]
    inside = np.asarray(margins >= 0.0)
    return {name: rounded(inside[support == name].mean()) for name in names}


def _single_support_rms(
    record: WalkRecord,
    steps: Sequence[WalkedStep],
    plans: Sequence[tuple[Array, Array]],
) -> dict[str, float]:
    """Return the RMS of planned minus measured ZMP in single support: x, y, both."""
    parts = []
    for step, (full, _) in zip(steps, plans, strict=True):
        single = step.moments[2] - step.moments[0]
        parts.append(full[:single] - record.zmp[step.rows][:single])
    off = np.concatenate(parts)
    off = off[np.isfinite(off).all(axis=1)]
    return {
        "x": rounded(_rms_mm([off[:, :1]]), 2),
        "y": rounded(_rms_mm([off[:, 1:]]), 2),
        "both": rounded(_rms_mm([off]), 2),
    }


def _rms_mm(offsets: Sequence[Array]) -> float:
    """Return the root mean square length of the offsets [mm]."""
    squares = (np.concatenate(offsets) ** 2).sum(axis=-1)
    return float(1e3 * np.sqrt(squares.mean()))
