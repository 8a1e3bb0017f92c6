"""Print and draw the findings about a full robot, with the evidence."""

import math
from pathlib import Path
from typing import Any

from gaitchain.analysis.zmp_error import STRIDE, zmp_error
from gaitchain.cli.console import check_writable, print_table, say
from gaitchain.discover.findings import Findings
from gaitchain.discover.loaded_robot import LoadedRobot, load_with_findings
from gaitchain.discover.looks import read_looks
from gaitchain.errors import RenderError
from gaitchain.figures.robot import draw_robot
from gaitchain.figures.snapshots import Image, draw_portrait
from gaitchain.messages import Array
from gaitchain.robot.leg_model import LegModel
from gaitchain.robot.reduced_biped import quantity_units
from gaitchain.robot.robot import Robot

_FOLDER = Path("runs/inspect")
_ALONG = 0.999  # least component of a unit axis that counts as x, y or z
_JOINTS = ("joint", "axis", "range [deg]", "stand [deg]")
_SERVOS = (
    "joint",
    "kp\n[N m/rad]",
    "kv\n[N m s/rad]",
    "joint's damping\n[N m s/rad]",
    "limit\n[N m]",
    "speed\n[rad/s]",
)


def show_full_robot(
    name: str, profile: Path | None, out: Path | None
) -> dict[str, Any]:
    """Print, draw and return the findings about a robot.

    Args:
        name: name or path of an MJCF or URDF file.
        profile: file that overrides findings, if any.
        out: path of the PNG; named after the robot by default.

    Raises:
        GaitchainError: the robot cannot be used, or a file cannot be written.
    """
    loaded = load_with_findings(name, profile)
    robot, found = loaded.robot, loaded.findings
    assert found is not None and not robot.boxes
    picture = out or _FOLDER / f"{Path(name).stem}.png"
    check_writable(picture)
    draw_robot(picture, loaded.model, robot.name, found, _portrait(loaded))
    heads = ("what", "finding", "evidence")
    print_table(f"{robot.name}: what was found", heads, found.evidence, range(3))
    for note in loaded.notes:
        say(f"- {note}")
    rows = [
        (k, f"{v:.4g}", unit) for k, (v, unit) in quantity_units(robot.reduced).items()
    ]
    print_table("Reduced biped", ("quantity", "value", "unit"), rows)
    say(
        f"mass {robot.reduced.mass:.4g} kg, leg {robot.reduced.leg_length:.4g} m, "
        f"fingerprint {robot.fingerprint}"
    )
    show_legs(robot.legs, found)
    _show_held(robot.legs)
    show_zmp_error(robot)
    say(f"{picture}: legs, soles and CoM as found")
    say("Where a finding is wrong, a profile overrides it: docs/add_your_robot.md")
    return {
        "robot": robot.name,
        "fingerprint": robot.fingerprint,
        "picture": str(picture),
        "findings": [
            dict(zip(("what", "finding", "evidence"), row, strict=True))
            for row in found.evidence
        ],
        "notes": list(loaded.notes),
        "quantities": {
            k: value for k, (value, _) in quantity_units(robot.reduced).items()
        },
        "joints": list(robot.legs.joint_names),
    }


def _portrait(loaded: LoadedRobot) -> Image | None:
    """Render the robot in its own shapes; None where nothing can be rendered."""
    assert loaded.findings is not None
    looks = read_looks(loaded.model, loaded.findings, loaded.robot)
    try:
        return draw_portrait(loaded.robot, looks)
    except RenderError as error:
        say(f"no portrait: {error}")
        return None


def show_legs(full: LegModel, found: Findings | None = None) -> None:
    """Print a robot's leg joints, hip to ankle, left leg first.

    Args:
        full: the robot's legs.
        found: findings with the sources of the servo parameters, if known.
    """
    names = full.joint_names
    axes = full.axis.reshape(-1, 3)
    spans = [
        f"{math.degrees(low):.0f} to {math.degrees(high):.0f}"
        for low, high in zip(full.lower, full.upper, strict=True)
    ]
    stand = map(_degrees, full.stand)
    joints = zip(names, map(_axis, axes), spans, stand, strict=True)
    print_table("Leg joints, hip to ankle", _JOINTS, joints, range(2))
    servos = [
        (
            name,
            f"{full.stiffness[j]:.4g}",
            f"{full.damping[j] - full.joint_damping[j]:.3g}",
            f"{full.joint_damping[j]:.3g}",
            f"{full.torque_limit[j]:.3g}",
            _speed(full, j, found),
            *(() if found is None else (found.servos[name].source,)),
        )
        for j, name in enumerate(names)
    ]
    heads = _SERVOS if found is None else (*_SERVOS, "servo from")
    print_table("Their servos", heads, servos, {0, len(_SERVOS)})


def _speed(full: LegModel, joint: int, found: Findings | None) -> str:
    """Return a servo's speed limit as text, or the assumed one if the file has none."""
    limit = f"{full.speed_limit[joint]:.3g}"
    unsaid = found and found.servos[full.joint_names[joint]].speed_limit == math.inf
    return f"unsaid: {limit}" if unsaid else limit


def _degrees(angle: float) -> str:
    # + 0.0 turns -0.0 into 0.0.
    return f"{round(math.degrees(angle), 1) + 0.0:.1f}"


def _axis(axis: Array) -> str:
    """Return the name of an axis of the pelvis frame: x forward, y left, z up."""
    for name, share in zip("xyz", axis.tolist(), strict=True):
        if abs(share) > _ALONG:
            return f"{'+' if share > 0.0 else '-'}{name}"
    return "({:.2f}, {:.2f}, {:.2f})".format(*(axis + 0.0).tolist())


def _show_held(full: LegModel) -> None:
    if not full.held:
        say("All joints are leg joints; nothing is held still.")
        return
    angles = [f"{n} {_degrees(a)}" for n, a in full.held.items()]
    say(f"Held still, {len(angles)} joints [deg]: {', '.join(angles)}")


def show_zmp_error(robot: Robot) -> None:
    """Print the difference between point-mass ZMP and full-robot ZMP."""
    error = zmp_error(robot)
    say(
        f"ZMP of the links as points against the full model's, in single support of a "
        f"walk at {error.speed:.2f} m/s (strides of {STRIDE:g} leg): "
        f"{1e3 * error.ahead:.1f} mm ahead, {1e3 * error.left:.1f} mm to the left (rms)"
    )
