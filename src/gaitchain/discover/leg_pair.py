"""Which two limbs are the legs: the mirrored ones that reach lowest in any pose."""

from itertools import pairwise

import mujoco
import numpy as np

from gaitchain.discover.findings import Array, refusal
from gaitchain.discover.limbs import (
    DOWN,
    Limb,
    bodies_of,
    limbs_of,
    own_joints,
    shared_links,
)
from gaitchain.discover.pinned_robot import HeldRobot
from gaitchain.discover.shapes import ground_geoms, lowest, shapes_of
from gaitchain.errors import RobotFileError

_LIMB_JOINTS = 3  # a limb with fewer is no leg at all
_LIKE_MASS = 0.2  # relative difference of two mirrored limbs' masses, at most
_LIKE_LENGTH = 0.06  # of a limb: difference of two mirrored links' lengths, at most
_SAME_DEPTH = 0.25  # of a limb: what reaches this close to the legs' depth is a leg
_ROUND = 0.1  # relative difference of a wheel's radii, at most
_HINGE = int(mujoco.mjtJoint.mjJNT_HINGE)


def lowest_pair(robot: HeldRobot, origin: str) -> tuple[Limb, Limb]:
    """Find the legs: the two mirrored limbs that reach lowest.

    Raises:
        RobotFileError: there are none, or it stands on wheels or on more legs.
    """
    limbs = limbs_of(robot)
    _refuse_wheels(robot, limbs, origin)
    pairs = (
        (a, b)
        for i, a in enumerate(limbs)
        for b in limbs[i + 1 :]
        if _alike(robot, a, b)
    )
    pair = next(pairs, None)
    ground = _lowest_of_base(robot)
    if pair is None or pair[0].depth > ground:
        raise _unpaired(robot, limbs, ground, origin)
    reach = _length(robot, pair[0], shared_links(*pair))
    if limbs[0].depth < pair[0].depth - _SAME_DEPTH * reach:
        raise _unpaired(robot, limbs, ground, origin)
    _refuse_more_legs(robot, limbs, pair, origin)
    return pair


def _alike(robot: HeldRobot, one: Limb, other: Limb) -> bool:
    """Whether two limbs are mirror images: joints, masses, lengths, reach."""
    shared = shared_links(one, other)
    own = [own_joints(robot, limb, shared) for limb in (one, other)]
    hinges = [j for j in own[0] + own[1] if robot.model.jnt_type[j] == _HINGE]
    if len(own[0]) != len(own[1]) or not 2 * _LIMB_JOINTS <= len(hinges) == 2 * len(
        own[0]
    ):
        return False
    masses = [robot.model.body_subtreemass[limb.links[shared]] for limb in (one, other)]
    if abs(masses[0] - masses[1]) > _LIKE_MASS * max(masses):
        return False
    robot.place(robot.neutral)
    spans = [_spans(robot, limb, shared) for limb in (one, other)]
    limit = _LIKE_LENGTH * float(spans[0].sum())
    lengths = np.abs(spans[0] - spans[1]).max() < limit
    return bool(lengths and abs(one.depth - other.depth) < 2.0 * limit)


def _spans(robot: HeldRobot, limb: Limb, shared: int) -> Array:
    """Distances from joint to joint and on to the end's CoM [m]."""
    points = [robot.anchor(j) for j in own_joints(robot, limb, shared)]
    points.append(np.array(robot.data.xipos[limb.links[-1]]))
    return np.array([np.linalg.norm(b - a) for a, b in pairwise(points)])


def _length(robot: HeldRobot, limb: Limb, shared: int) -> float:
    robot.place(robot.neutral)
    return float(_spans(robot, limb, shared).sum())


def _lowest_of_base(robot: HeldRobot) -> float:
    """Return how low the base itself reaches [m]."""
    robot.place(robot.neutral)
    geoms, _ = ground_geoms(robot.model, bodies_of(robot, robot.base))
    shapes = shapes_of(robot.model, robot.data, geoms, 0)
    return -lowest(shapes, DOWN) if shapes else np.inf


def _unpaired(
    robot: HeldRobot, limbs: list[Limb], ground: float, origin: str
) -> RobotFileError:
    long = [limb for limb in limbs if len(limb.joints) >= _LIMB_JOINTS]
    most = max((len(limb.joints) for limb in limbs), default=0)
    if not long:
        reason = f"no legs: {len(limbs)} limbs with at most {most} joints each"
    elif long[0].depth > ground:
        reason = "no legs: no limb reaches below the base"
    else:
        end = robot.model.body(long[0].links[-1]).name or "an unnamed body"
        reason = (
            f"the limb that reaches lowest ends in {end} and has no mirror image: an "
            "arm or a single leg"
        )
    reason += "; legs are two mirrored limbs with 5 to 7 hinges each"
    key = "legs.left and legs.right, or up where z is not up,"
    return refusal(origin, reason, key)


def _refuse_more_legs(
    robot: HeldRobot, limbs: list[Limb], pair: tuple[Limb, Limb], origin: str
) -> None:
    shared = shared_links(*pair)
    reach = _length(robot, pair[0], shared)
    legs = list(pair)
    for limb in limbs:
        apart = all(
            len(set(limb.joints) & set(leg.joints)) < 0.5 * len(limb.joints)
            for leg in legs
        )
        low = limb.depth < pair[0].depth + _SAME_DEPTH * reach
        if apart and low and _length(robot, limb, 0) > 0.5 * reach:
            legs.append(limb)
    if len(legs) > 2:
        ends = ", ".join(robot.model.body(leg.links[-1]).name or "?" for leg in legs)
        raise refusal(
            origin,
            f"{len(legs)} limbs reach the ground ({ends}); only two-legged robots walk",
            "legs.left and legs.right, or up where z is not up,",
        )


def _refuse_wheels(robot: HeldRobot, limbs: list[Limb], origin: str) -> None:
    robot.place(robot.neutral)
    heights = {limb: -_lowest_now(robot, limb.links[-1]) for limb in limbs}
    wheels = [limb for limb in limbs if _is_wheel(robot, limb)]
    if len(wheels) < 2:
        return
    ground = min(heights.values())
    size = max(-ground, 0.1)
    low = [w for w in wheels if heights[w] < ground + 0.1 * size]
    if len(low) > 1:
        names = ", ".join(robot.joint_name(w.joints[-1]) for w in low[:4])
        raise refusal(origin, f"it rolls on wheels ({names}); walking needs flat feet")


def _lowest_now(robot: HeldRobot, link: int) -> float:
    geoms, _ = ground_geoms(robot.model, bodies_of(robot, link))
    shapes = shapes_of(robot.model, robot.data, geoms, 0)
    return lowest(shapes, DOWN) if shapes else -np.inf


def _is_wheel(robot: HeldRobot, limb: Limb) -> bool:
    """Whether a limb ends in something round that turns without end about its axis."""
    model, joint, link = robot.model, limb.joints[-1], limb.links[-1]
    if model.jnt_limited[joint] or model.jnt_type[joint] != _HINGE:
        return False
    geoms, _ = ground_geoms(model, bodies_of(robot, link))
    shapes = shapes_of(model, robot.data, geoms, 0)
    if not shapes:
        return False
    across = np.linalg.svd(robot.axis(joint)[None])[2][1:]
    turns = 2.0 * np.pi * np.arange(16) / 16
    ways = np.stack([np.cos(turns), np.sin(turns)], axis=1) @ across
    radii = [lowest(shapes, way) - robot.anchor(joint) @ way for way in ways]
    return bool(min(radii) > (1.0 - _ROUND) * max(radii) > 0.0)
