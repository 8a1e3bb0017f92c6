"""Ways from lying to standing: key poses of the whole robot, and their file. Ours."""

from pathlib import Path
from typing import Annotated, Literal

import msgspec
import numpy as np
from msgspec import Meta

from gaitchain.errors import LibraryError, file_errors, short_name
from gaitchain.messages import Array
from gaitchain.robot.robot import Robot
from gaitchain.robot.whole_file import read_file, replace_file

Side = Literal["front", "back"]
"""What the robot lies on."""
SIDES: tuple[Side, ...] = ("front", "back")
_MOST_BYTES = 10_000_000  # ways of some robots have 20 000
_Seconds = Annotated[float, Meta(gt=0.0, le=60.0)]
_Angle = Annotated[float, Meta(ge=-10.0, le=10.0)]


class TimedPose(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A pose of the whole robot, and how long the joints take to it."""

    seconds: _Seconds
    angles: tuple[_Angle, ...]
    """Of each joint, in the order of `GetUp.joint_names` [rad]."""


class Way(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Key poses from lying to standing, and how often they led there."""

    poses: Annotated[tuple[TimedPose, ...], Meta(min_length=1)]
    stood: Annotated[int, Meta(ge=0)]
    """Of the starts that were tried after the search, which had not seen them."""
    starts: Annotated[int, Meta(ge=1)]

    @property
    def seconds(self) -> float:
        """How long it takes [s]."""
        return sum(pose.seconds for pose in self.poses)


class GetUp(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How one robot gets up."""

    robot: str
    fingerprint: str
    """Of the robot, as its library has it."""
    joint_names: tuple[str, ...]
    lying: tuple[_Angle, ...]
    """Pose that each way begins with [rad]."""
    ways: dict[Side, Way]

    def __post_init__(self) -> None:
        """Check that all poses are of these joints, each named once.

        Raises:
            ValueError: one is not.
        """
        joints = len(self.joint_names)
        if len({*self.joint_names}) < joints:
            names = self.joint_names
            twice = sorted({name for name in names if names.count(name) > 1})
            raise ValueError(
                f"joint_names has {', '.join(twice)} more than once; each joint is "
                "named once"
            )
        poses = [pose.angles for way in self.ways.values() for pose in way.poses]
        for angles in (self.lying, *poses):
            if len(angles) != joints:
                raise ValueError(f"a pose has {len(angles)} joints, not {joints}")


def way_targets(way: Way, start: Array, period_s: float) -> Array:
    """Return the joint targets of a way, smooth from pose to pose.

    Between two poses q_a and q_b that are T apart, with s = t / T,

        q = q_a + (3 s^2 - 2 s^3) (q_b - q_a)                                       (1)

    so that the joints rest in each pose.

    Args:
        way: the key poses.
        start: (n,) angles before the first [rad].
        period_s: control period [s].

    Returns:
        (ticks, n) [rad].
    """
    rows, last = [], np.asarray(start, dtype=float)
    for pose in way.poses:
        part = np.linspace(0.0, 1.0, max(round(pose.seconds / period_s), 1) + 1)[1:]
        smooth = part**2 * (3.0 - 2.0 * part)
        end = np.array(pose.angles)
        rows.append(last + smooth[:, None] * (end - last))
        last = end
    return np.concatenate(rows)


def save_get_up(found: GetUp, file: str | Path) -> None:
    """Write the file, which is JSON.

    Raises:
        LibraryError: it cannot be written; a file that was there is kept.
    """
    text = msgspec.json.format(msgspec.json.encode(found), indent=1)
    with file_errors(file, "written", LibraryError):
        replace_file(Path(file), text + b"\n")


def load_get_up(file: str | Path, robot: Robot) -> GetUp:
    """Read the file.

    Args:
        file: its path.
        robot: which it must be of.

    Raises:
        LibraryError: it cannot be read, is none, or of another robot.
    """
    found = _decoded(file)
    if found.fingerprint != robot.fingerprint:
        raise LibraryError(
            f"{file}: of another robot ({short_name(found.robot)}), the library is of "
            f"{robot.name}"
        )
    return found


def _decoded(file: str | Path) -> GetUp:
    with file_errors(file, "read", LibraryError):
        data = read_file(Path(file), _MOST_BYTES)
    try:
        return msgspec.json.decode(data, type=GetUp)
    except (msgspec.MsgspecError, ValueError) as error:
        raise LibraryError(f"{file}: no file of `gaitchain get-up`: {error}") from None
