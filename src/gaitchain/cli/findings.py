"""Print and draw the findings about a full robot, with the evidence."""

from pathlib import Path
from typing import Any

import mujoco

from gaitchain.analysis.zmp_error import STRIDE, zmp_error
from gaitchain.build.own_trials import own_fault
from gaitchain.cli.console import print_table, say
from gaitchain.cli.files import check_picture
from gaitchain.cli.legs import degrees, show_legs
from gaitchain.discover.loaded_robot import LoadedRobot, load_with_findings
from gaitchain.discover.looks import read_looks
from gaitchain.errors import RenderError
from gaitchain.figures.robot import draw_robot
from gaitchain.figures.snapshots import Image, draw_portrait
from gaitchain.robot.leg_model import LegModel
from gaitchain.robot.reduced_biped import quantity_units
from gaitchain.robot.robot import Robot

_FOLDER = Path("runs/inspect")
_HEADS = "what", "finding", "evidence"


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
    check_picture(picture)
    draw_robot(picture, loaded.model, robot.name, found, _portrait(loaded))
    print_table(f"{robot.name}: what was found", _HEADS, found.evidence, range(3))
    notes = list(loaded.notes)
    if fault := own_fault(name, robot):
        notes.append(fault)
    for note in notes:
        say(f"- {note}")
    _show_reduced(robot)
    show_legs(robot.legs, found)
    _show_held(robot.legs, loaded.model)
    show_zmp_error(robot)
    say(f"{picture}: legs, soles and CoM as found")
    say("Where a finding is wrong, a profile overrides it: docs/add_your_robot.md")
    return {
        "robot": robot.name,
        "fingerprint": robot.fingerprint,
        "picture": str(picture),
        "findings": [dict(zip(_HEADS, row, strict=True)) for row in found.evidence],
        "notes": notes,
        "quantities": {
            k: value for k, (value, _) in quantity_units(robot.reduced).items()
        },
        "joints": list(robot.legs.joint_names),
    }


def _show_reduced(robot: Robot) -> None:
    """Print the numbers of the reduced biped."""
    reduced = robot.reduced
    rows = [(k, f"{v:.4g}", unit) for k, (v, unit) in quantity_units(reduced).items()]
    print_table("Reduced biped", ("quantity", "value", "unit"), rows)
    say(
        f"mass {reduced.mass:.4g} kg, leg {reduced.leg_length:.4g} m, "
        f"fingerprint {robot.fingerprint}"
    )


def _portrait(loaded: LoadedRobot) -> Image | None:
    """Render the robot in its own shapes; None where nothing can be rendered."""
    assert loaded.findings is not None
    looks = read_looks(loaded.model, loaded.findings, loaded.robot)
    try:
        return draw_portrait(loaded.robot, looks)
    except RenderError as error:
        say(f"no portrait: {error}")
        return None


def _show_held(full: LegModel, model: Any) -> None:
    """Print the joints outside the legs: hinges [deg], and slides [m]."""
    if not full.held:
        say("All joints are leg joints; nothing is held still.")
        return
    slides = {
        model.joint(i).name
        for i in range(model.njnt)
        if model.jnt_type[i] == mujoco.mjtJoint.mjJNT_SLIDE
    }
    shown = [
        f"{n} {at:.3f} m" if n in slides else f"{n} {degrees(at)}"
        for n, at in full.held.items()
    ]
    say(f"Held still, {len(shown)} joints [deg]: {', '.join(shown)}")


def show_zmp_error(robot: Robot) -> None:
    """Print the difference between point-mass ZMP and full-robot ZMP."""
    error = zmp_error(robot)
    say(
        f"ZMP of the links as points against the full model's, in single support of a "
        f"walk at {error.speed:.2f} m/s (strides of {STRIDE:g} leg): "
        f"{1e3 * error.ahead:.1f} mm ahead, {1e3 * error.left:.1f} mm to the left (rms)"
    )
