"""Fig. 8: the joint angles of a walk."""

from pathlib import Path
from typing import Any

import numpy as np

from gaitchain.analysis.record import WalkRecord
from gaitchain.figures.steps import WalkedStep, walked_steps
from gaitchain.figures.style import (
    FEET,
    MEASURED,
    Axes,
    annotate,
    drawing,
    rounded,
    write_json,
)
from gaitchain.messages import Array
from gaitchain.robot.robot import Robot

_EVERY = 4  # rows of 10 ms: 25 Hz in the JSON
_CLAIM = {
    "max_angle_deg": 80.0,
    "motor_speed_deg_s": 150.0,
    "text": "All joints stay within -80 to 80 deg at 0.08 m/s, and move at about half "
    "of the motors' 150 deg/s.",
}


def figure_8(out: Path, record: WalkRecord, robot: Robot) -> dict[str, Any]:
    """Draw the joint angles of the whole walk, measured and as planned (Fig. 8).

    Args:
        out: folder for fig08.png and fig08.json.
        record: the walk.
        robot: the robot.

    Returns:
        The numbers, as in the JSON.

    Raises:
        CommandError: the robot finished no step.
    """
    names = record.joint_names
    angles = np.degrees(record.joint_position)
    speeds = np.degrees(record.joint_velocity)
    _draw_joints(out / "fig08.png", record, robot)
    result = {
        "time_s": rounded(record.time_s[::_EVERY], 3),
        "angle_deg": {
            name: rounded(angles[::_EVERY, i], 2) for i, name in enumerate(names)
        },
        "max_angle_deg": rounded(np.abs(angles).max(), 2),
        "max_speed_deg_s": rounded(np.abs(speeds).max(), 2),
        "max_angle_deg_by_joint": _by_joint(names, angles),
        "max_speed_deg_s_by_joint": _by_joint(names, speeds),
        "tracking_rms_deg": rounded(
            np.degrees(np.sqrt(np.mean((record.joint_position - record.target) ** 2)))
        ),
        "ours": f"at most {np.abs(angles).max():.0f} deg and "
        f"{np.abs(speeds).max():.0f} deg/s",
        "paper": _CLAIM,
    }
    return write_json(out / "fig08.json", result)


def _draw_joints(path: Path, record: WalkRecord, robot: Robot) -> None:
    steps = walked_steps(record)
    full = robot.legs
    both = range(full.leg_joints)  # one panel for each pair of left and right joint
    sagittal = [j for j in both if full.joint_names[j] in full.sagittal]
    frontal = [j for j in both if j not in sagittal]
    rows = max(len(sagittal), len(frontal))
    limit = float(np.degrees(robot.reduced.joint_angle_limit))
    with drawing(path, 8.6, 6.6) as figure:
        panels = figure.subplots(rows, 2, sharex=True, sharey="col")
        for column, joints in zip(panels.T, (sagittal, frontal), strict=True):
            for axes, joint in zip(column, joints, strict=False):
                _draw_joint(axes, record, joint)
        for axes in panels[: len(sagittal), 0]:
            _draw_limits(axes, limit)
        for axes in panels.flat:
            _mark_moments(axes, record, steps)
        for axes, plane in zip(panels[0], ("sagittal", "frontal"), strict=True):
            note = "red: limits" if plane == "sagittal" else "limits beyond the axis,"
            axes.set_title(f"{plane} plane ({note} ±{limit:g}°)", pad=14)
        for axes in panels[-1]:
            axes.set_xlabel("time [s]")
        handles, labels = panels[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=4)
        figure.suptitle(
            "Fig. 8: joint angles of the walk; key moments 1 to 3 of each step above, "
            "kp$_4$ is kp$_1$ of the next"
        )


def _draw_joint(axes: Axes, record: WalkRecord, joint: int) -> None:
    names = record.joint_names
    for side, name in enumerate(("left", "right")):
        column = joint + side * (len(names) // 2)
        measured = np.degrees(record.joint_position[:, column])
        target = np.degrees(record.target[:, column])
        axes.plot(record.time_s, measured, color=FEET[side], label=f"{name}, measured")
        dashes = (0, (3, 2) if side == 0 else (1, 1.5))
        style: dict[str, Any] = {"color": "black", "lw": 0.7, "linestyle": dashes}
        axes.plot(record.time_s, target, label=f"{name}, target", **style)
    axes.set_ylabel(f"{_shown(names[joint])} [deg]")


def _draw_limits(axes: Axes, limit: float) -> None:
    """Draw the limits -limit and limit [deg], and a little beyond them."""
    for side in (-limit, limit):
        axes.axhline(side, color=MEASURED, linewidth=0.8, linestyle=":")
    axes.set_ylim(-1.15 * limit, 1.15 * limit)
    axes.set_yticks(np.linspace(-limit, limit, 5))


def _shown(name: str) -> str:
    return name.removeprefix("left_").replace("_", " ")


def _mark_moments(axes: Axes, record: WalkRecord, steps: list[WalkedStep]) -> None:
    """Draw the key moments as vertical lines, numbered above the top panels."""
    top = axes.get_subplotspec()
    numbered = top is not None and top.is_first_row()
    for step in steps:
        for i, row in enumerate(step.moments):
            time_s = record.time_s[min(row, len(record.time_s) - 1)]
            colour = "#b5b5b5" if i in (0, 3) else "#dddddd"
            axes.axvline(time_s, color=colour, linewidth=0.8, zorder=0)
            if numbered and i < 3:
                annotate(axes, f"{i + 1}", time_s, 1.01, fontsize=6.5, color="#666666")
    axes.grid(visible=False, axis="x")


def _by_joint(names: tuple[str, ...], degrees: Array) -> dict[str, float]:
    largest = np.abs(degrees).max(axis=0)
    return {name: rounded(largest[i], 2) for i, name in enumerate(names)}
