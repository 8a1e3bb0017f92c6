"""Where robot, soles, ZMP and support region are, for a 3-D view of the loop."""

import math
from typing import Any

import msgspec
import numpy as np

from gaitchain.analysis.record_columns import columns_from_truth
from gaitchain.analysis.recorder import truth_columns
from gaitchain.gait.zmp import planned_region
from gaitchain.live.messages import Telemetry
from gaitchain.live.shown_joints import shown_joints
from gaitchain.messages import Array
from gaitchain.robot.feet import FootFinder
from gaitchain.robot.robot import Robot
from gaitchain.robot.turn import quaternion
from gaitchain.walker.place import Place

Point = tuple[float, float]
_BASE = 7  # generalised positions of the trunk
_RECENT_S = 0.5  # the truth of an earlier row still says where the feet are


class Scene(msgspec.Struct, frozen=True):
    """The robot in the world, one moment; NaN for what nobody measured."""

    trunk: tuple[float, ...]
    """(7,) the pelvis frame in the world: x, y, z [m], quaternion w, x, y, z."""
    feet: tuple[Place, Place]
    """Left and right ankle: x, y [m], heading [rad]."""
    soles: tuple[tuple[Point, ...], tuple[Point, ...]]
    """(2, 4, 2) corners of both soles, from above [m]."""
    zmp: Point
    """Measured [m]."""
    planned_zmp: Point
    """Planned ZMP in the world, from the measured pose of the support foot [m]; NaN if
    none is planned."""
    region: tuple[Point, ...]
    """Corners of the planned support region, counter-clockwise [m]."""
    goal: Place | None = None
    """Where the driver sent the robot: x, y [m], heading [rad]."""


class Stage:
    """Makes scenes of one robot's telemetry, row after row."""

    def __init__(self, robot: Robot) -> None:
        """Take the robot."""
        full = robot.legs
        self._robot, self._feet = robot, FootFinder(full)
        self._mass, self._stand = full.mass, np.asarray(full.stand)
        self._known: Telemetry | None = None  # the latest row with its truth

    def scene(self, telemetry: Telemetry) -> Scene:
        """Return where everything is.

        A simulator knows. In the rows between those with its truth, and of a real
        robot, it follows from the joints and the support foot: that is where it was,
        or flat on the floor where a standing robot has it, so that a real robot walks
        on the spot. A joint that was not measured counts as at its target.
        """
        if telemetry.truth is not None:
            self._known = telemetry
            trunk, rows = telemetry.truth.qpos[:_BASE], truth_columns([telemetry.truth])
        else:
            trunk, rows = self._by_joints(telemetry)
        rows["time_s"] = np.array([telemetry.time_s])
        rows["planned_zmp"] = np.array([telemetry.planned_zmp])
        support = np.array([telemetry.support])
        found = columns_from_truth(self._robot, self._mass, rows, support)
        left, right = found["soles"][0]
        feet = found["feet"][0]
        return Scene(
            trunk=trunk,
            feet=_nested(feet),
            soles=(_nested(left), _nested(right)),
            zmp=tuple(found["zmp"][0].tolist()),
            planned_zmp=tuple(found["planned_zmp"][0].tolist()),
            region=self._region(telemetry.support, feet),
            goal=_goal(telemetry, feet),
        )

    def _by_joints(
        self, telemetry: Telemetry
    ) -> tuple[tuple[float, ...], dict[str, Array]]:
        """Return the trunk, and one row as `truth_columns` has it."""
        foot = int(telemetry.support.startswith("r"))
        rows = self._feet_before(telemetry)
        found = self._feet.find(shown_joints(telemetry, self._stand))
        sole = rows["turn"][0, foot].reshape(3, 3)
        turn = sole @ found.turns[foot].T  # of the pelvis
        at = rows["place"][0, foot] - turn @ found.ankles[foot]
        attitude = quaternion(turn)
        rows["place"] = (at + found.ankles @ turn.T)[None]
        rows["turn"] = (turn @ found.turns).reshape(1, 2, 9)
        return (*at.tolist(), *attitude.tolist()), rows

    def _feet_before(self, telemetry: Telemetry) -> dict[str, Array]:
        """Return the feet of the latest truth; without one, those of a stand."""
        known = self._known
        if (
            known is not None
            and known.truth is not None
            and 0.0 <= telemetry.time_s - known.time_s <= _RECENT_S
        ):
            return truth_columns([known.truth])
        self._known, shape = None, self._robot.reduced
        beside, up = 0.5 * shape.hip_width, shape.ankle_height
        return {
            "place": np.array([[[0.0, beside, up], [0.0, -beside, up]]]),
            "turn": np.tile(np.eye(3).ravel(), (1, 2, 1)),
            "wrench": np.full((1, 2, 6), math.nan),
            "twist": np.full((1, 2, 6), math.nan),
            "com": np.full((1, 3), math.nan),
        }

    def _region(self, support: str, feet: Array) -> Any:
        if not support or not np.isfinite(feet).all():
            return ()
        return _nested(planned_region(self._robot, feet, support))


def _goal(telemetry: Telemetry, feet: Array) -> Place | None:
    """Return the goal as far from the support foot as the robot's own steps tell.

    Args:
        telemetry: of now.
        feet: (2, 3) ankles in the world: x, y [m], heading [rad].
    """
    going, stood = telemetry.going, telemetry.feet
    if going is None or going.goal is None or stood is None:
        return None
    foot = int(telemetry.support.startswith("r"))
    off = going.goal.seen_from(stood[foot])
    seen = Place(*feet[foot].tolist())
    return seen.moved(off.x, off.y)._replace(yaw=seen.yaw + off.yaw)


def _nested(array: Array) -> Any:
    """Return plain numbers, a tuple for each row."""
    return tuple(map(tuple, array.tolist()))
