"""The findings about a robot: legs, joints, soles and CoM, drawn over its geoms."""

from pathlib import Path
from typing import Any

import numpy as np

from gaitchain.discover.findings import Findings, FoundLeg
from gaitchain.discover.pinned_robot import PinnedRobot
from gaitchain.discover.shapes import ground_geoms, shapes_of
from gaitchain.discover.sole import outline_of
from gaitchain.figures.style import FEET, MEASURED, Axes, drawing
from gaitchain.messages import Array

_SHAPE = "#c9ccd1"
_WAYS = 26  # directions in which a rounded shape is outlined
# Left, bottom, width and height for the panels, in parts of the figure: those of equal
# axes grow when they are laid out again, up to its title and down to its legend.
_PANELS = (0.0, 0.04, 1.0, 0.88)
_VIEWS = (("from the left", 0, "x, forward [m]"), ("from the front", 1, "y, left [m]"))


def draw_robot(
    path: Path, model: Any, name: str, findings: Findings, portrait: Any = None
) -> None:
    """Draw a robot in its standing pose from the side, the front and above.

    Args:
        path: the PNG.
        model: the compiled robot.
        name: name of the robot, for the title.
        findings: result of `find`.
        portrait: an image of it as it will walk, beside them; None for none.

    Raises:
        CommandError: the file cannot be written.
    """
    robot = _standing(model, findings)
    floor = _floor(robot, findings)
    shapes = _silhouettes(robot, floor)
    low, high = _extent(robot, findings, [*shapes, _joint_points(robot, floor)])
    middle, half = 0.5 * (low + high), 0.5 * (high - low) + 0.05 * (high - low)[2]
    widths = [half[0], half[1], 0.7 * half[2]]
    if portrait is not None:
        widths.append(portrait.shape[1] / portrait.shape[0] * half[2])
    with drawing(path, 7.4 if portrait is None else 9.4, 4.6) as figure:
        figure.set_layout_engine("constrained", rect=_PANELS)
        side, front, above, *others = figure.subplots(
            1, len(widths), gridspec_kw={"width_ratios": widths}
        )
        for axes in others:
            _draw_portrait(axes, portrait)
        for axes, (title, axis, label) in zip((side, front), _VIEWS, strict=True):
            _draw_shapes(axes, shapes, axis)
            _draw_legs(axes, robot, findings, axis, floor)
            _draw_com(axes, robot, axis, floor)
            axes.set(title=title, xlabel=label, aspect="equal")
            axes.set_xlim(middle[axis] - half[axis], middle[axis] + half[axis])
            axes.set_ylim(min(low[2], 0.0) - 0.05 * high[2], 1.05 * high[2])
        side.set_ylabel("z, up from the soles [m]")
        _draw_soles(above, robot, findings)
        figure.legend(
            *side.get_legend_handles_labels(), loc="outside lower center", ncols=5
        )
        figure.suptitle(
            f"{name}: standing as found, hips {findings.hip_height:.3f} m high"
        )


def _standing(model: Any, findings: Findings) -> PinnedRobot:
    base = model.body(findings.base).id
    robot = PinnedRobot(model, base, findings.up, findings.forward)
    pose = np.array(robot.neutral)
    for joint in robot.joints:
        name = robot.joint_name(joint)
        if name in findings.stand:
            pose[robot.address(joint)] = findings.stand[name]
    robot.place(pose)
    return robot


def _floor(robot: PinnedRobot, findings: Findings) -> float:
    sole = findings.left.sole
    return float(robot.point(robot.model.body(sole.body).id, sole.origin)[2])


def _silhouettes(robot: PinnedRobot, floor: float) -> list[Array]:
    """Return points around each geom, in a level frame with z = 0 at the soles [m]."""
    found = []
    for body in robot.bodies:
        geoms, _ = ground_geoms(robot.model, {body})
        for shape in shapes_of(robot.model, robot.data, geoms, 0):
            around = np.concatenate([shape.touching(way) for way in _ways()])
            found.append(around - [0.0, 0.0, floor])
    return found


def _joint_points(robot: PinnedRobot, floor: float) -> Array:
    """Return the joint positions, to be drawn for a robot without geoms [m]."""
    points = np.array([robot.anchor(joint) for joint in robot.joints])
    return points - [0.0, 0.0, floor]


def _extent(
    robot: PinnedRobot, findings: Findings, seen: list[Array]
) -> tuple[Array, Array]:
    """Return two corners of the box around all points, including the soles [m]."""
    for leg in findings.legs:
        points = _sole_points(robot, leg, leg.sole.outline)
        seen = [*seen, points * [1.0, 1.0, 0.0]]
    every = np.concatenate(seen)
    return every.min(axis=0), every.max(axis=0)


def _ways() -> Array:
    """Return directions in the three coordinate planes, (N, 3) unit vectors."""
    turns = 2.0 * np.pi * (np.arange(_WAYS) + 0.5) / _WAYS
    cos, sin, zero = np.cos(turns), np.sin(turns), 0.0 * turns
    return np.concatenate(
        [
            np.stack(w, axis=1)
            for w in ((cos, sin, zero), (cos, zero, sin), (zero, cos, sin))
        ]
    )


def _draw_shapes(axes: Axes, shapes: list[Array], axis: int) -> None:
    for points in shapes:
        hull = outline_of(points[:, [axis, 2]])  # empty if seen edge-on
        axes.fill(*hull.T, facecolor=_SHAPE, edgecolor="white", lw=0.4, alpha=0.6)
    axes.axhline(0.0, color="#888888", linewidth=0.8)


def _draw_portrait(axes: Axes, portrait: Any) -> None:
    axes.imshow(portrait)
    axes.set_axis_off()
    axes.set_title("as it will walk")


def _draw_legs(
    axes: Axes, robot: PinnedRobot, findings: Findings, axis: int, floor: float
) -> None:
    """Draw both legs, the left one in front."""
    right, left = (findings.right, "right leg"), (findings.left, "left leg")
    for colour, (leg, word) in zip(FEET[::-1], (right, left), strict=True):
        _draw_leg(axes, robot, (leg, word, colour), axis, floor)


def _draw_leg(
    axes: Axes,
    robot: PinnedRobot,
    named: tuple[FoundLeg, str, str],
    axis: int,
    floor: float,
) -> None:
    leg, word, colour = named
    ids = [robot.model.joint(j).id for j in leg.joints]
    points = np.array([robot.anchor(j) for j in ids]) - [0.0, 0.0, floor]
    axes.plot(*points[:, [axis, 2]].T, "o-", color=colour, ms=4.0, lw=1.8, label=word)
    knee = points[leg.knee, [axis, 2]]
    label = "knee" if word.startswith("left") else None
    axes.plot(*knee, "o", ms=9.0, mfc="none", mec="#222222", label=label)
    sole = _sole_points(robot, leg, leg.sole.outline) - [0.0, 0.0, floor]
    axes.plot(*sole[:, [axis, 2]].T, color=colour, lw=3.0)


def _draw_com(axes: Axes, robot: PinnedRobot, axis: int, floor: float) -> None:
    com = robot.com() - [0.0, 0.0, floor]
    axes.plot(com[axis], com[2], "x", color=MEASURED, ms=8, label="CoM")
    axes.plot([com[axis]] * 2, [0.0, com[2]], color=MEASURED, lw=0.8, ls="--")


def _draw_soles(axes: Axes, robot: PinnedRobot, findings: Findings) -> None:
    """Draw the soles from above: outline, rectangle for control, CoM, ankles."""
    for colour, leg in zip(FEET, findings.legs, strict=True):
        sole = leg.sole
        outline = _sole_points(robot, leg, sole.outline)
        axes.fill(outline[:, 1], outline[:, 0], color=colour, alpha=0.35, lw=0)
        corners = [(x, y) for x in (sole.rear, sole.front) for y in (-1.0, 1.0)]
        box = np.array([(x, y * sole.half_width) for x, y in corners])[[0, 1, 3, 2, 0]]
        edges = _sole_points(robot, leg, box)
        axes.plot(edges[:, 1], edges[:, 0], color=colour, lw=1.2)
        point = _sole_points(robot, leg, np.zeros((1, 2)))[0]
        axes.plot(point[1], point[0], "+", color="#222222", ms=8)
    com = robot.com()
    axes.plot(com[1], com[0], "x", color=MEASURED, ms=8)
    axes.invert_xaxis()  # left is on the left, seen from above
    axes.set(aspect="equal", title="soles from above", xlabel="y, left [m]")
    axes.set_ylabel("x, forward from the base [m]")


def _sole_points(robot: PinnedRobot, leg: FoundLeg, flat: Array) -> Array:
    """Transform points of a sole, (N, 2), to the level frame, (N, 3) [m]."""
    sole, body = leg.sole, robot.model.body(leg.sole.body).id
    local = sole.origin + flat @ sole.rotation[:, :2].T
    return np.array([robot.point(body, p) for p in local])
