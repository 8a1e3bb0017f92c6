"""Guided calibration: instructions for moving a limp robot, and their evaluation."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from gaitchain.backends.servos.angles import shortest_turn_deg
from gaitchain.backends.servos.bus import ServoBus
from gaitchain.backends.servos.calibration import TURN_DEG, JointCalibration
from gaitchain.backends.servos.setup import ServoSetup
from gaitchain.backends.servos.table import COUNTS, DEG_PER_COUNT
from gaitchain.errors import BackendError, CommandError
from gaitchain.messages import Array
from gaitchain.robot.leg_model import LegModel

LEAST_MOVE_DEG = 8.0
"""Least turn by which a servo counts as moved by hand."""
_ALONE = 0.5  # of the largest turn: a second servo that turned more was moved as well
_SHORT = 0.2  # of the leg length: below this lever a joint only tilts the foot
_SWAYS = {0: ("back", "forward"), 1: ("to the right", "to the left")}
_INSIDE_DEG = 1.0  # margin between limits found by hand and the mechanical stop


@dataclass(frozen=True)
class Mounted:
    """The servo of a joint, with sign and settings."""

    id: int
    sign: int
    setup: ServoSetup


def joint_words(legs: LegModel) -> dict[str, str]:
    """Return the instruction, by joint, to move it in its positive direction."""
    words = {}
    count = legs.leg_joints
    for leg, side in enumerate(("left", "right")):
        places = np.cumsum(legs.at[leg], axis=0)
        foot = places[-1] + legs.foot_at[leg]
        length = float(np.linalg.norm(foot - places[0]))
        for joint in range(count):
            name = legs.joint_names[leg * count + joint]
            axis, lever = legs.axis[leg, joint], foot - places[joint]
            way = np.cross(axis, lever) / length
            words[name] = _in_words(side, axis, way, joint == legs.knee)
    return words


def _in_words(side: str, axis: Array, way: Array, knee: bool) -> str:
    """Describe a turn about an axis by the motion of the foot."""
    about = int(np.argmax(np.abs(axis)))
    positive = bool(axis[about] > 0.0)
    to = "left" if positive else "right"
    if about == 2:
        return f"turn the toes of the {side} foot to the {to}"
    if np.linalg.norm(way) < _SHORT:
        if about == 1:
            return f"tip the toes of the {side} foot {'down' if positive else 'up'}"
        return f"lift the {to} edge of the {side} foot"
    along = 0 if about == 1 else 1
    where = _SWAYS[along][int(way[along] > 0.0)]
    if knee and along == 0:
        how = "bend" if way[0] < 0.0 else "stretch"
        return f"{how} the {side} knee: its foot goes {where}"
    return f"swing the whole {side} leg {where}"


def positions(bus: ServoBus, ids: list[int]) -> dict[int, int]:
    """Return the positions of servos in counts, by id.

    Raises:
        BackendError: a servo does not answer, or the port is lost.
    """
    found = bus.read_surely(ids, bus.make.present)
    missing = [number for number in ids if number not in found]
    if missing:
        raise BackendError(
            f"{bus.name}: no answer any more from id {', '.join(map(str, missing))}; "
            "check supply and cables, and begin again"
        )
    return {number: bus.make.measured(data)[2] for number, data in found.items()}


def who_moved(
    before: Mapping[int, int], after: Mapping[int, int], taken: Mapping[int, str]
) -> tuple[int, int]:
    """Find which servo a person has turned, and in which direction.

    Args:
        before: positions in counts before the turn, by id.
        after: positions in counts after the turn, by id.
        taken: names of the joints already found, by id of their servo.

    Returns:
        The servo's id, and 1 if its count increased, -1 if it decreased.

    Raises:
        CommandError: no servo turned far enough, several did, or one in `taken` did.
    """
    ids = list(before)
    ends = np.array([(before[n], after[n]) for n in ids]).T
    turned = shortest_turn_deg(*ends)
    order = np.argsort(-np.abs(turned))
    first = ids[order[0]]
    most, next_most = (*np.abs(turned)[order[:2]].tolist(), 0.0)[:2]
    if most < LEAST_MOVE_DEG:
        raise CommandError(
            f"no servo has turned by {LEAST_MOVE_DEG:g} deg; id {first} most, by "
            f"{most:.1f} deg"
        )
    if next_most > _ALONE * most:
        raise CommandError(
            f"id {first} has turned by {most:.0f} deg and id {ids[order[1]]} by "
            f"{next_most:.0f}; move one joint alone"
        )
    if first in taken:
        raise CommandError(f"it was id {first} that turned, which moves {taken[first]}")
    return first, int(np.sign(turned[order[0]]))


def joint_at(
    mounted: Mounted, counts: int, angle: float, limits: tuple[float, float]
) -> JointCalibration:
    """Return a joint's calibration from one pose.

    Args:
        mounted: the joint's servo.
        counts: position of the servo in the pose.
        angle: angle of the joint in the pose [deg].
        limits: limits of the joint [deg]; narrowed to the servo's range.
    """
    setup, sign = mounted.setup, mounted.sign
    offset = round((counts % COUNTS) * DEG_PER_COUNT - sign * angle, 3)
    ends = (setup.lowest * DEG_PER_COUNT, setup.highest * DEG_PER_COUNT)
    low, high = sorted(sign * (end - offset) for end in ends)
    return JointCalibration(
        id=mounted.id,
        sign=1 if sign > 0 else -1,
        offset=offset,
        lower=round(max(limits[0], low), 3),
        upper=round(min(limits[1], high), 3),
        model=setup.model.name,
    )


def ends_at_zero(joint: JointCalibration) -> bool:
    """Return whether a joint's limits reach its servo's zero, where a turn ends."""
    low, high = joint.servo_range
    last = TURN_DEG - DEG_PER_COUNT
    return low < DEG_PER_COUNT or high > last - DEG_PER_COUNT


def angle_of(joint: JointCalibration, counts: int) -> float:
    """Return the joint angle [deg] at a servo's position in counts."""
    angle = joint.sign * (counts * DEG_PER_COUNT - joint.offset)
    middle = 0.5 * (joint.lower + joint.upper)
    return float((angle - middle + 180.0) % 360.0 - 180.0 + middle)


def seen_limits(
    angles: list[float], limits: tuple[float, float], stand: float
) -> tuple[float, float]:
    """Return the limits of a joint that a person has moved to both ends [deg].

    They stay 1 deg off both ends, but for a joint that stands nearer to one: its stand.

    Args:
        angles: joint angles during the motion [deg].
        limits: limits within which the result stays, and `stand` is [deg].
        stand: angle of the joint as the robot stands [deg].

    Raises:
        CommandError: the joint was hardly moved, or not through `stand`.
    """
    low = round(max(limits[0], min(angles) + _INSIDE_DEG), 3)
    high = round(min(limits[1], max(angles) - _INSIDE_DEG), 3)
    if high - low < LEAST_MOVE_DEG:
        raise CommandError(
            f"it was moved from {min(angles):.1f} to {max(angles):.1f} deg only; move "
            "it to both of its ends"
        )
    if not min(angles) <= stand <= max(angles):
        raise CommandError(
            f"it stands at {stand:.1f} deg and was moved from {min(angles):.1f} to "
            f"{max(angles):.1f}; move it past where it stands"
        )
    return min(low, stand), max(high, stand)
