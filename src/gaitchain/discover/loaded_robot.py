"""Any robot from what a user names: a built-in one, a TOML file, MJCF or URDF."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gaitchain.discover.catalogue import find_robot_file
from gaitchain.discover.find import find
from gaitchain.discover.findings import Findings
from gaitchain.discover.load import load_model
from gaitchain.discover.notes import doubts_told
from gaitchain.discover.profile import load_profile
from gaitchain.discover.reduce import reduce
from gaitchain.errors import RobotFileError
from gaitchain.robot.box_robot import box_file, load_box_robot
from gaitchain.robot.reduced_biped import is_boxes
from gaitchain.robot.robot import Robot
from gaitchain.robot.whole_file import given_path


@dataclass(frozen=True, eq=False)
class LoadedRobot:
    """A robot, and what its file says of it."""

    robot: Robot
    model: Any = None
    """The robot alone as its file has it, compiled; None for a box robot."""
    findings: Findings | None = None
    """What was found in that model."""
    notes: tuple[str, ...] = ()
    """What was repaired in the file."""


def robot_file(robot: str | Path) -> Path:
    """Return the file that `load_robot` reads for a name or path.

    Raises:
        RobotFileError: there is no such file and no such name.
    """
    return box_file(robot) if is_boxes(robot) else find_robot_file(robot)[0]


def load_robot(robot: str | Path, profile: str | Path | None = None) -> Robot:
    """Load a robot: a built-in one, one of the MuJoCo Menagerie, or that of a file.

    Args:
        robot: built-in name, name of the Menagerie, or path of a TOML, MJCF or URDF
            file.
        profile: TOML file that overrides what would be found in MJCF or URDF.

    Returns:
        The robot, as `build_library` takes it.

    Raises:
        RobotFileError: the file cannot be used, or the robot cannot walk; the message
            says why, and what would settle it.
    """
    return load_with_findings(robot, profile).robot


def load_with_findings(
    robot: str | Path, profile: str | Path | None = None
) -> LoadedRobot:
    """Load a robot, and keep what its file says of it.

    Args:
        robot: see `load_robot`.
        profile: see `load_robot`.

    Returns:
        The robot, and what was found of it.

    Raises:
        RobotFileError: see `load_robot`.
    """
    given_path(robot, "a robot", RobotFileError)
    if is_boxes(robot):
        if profile is not None:
            raise RobotFileError(
                f"profile {profile}: {robot} is a robot of boxes; a profile is for a "
                "robot's MJCF or URDF"
            )
        return LoadedRobot(load_box_robot(robot))
    answers = None if profile is None else load_profile(profile)
    loaded = load_model(robot)
    origin = loaded.origin
    with doubts_told(loaded.notes):
        findings = find(loaded.model, origin, answers, loaded.speeds, loaded.balls)
        found = reduce(loaded.model, findings, loaded.name, origin)
    return LoadedRobot(found, loaded.model, findings, loaded.notes)
