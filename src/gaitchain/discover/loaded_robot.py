"""Any robot from what a user names: a built-in one, a TOML file, MJCF or URDF."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gaitchain.discover.find import find
from gaitchain.discover.findings import Findings
from gaitchain.discover.load import load_robot
from gaitchain.discover.profile import load_profile
from gaitchain.discover.reduce import reduce
from gaitchain.robot.reduced_biped import Biped, is_boxes, load_biped


@dataclass(frozen=True, eq=False)
class LoadedRobot:
    """A robot, and what its file says of it."""

    biped: Biped
    model: Any = None
    """The robot alone as its file has it, compiled; None for a box robot."""
    findings: Findings | None = None
    """What was found in that model."""
    notes: tuple[str, ...] = ()
    """What was repaired in the file."""


def load_body(robot: str | Path, profile: str | Path | None = None) -> LoadedRobot:
    """Load a robot.

    Args:
        robot: built-in name, name of the Menagerie, or path of a TOML, MJCF or URDF
            file.
        profile: TOML file that overrides what would be found in MJCF or URDF.

    Returns:
        The robot.

    Raises:
        RobotFileError: the file cannot be used, or the robot cannot walk; the message
            says why, and what would settle it.
    """
    if is_boxes(robot):
        return LoadedRobot(load_biped(robot))
    answers = None if profile is None else load_profile(profile)
    loaded = load_robot(robot)
    model = loaded.spec.compile()
    findings = find(model, loaded.origin, answers, loaded.speeds)
    biped = reduce(model, findings, loaded.name)
    return LoadedRobot(biped, model, findings, loaded.notes)
