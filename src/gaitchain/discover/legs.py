"""A leg's joints, knee, ankle and foot, and which way the robot faces by them."""

import math
import re
from collections import Counter
from collections.abc import Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, replace

import numpy as np

from gaitchain.discover.findings import (
    FEWEST_LEG_JOINTS,
    MOST_LEG_JOINTS,
    Rows,
    UnfitError,
)
from gaitchain.discover.limbs import DOWN, Limb, bodies_of, refuse_slides
from gaitchain.discover.notes import listed
from gaitchain.discover.pinned_robot import PinnedRobot
from gaitchain.discover.profile import Profile
from gaitchain.discover.shapes import VISUAL, ground_geoms, shapes_of
from gaitchain.discover.tendons import pulled_over_tendons
from gaitchain.messages import Array

_TOE_BAND = 0.015  # of the leg: toes and foot whose lowest points differ less are level
_ONE_SIDED = 2.0  # a knee's range to one side against the other
_UNDECIDED = 0.3  # votes for ahead against back
_SILENT = 0.2  # votes of forefeet and knees that say nothing
_FRONT = 0.7  # cosine between a profile's front and ahead or back, at least
_MEANT = math.cos(math.radians(2.0))  # so near to an axis of the base, it is that
_APART = 1e-3  # m: legs less far apart are in one plane
_WORD = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])")  # of snake_case and CamelCase
_SIDES = ((1.0, ("l", "left")), (-1.0, ("r", "right")))
PITCH = 0.7
"""Cosine between a pitch joint's axis and the way across, at least."""
YAW = 0.6
"""Cosine between the vertical and the axis of a joint that turns the robot, at least:
that of some hips lies half way between yaw and pitch. Such a one bears load, too."""


@dataclass(frozen=True, eq=False)
class LegParts:
    """A leg while it is being found; ids of joints and bodies."""

    joints: tuple[int, ...]
    passive: tuple[int, ...]
    foot: int
    """The foot's body."""
    soles: frozenset[int]
    """Bodies whose geoms make up the sole: the foot, what is welded to it, toes."""


def leg_parts(
    robot: PinnedRobot,
    limb: Limb,
    own: tuple[int, ...],
    named: Sequence[str] | None,
    left: Array,
) -> LegParts:
    """Separate a leg's driven joints from passive ones and its foot from its toes.

    Args:
        robot: the robot; it is left in its neutral pose.
        limb: the leg, and what it shares with the other one.
        own: its joints beyond that.
        named: joints that a profile says are the leg's, if one does.
        left: (3,) level unit vector from one leg to the other, either way.

    Raises:
        RobotFileError: walking cannot use a leg of such joints.
    """
    refuse_slides(robot, own)
    foot, soles = limb.links[-1], bodies_of(robot, limb.links[-1])
    toes: frozenset[int] = frozenset()
    if named is None and _has_toes(robot, limb, own, left):
        toes = frozenset(j for j in own if robot.model.jnt_bodyid[j] == foot)
        foot = limb.links[-2]
        soles |= bodies_of(robot, foot)
    passive = _passive(robot, own, named, toes)
    joints = tuple(j for j in own if j not in passive)
    idle = tuple(j for j in passive if j not in toes)
    _check_count(robot, joints, idle)
    _refuse_led(robot, joints, set(idle))
    return LegParts(joints, passive, foot, frozenset(soles))


def _check_count(
    robot: PinnedRobot, joints: tuple[int, ...], idle: tuple[int, ...]
) -> None:
    if not FEWEST_LEG_JOINTS <= len(joints) <= MOST_LEG_JOINTS:
        names = ", ".join(robot.joint_name(j) for j in joints)
        enough = len(joints) + len(idle) >= FEWEST_LEG_JOINTS
        raise UnfitError(
            f"a leg has {len(joints)} driven joints ({names}); walking needs "
            f"{FEWEST_LEG_JOINTS} to {MOST_LEG_JOINTS}, ankle pitch among them"
            f"{_reasons(robot, idle)}",
            "legs.left and legs.right" if enough else None,
        )


def _reasons(robot: PinnedRobot, idle: Sequence[int]) -> str:
    """Return why joints are passive, as the end of a message."""
    return "".join(f"; {why_idle(robot, joint)}" for joint in idle)


def pair_up(robot: PinnedRobot, legs: list[LegParts], named: bool) -> list[LegParts]:
    """Make sure that two legs have as many joints.

    A joint that moves one of the other leg with it, as both hips' yaw on one motor,
    is held like that one.

    Args:
        robot: the robot.
        legs: both.
        named: whether a profile says which joints walk; these are not held.

    Raises:
        RobotFileError: one leg has more joints than the other, or too few.
    """
    if not named:
        legs = [_hold_shared(robot, *pair) for pair in (legs, legs[::-1])]
    one, other = sorted(legs, key=lambda leg: len(leg.joints))
    if len(one.joints) != len(other.joints):
        bare = [j for j in one.passive if j not in robot.driven | robot.followers]
        names = ", ".join(map(robot.joint_name, bare))
        raise UnfitError(
            f"the legs have {len(legs[0].joints)} and {len(legs[1].joints)} driven "
            f"joints, they must have the same number{_reasons(robot, one.passive)}",
            "legs.left and legs.right",
            f"actuators for {names} in the file" if bare else None,
        )
    return legs


def _hold_shared(robot: PinnedRobot, leg: LegParts, other: LegParts) -> LegParts:
    """Let the joints of a leg be passive that passive ones of the other follow."""
    leaders = {robot.leader(joint) for joint in other.passive}
    held = tuple(joint for joint in leg.joints if joint in leaders)
    if not held:
        return leg
    joints = tuple(joint for joint in leg.joints if joint not in held)
    _check_count(robot, joints, held)
    return replace(leg, joints=joints, passive=(*leg.passive, *held))


def _refuse_led(
    robot: PinnedRobot, joints: tuple[int, ...], between: AbstractSet[int]
) -> None:
    """Refuse a leg in which a joint between hip and foot moves with another."""
    for joint in between:
        leader = robot.leader(joint)
        if leader in joints:
            raise UnfitError(
                f"{robot.joint_name(joint)} is between hip and foot and moves with "
                f"{robot.joint_name(leader)}, which walks; joints of a leg move each "
                "by itself, or are held: give it an actuator in place of the equality "
                "or <mimic>, or hold it at an angle"
            )


def _passive(
    robot: PinnedRobot,
    own: tuple[int, ...],
    named: Sequence[str] | None,
    toes: frozenset[int],
) -> tuple[int, ...]:
    """Return the joints of a leg that walking does not move, toes first."""
    if named is not None:
        return tuple(j for j in own if robot.model.joint(j).name not in named)
    driven = robot.driven.intersection(own) or own
    idle = [j for j in own if j in robot.followers or j not in driven]
    return (*sorted(toes), *(j for j in idle if j not in toes))


def why_idle(robot: PinnedRobot, joint: int) -> str:
    """Return why walking does not move a passive joint of a leg."""
    name, leader = robot.joint_name(joint), robot.leader(joint)
    if leader is not None:
        return f"{name} follows {robot.joint_name(leader)} by an equality"
    if joint in robot.followers:
        return f"{name} is held by an equality"
    if joint not in robot.driven:
        return f"{name} {_undriven(robot, joint)}"
    if led := robot.led_by(joint):
        return f"{name} moves {robot.joint_name(led[0])} with it by an equality"
    return f"{name} is of the toes, or not of the joints that a profile names"


def _undriven(robot: PinnedRobot, joint: int) -> str:
    pulling = pulled_over_tendons(robot.model, joint)
    if not pulling:
        return "has no actuator"
    return (
        f"is pulled by {listed('actuator', pulling)} over a tendon, which is not read: "
        "give it a <position> at the joint"
    )


def _has_toes(
    robot: PinnedRobot, limb: Limb, own: tuple[int, ...], left: Array
) -> bool:
    """Whether the last link is toes: hinged across, ahead of a foot just as low.

    Toes that nothing drives may hinge any way, and those that touch nothing may have no
    shape at all; the link before them touches the ground.
    """
    if len(own) <= FEWEST_LEG_JOINTS or limb.links[-2] == robot.base:
        return False
    robot.place(robot.neutral)
    across = abs(robot.axis(own[-1]) @ left) >= PITCH
    idle = bool(robot.driven.intersection(own)) and own[-1] not in robot.driven
    (feet, solid), (toes, kind) = (
        ground_geoms(robot.model, bodies_of(robot, link)) for link in limb.links[-2:]
    )
    bare = not toes or kind == VISUAL
    if not feet or solid == VISUAL or not (across or (idle and bare)):
        return False
    return _end_ahead(robot, own, left, feet, toes) if toes else idle


def _end_ahead(
    robot: PinnedRobot,
    own: tuple[int, ...],
    left: Array,
    feet: list[int],
    toes: list[int],
) -> bool:
    """Whether a leg's last geoms are ahead of those before them, and just as low."""
    parts = []
    for geoms in (feet, toes):
        shapes = shapes_of(robot.model, robot.data, geoms, 0)
        points = np.concatenate([s.touching(DOWN) for s in shapes])
        parts.append(points[points[:, 2] < points[:, 2].min() + 0.01])
    leg = float(np.linalg.norm(robot.anchor(own[0]) - parts[0].mean(axis=0)))
    level = abs(parts[0][:, 2].min() - parts[1][:, 2].min()) < _TOE_BAND * leg
    foot, ahead = (points @ np.cross(left, DOWN) for points in parts)
    beyond = not foot.min() < ahead.mean() < foot.max()
    return bool(level and beyond and np.ptp(foot) > 0.5 * np.ptp(ahead))


def knee_of(robot: PinnedRobot, leg: LegParts, left: Array) -> int:
    """Return the index of the pitch joint with the longest lever to both sides."""
    first, last = robot.anchor(leg.joints[0]), robot.anchor(leg.joints[-1])
    levers = [
        min(float(np.linalg.norm(robot.anchor(j) - end)) for end in (first, last))
        if abs(robot.axis(j) @ left) > PITCH
        else -1.0
        for j in leg.joints
    ]
    return int(np.argmax(levers[1:-1])) + 1


def knee_side(robot: PinnedRobot, leg: LegParts, knee: int) -> tuple[float, float]:
    """Return the side to which its range bends a knee (0: either), and its straight."""
    joint = leg.joints[knee]
    axis, at = robot.axis(joint), robot.anchor(joint)
    thigh = centre_of(robot, leg.joints[:knee]) - at
    shank = centre_of(robot, leg.joints[knee + 1 :]) - at
    straight = float(
        np.arctan2(np.cross(shank, -thigh) @ axis, _along(shank, -thigh, axis))
    )
    straight += float(robot.neutral[robot.address(joint)])
    low, high = robot.bounds(joint)
    ways = max(straight - low, 1e-3), max(high - straight, 1e-3)
    if max(ways) < _ONE_SIDED * min(ways):
        return 0.0, straight
    return (1.0 if ways[1] > ways[0] else -1.0), straight


def _along(one: Array, other: Array, axis: Array) -> float:
    """Return the product of two vectors without their parts along an axis."""
    return float(one @ other - (one @ axis) * (other @ axis))


def centre_of(robot: PinnedRobot, joints: Sequence[int]) -> Array:
    """Return the point nearest to the axes of some joints, level frame (3,) [m]."""
    anchors = np.array([robot.anchor(j) for j in joints])
    middle = anchors.mean(axis=0)
    total, right = 1e-6 * np.eye(3), 1e-6 * middle
    for joint, anchor in zip(joints, anchors, strict=True):
        axis = robot.axis(joint)
        off = np.eye(3) - np.outer(axis, axis)
        total, right = total + off, right + off @ anchor
    return np.asarray(np.linalg.solve(total, right))


def face_forward(
    robot: PinnedRobot, legs: list[LegParts], answers: Profile, rows: Rows
) -> tuple[PinnedRobot, list[LegParts]]:
    """Turn the pinned robot to face along x, and put its left leg first."""
    ahead = np.cross(across(robot, [leg.joints for leg in legs]), -DOWN)
    turn = robot.turn(robot.base)  # ahead is forward if the first leg is the left one
    if answers.forward is not None:
        given = _given_front(turn, ahead, answers.forward)
        vote, why = float(np.sign(given @ ahead)), "the profile says so"
        ahead = vote * given
    elif answers.legs or answers.foot:
        vote, why = 1.0, "the profile names left and right"
    else:
        vote, why, doubt = _front(robot, legs, ahead)
        rows += doubt
    if vote < 0.0:
        ahead, legs = -ahead, legs[::-1]
    forward = turn.T @ ahead
    nearest = np.zeros(3)
    largest = int(np.argmax(np.abs(forward)))
    nearest[largest] = np.sign(forward[largest])
    if forward @ nearest > _MEANT and answers.forward is None:
        forward = nearest
    faced = PinnedRobot(robot.model, robot.base, robot.up, forward)
    rows.append(("forward", f"{_shown(faced.forward)} in the base's frame", why))
    return faced, legs


def _given_front(turn: Array, ahead: Array, forward: Sequence[float]) -> Array:
    """Return the level part of a profile's front.

    Args:
        turn: (3, 3) from the base's frame to the level one.
        ahead: (3,) level unit vector square to the line between the legs, either way.
        forward: (3,) unit vector, in the base's frame.

    Raises:
        UnfitError: it is nearer to that line or the vertical than to ahead or back.
    """
    given = turn @ np.array(forward)
    cosine = abs(float(given @ ahead))
    if cosine < _FRONT:
        off, most = np.degrees(np.arccos([cosine, _FRONT]))
        raise UnfitError(
            f"forward = {_shown(forward)} is {off:.0f} deg off the level way square to "
            f"the line between the legs; at most {most:.0f} deg",
            f"forward = {_shown(turn.T @ ahead)}, or its opposite,",
            "up if z is not up",
        )
    level = given - given @ DOWN * DOWN
    return np.asarray(level / np.linalg.norm(level))


def _shown(vector: Sequence[float] | Array) -> str:
    return f"[{', '.join(f'{v:+.2f}' for v in vector)}]"


def _front(
    robot: PinnedRobot, legs: list[LegParts], ahead: Array
) -> tuple[float, str, Rows]:
    """Decide between ahead and back, by names where geometry or forefeet are silent.

    A knee alone says less than names: some robots' knees bend backward.

    Returns:
        1 for ahead or -1, the evidence of geometry, and a row where that is weak.
    """
    votes = _votes(robot, legs, ahead)
    named = _side_by_names(robot, legs)
    drawn = sum(votes.values())
    silent = abs(votes["forefeet"] + votes["knees"]) < _SILENT
    by_names = named and (silent or abs(votes["forefeet"]) < _SILENT)
    total = named if by_names else drawn
    way = 1.0 if total >= 0.0 else -1.0
    why = ", ".join(f"{k} {way * v:+.1f}" for k, v in votes.items())
    if abs(total) < _UNDECIDED:
        raise UnfitError(
            f"front and back look alike ({why})", "forward", "up if z is not up"
        )
    doubt = _doubt_front(way * drawn, way * named, silent, why)
    return way, why, [("front", *doubt)] if doubt else []


def _doubt_front(
    drawn: float, named: float, silent: bool, why: str
) -> tuple[str, str] | None:
    """Say what speaks against a front, or that hardly anything speaks for it."""
    settles = "forward in a profile settles it"
    if silent and not named:
        return "a guess", f"only the base's x axis says so; {settles}"
    if named > 0.0 and drawn < _UNDECIDED:
        what = "nothing else says so" if silent else why
        return "by the names of left and right", f"{what}; {settles}"
    if named < 0.0:
        return "against the names of left and right", f"{why}; {settles}"
    return None


def _side_by_names(robot: PinnedRobot, legs: list[LegParts]) -> float:
    """Return 1 if names call the first of two legs the left one, -1 the right, or 0.

    Words that both legs have say nothing: an "r" may be for roll.
    """
    first, second = (_words(robot, leg) for leg in legs)
    way = _side(first - second)
    return way if way == -_side(second - first) else 0.0


def _words(robot: PinnedRobot, leg: LegParts) -> Counter[str]:
    """Return the words of which a leg's joints and bodies are named."""
    model, names = robot.model, list[str]()
    for joint in leg.joints:
        names += model.joint(joint).name, model.body(model.jnt_bodyid[joint]).name
    return Counter(word.lower() for name in names for word in _WORD.findall(name))


def _side(words: Counter[str]) -> float:
    """Return 1 for words that all say left, -1 for right, 0 for neither."""
    found = {way for way, sides in _SIDES if not words.keys().isdisjoint(sides)}
    return found.pop() if len(found) == 1 else 0.0


def across(robot: PinnedRobot, legs: Sequence[Sequence[int]]) -> Array:
    """Return the level unit vector from the second leg to the first.

    Args:
        robot: the robot; it is left in its neutral pose.
        legs: ids of the joints of either leg, from hip to foot.

    Raises:
        RobotFileError: the legs are not beside each other.
    """
    robot.place(robot.neutral)
    for pick in (0, -1):
        gap = robot.anchor(legs[0][pick]) - robot.anchor(legs[1][pick])
        gap -= gap @ DOWN * DOWN
        if np.linalg.norm(gap) > _APART:
            return np.asarray(gap / np.linalg.norm(gap))
    raise UnfitError(
        "both legs lie in one plane: hips and ankles are less than "
        f"{1e3 * _APART:g} mm apart sideways; walking needs legs side by side"
    )


def _votes(robot: PinnedRobot, legs: list[LegParts], ahead: Array) -> dict[str, float]:
    """Collect the evidence for the front: longer forefeet, knees, the base's x axis."""
    left = np.cross(-DOWN, ahead)
    fore, bend = 0.0, 0.0
    for leg in legs:
        knee = knee_of(robot, leg, left)
        ankle = centre_of(robot, leg.joints[knee + 1 :])
        geoms, _ = ground_geoms(robot.model, set(leg.soles))
        shapes = shapes_of(robot.model, robot.data, geoms, 0)
        points = np.concatenate([s.touching(DOWN) for s in shapes] or [ankle[None]])
        reach = (points - ankle) @ ahead
        fore += 0.5 * float((reach.max() + reach.min()) / max(np.ptp(reach), 1e-9))
        sided, _ = knee_side(robot, leg, knee)
        bend += 0.5 * sided * float(np.sign(robot.axis(leg.joints[knee]) @ left))
    axis = float(robot.turn(robot.base)[:, 0] @ ahead)
    return {
        "forefeet": float(np.clip(4.0 * fore, -1.0, 1.0)),
        "knees": 0.7 * bend,
        "base's x axis": 0.5 * axis if abs(axis) > PITCH else 0.0,
    }
