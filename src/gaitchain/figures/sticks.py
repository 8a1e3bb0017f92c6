"""Fig. 10: the four key poses of a step as stick figures."""

from collections.abc import Sequence
from numbers import Integral
from pathlib import Path
from typing import Any

import numpy as np

from gaitchain.errors import CommandError
from gaitchain.figures.style import FEET, MEASURED, Axes, drawing, rounded, write_json
from gaitchain.gait.keypose.key_poses import KeyPoses
from gaitchain.gait.keypose.primitives import PARAMETERS
from gaitchain.gait.library import GaitLibrary
from gaitchain.messages import Array
from gaitchain.robot.kinematics import POINTS, com, points
from gaitchain.robot.robot import Robot

_SUPPORT = ("support_ankle", "support_knee", "support_hip")
_SWING = ("swing_ankle", "swing_knee", "swing_hip")
_X, _Y = 0, 1
_CLAIM = {
    "text": "Key pose 1 sways to the support foot; key pose 2 sways more and lifts the "
    "swing foot; in key pose 3 the swing foot touches down by the Move action; key "
    "pose 4 sways back and becomes key pose 1 of the next step.",
    "sway_kp_2_deg": 12,
    "lift_kp_2_m": [0.04, 0.08],
}


def figure_10(out: Path, library: GaitLibrary, gait: Sequence[int]) -> dict[str, Any]:
    """Draw the key poses of a step in the sagittal and the frontal plane (Fig. 10).

    Args:
        out: folder for fig10.png and fig10.json.
        library: the key poses.
        gait: index of the pose at each key moment, such as `WalkedStep.gait`.

    Returns:
        The numbers, as in the JSON.

    Raises:
        CommandError: the library has no such pose.
    """
    poses, timing, robot = library.poses_as(KeyPoses), library.timing, library.robot
    if len(gait) != 4 or not all(
        isinstance(n, Integral) and 0 <= n < count
        for n, count in zip(gait, poses.counts, strict=True)
    ):
        raise CommandError(
            f"gait {list(gait)}: need one pose per key moment, counts {poses.counts}"
        )
    motion = poses.motion(gait, timing)
    q = motion.at(np.array(timing.key_times)).q
    states = motion.at(np.linspace(0.0, timing.step, 151))
    ankle = points(robot.reduced, states.q)[:, -1]
    _draw(out / "fig10.png", robot, q, ankle, timing.key_times)
    parameters = [poses.parameters[layer][n] for layer, n in enumerate(gait)]
    sways = np.degrees([p[PARAMETERS.index("sway")] for p in parameters])
    result = {
        "gait": [int(n) for n in gait],
        "key_times_s": list(timing.key_times),
        "parameters": [
            dict(zip(PARAMETERS, rounded(p), strict=True)) for p in parameters
        ],
        "sway_deg": rounded(sways, 2),
        "swing_ankle_path_m": rounded(ankle),
        "highest_lift_m": rounded(ankle[:, 2].max() - robot.reduced.ankle_height),
        "step_length_m": rounded(ankle[-1, 0]),
        "sways_most_in_kp_2": bool(np.argmax(sways) == 1),
        "ours": f"sway {', '.join(f'{s:.1f}' for s in sways)} deg at kp_1 to kp_4",
        "paper": _CLAIM,
    }
    return write_json(out / "fig10.json", result)


def _draw(
    path: Path, robot: Robot, q: Array, ankle: Array, times: Sequence[float]
) -> None:
    skeletons, coms = points(robot.reduced, q), com(robot.reduced, q)
    hips = robot.reduced.hip_width
    with drawing(path, 7.4, 6.2) as figure:
        panels = figure.subplots(2, 4, sharex="row", sharey=True)
        for i, (skeleton, mass) in enumerate(zip(skeletons, coms, strict=True)):
            side, front = panels[:, i]
            for axes, axis in ((side, _X), (front, _Y)):
                way = ankle[:, [axis, 2]].T
                axes.plot(*way, color=FEET[1], lw=0.9, ls=":", label="swing ankle")
                _draw_pose(axes, robot, skeleton, mass, axis)
                axes.set_aspect("equal")
            title = f"kp$_{i + 1}$, t = {times[i]:g} s"
            side.set(title=title, xlabel="x, forward [m]")
            front.set_xlabel("y, left [m]")
        panels[0, 0].set_ylabel("sagittal plane\nz, up [m]")
        panels[1, 0].set_ylabel("frontal plane\nz, up [m]")
        panels[1, 0].set_xlim(0.6 * hips + 0.1, -1.6 * hips - 0.1)
        named = panels[0, 0].get_legend_handles_labels()
        figure.legend(*named, loc="outside lower center", ncols=5)
        figure.suptitle(
            "Fig. 10: key poses of one step, support-foot frame (left leg supports)"
        )


def _draw_pose(
    axes: Axes, robot: Robot, skeleton: Array, mass: Array, axis: int
) -> None:
    """Draw one skeleton: axis 0 from the side, axis 1 from behind."""
    at = {name: skeleton[i, [axis, 2]] for i, name in enumerate(POINTS)}
    hips = 0.5 * (at["support_hip"] + at["swing_hip"])
    axes.axhline(0.0, color="#888888", linewidth=0.8)
    for names, colour, label in (
        (_SWING, FEET[1], "swing leg"),
        (_SUPPORT, FEET[0], "support leg"),
    ):
        line = np.array([at[name] for name in names])
        axes.plot(*line.T, "o-", color=colour, markersize=3.5, lw=2.2, label=label)
        axes.fill(*_sole(robot, line[0], axis).T, color=colour, alpha=0.55, lw=0)
    trunk = np.array([at["support_hip"], hips, at["trunk_top"], hips, at["swing_hip"]])
    axes.plot(*trunk.T, color="#444444", linewidth=3.0, label="trunk")
    axes.plot(mass[axis], mass[2], "x", color=MEASURED, ms=7, label="CoM")
    axes.plot([mass[axis]] * 2, [0.0, mass[2]], color=MEASURED, lw=0.7, ls="--")


def _sole(robot: Robot, ankle: Array, axis: int) -> Array:
    """Return the corners of a level foot's box below its ankle, (4, 2) [m]."""
    half = 0.5 * robot.reduced.sole_width
    low, high = robot.reduced.sole_x if axis == _X else (-half, half)
    height = robot.reduced.ankle_height
    box = np.array([[low, -height], [high, -height], [high, 0.0], [low, 0.0]])
    return np.asarray(ankle + box)
