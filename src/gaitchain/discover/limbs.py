"""The limbs of a robot's model, and the pair of them that are its legs.

A limb is a chain of links from the base to an end of the tree; the legs are the
mirrored limbs that reach lowest in any pose.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise
from typing import Any

import mujoco
import numpy as np

from gaitchain.discover.findings import (
    FEWEST_LEG_JOINTS,
    MOST_LEG_JOINTS,
    UnfitError,
)
from gaitchain.discover.pinned_robot import HINGE, PinnedRobot
from gaitchain.discover.shapes import Shape, ground_geoms, lowest, shapes_of
from gaitchain.messages import Array

_LIMB_JOINTS = 3  # a limb with fewer is no leg at all
DOWN = np.array([0.0, 0.0, -1.0])
_SWEEPS = 3  # times that every joint of a limb is tried
_SWEEP = np.linspace(0.0, 1.0, 9)
_CLOSING = (int(mujoco.mjtEq.mjEQ_CONNECT), int(mujoco.mjtEq.mjEQ_WELD))
_LIKE_MASS = 0.2  # relative difference of two mirrored limbs' masses, at most
_LIKE_LENGTH = 0.06  # of a limb: difference of two mirrored links' lengths, at most
_SAME_DEPTH = 0.25  # of a limb: what reaches this close to the legs' depth is a leg
_LEGS_OR_UP = "legs.left and legs.right, or up where z is not up,"
_ROUND = 0.1  # relative difference of a wheel's radii, at most


@dataclass(frozen=True, eq=False)
class Limb:
    """Links and joints from the base to an end of the tree."""

    links: tuple[int, ...]
    """Bodies with joints, outwards; what is welded to a body is part of it."""
    joints: tuple[int, ...]
    depth: float
    """How far below the base its end can reach [m], negative."""


def find_base(model: Any) -> int:
    """Return the body with the free joint; the heaviest of several.

    Raises:
        RobotFileError: none has one, or a mass or inertia cannot be.
    """
    free = np.flatnonzero(model.jnt_type == int(mujoco.mjtJoint.mjJNT_FREE))
    if not len(free):
        raise UnfitError(
            "no free joint: the base is fixed to the world, as an arm's is"
        )
    base = int(max(model.jnt_bodyid[free], key=lambda b: model.body_subtreemass[b]))
    for body in range(1, model.nbody):
        if model.body_rootid[body] != model.body_rootid[base]:
            continue
        moves = model.body_weldid[body] == body
        numbers = [*model.body_inertia[body], model.body_mass[body]]
        zero = moves and model.body_subtreemass[body] <= 0.0
        if zero or not np.isfinite(numbers).all() or min(numbers) < 0.0:
            raise UnfitError(
                f"body {model.body(body).name or body}: mass {numbers[3]:g} kg, "
                f"inertia {', '.join(f'{i:g}' for i in numbers[:3])} kg m^2; every "
                "moving body needs finite values above 0",
            )
    return base


def limbs_of(robot: PinnedRobot) -> list[Limb]:
    """Return a limb for each end of the tree, deepest first."""
    model = robot.model
    links = [b for b in robot.bodies if model.body_weldid[b] == b and b != robot.base]
    inner = {model.body_weldid[model.body_parentid[b]] for b in links}
    chains = [_chain(robot, b) for b in links if b not in inner]
    # A trunk that bends would bring the arms to the ground.
    trunk: set[int] = set()
    for pair in combinations(chains, 2):
        shared = shared_links(*pair)
        if all(len(own_joints(robot, c, shared)) >= _LIMB_JOINTS for c in pair):
            trunk.update(pair[0].links[:shared])
    fixed = {j for j in robot.joints if model.jnt_bodyid[j] in trunk}
    ends = [replace(c, depth=_depth(robot, c, fixed)) for c in chains]
    return sorted(ends, key=lambda limb: limb.depth)


def limb_to(robot: PinnedRobot, link: int) -> Limb:
    """Return the limb that ends with a link.

    Raises:
        RobotFileError: the link does not move against the base.
    """
    if link == robot.base or link not in robot.bodies:
        base, name = (robot.model.body(body).name for body in (robot.base, link))
        raise UnfitError(
            f"{name} ends no leg: no joint lies between it and {base}, the base",
            "the last link of each leg as foot.left and foot.right",
        )
    chain = _chain(robot, link)
    return replace(chain, depth=_depth(robot, chain, set()))


def bodies_of(robot: PinnedRobot, link: int) -> set[int]:
    """Return a link's bodies: itself and what is welded to it."""
    return {b for b in robot.bodies if robot.model.body_weldid[b] == link}


def link_shapes(robot: PinnedRobot, link: int, frame: int = 0) -> list[Shape]:
    """Return what of a link would touch the ground, in a body's frame."""
    geoms, _ = ground_geoms(robot.model, bodies_of(robot, link))
    return shapes_of(robot.model, robot.data, geoms, frame)


def shared_links(one: Limb, other: Limb) -> int:
    """Count the links that two limbs share, from the base on."""
    same = [a == b for a, b in zip(one.links, other.links, strict=False)]
    return same.index(False) if False in same else len(same)


def own_joints(robot: PinnedRobot, limb: Limb, shared: int) -> tuple[int, ...]:
    """Return a limb's joints beyond its first `shared` links."""
    own = set(limb.links[shared:])
    return tuple(j for j in limb.joints if robot.model.jnt_bodyid[j] in own)


def _chain(robot: PinnedRobot, link: int) -> Limb:
    model, links = robot.model, [link]
    while (body := int(model.body_weldid[model.body_parentid[links[0]]])) != robot.base:
        links.insert(0, body)
    joints = tuple(
        int(model.body_jntadr[b] + i)
        for b in links
        for i in range(model.body_jntnum[b])
    )
    return Limb(tuple(links), joints, 0.0)


def _depth(robot: PinnedRobot, limb: Limb, fixed: set[int]) -> float:
    """Lower a limb's end joint by joint, as far as it goes."""
    link, pose = limb.links[-1], np.array(robot.neutral)
    robot.place(pose)
    shapes = link_shapes(robot, link, link)

    def height() -> float:
        robot.place(pose)
        low = lowest(shapes, robot.turn(link).T @ DOWN) if shapes else 0.0
        return float(robot.data.xpos[link][2]) - low

    best = height()
    for joint in [j for j in limb.joints if j not in fixed] * _SWEEPS:
        at, (low, high) = robot.address(joint), robot.bounds(joint)
        kept = pose[at]
        for value in low + (high - low) * _SWEEP:
            pose[at] = value
            if (found := height()) < best - 1e-9:
                best, kept = found, value
        pose[at] = kept
    return best


def refuse_loops(robot: PinnedRobot, limbs: tuple[Limb, Limb]) -> None:
    """Refuse legs whose links form a loop.

    Raises:
        RobotFileError: an equality ties two bodies of one leg.
    """
    model, shared = robot.model, shared_links(*limbs)
    for limb in limbs:
        root = limb.links[shared]
        for e in np.flatnonzero(np.isin(model.eq_type, _CLOSING) & model.eq_active0):
            pair = [int(model.eq_obj1id[e]), int(model.eq_obj2id[e])]
            if model.eq_objtype[e] == int(mujoco.mjtObj.mjOBJ_SITE):
                pair = [int(model.site_bodyid[s]) for s in pair]
            if any(_within(model, body, root) for body in pair):
                names = " and ".join(model.body(b).name or f"body {b}" for b in pair)
                raise UnfitError(
                    f"closed loop at {names}: parallel legs are not supported, but "
                    "for motors on one side of it that turn as many hinges without "
                    "motors on the other"
                )


def refuse_balls(
    robot: PinnedRobot, limbs: tuple[Limb, Limb], balls: Mapping[str, str]
) -> None:
    """Refuse legs that had a ball joint.

    Args:
        robot: the robot.
        limbs: its legs.
        balls: joints that were welded, by body.

    Raises:
        RobotFileError: one of them was in a leg.
    """
    own = set[int]().union(*(bodies_of(robot, b) for b in _own_links(limbs)))
    # A body that hung on a ball is part of what it hung from, the base at a hip.
    ways = [set(_way(robot, limb.links[-1])) for limb in limbs]
    names = {robot.model.body(body).name for body in own | (ways[0] ^ ways[1])}
    for body in sorted(names.intersection(balls)):
        raise UnfitError(
            f"{balls[body]} in a leg is a ball joint; legs need hinges: give two or "
            "three of them in its place"
        )


def _own_links(limbs: tuple[Limb, Limb]) -> set[int]:
    """Return the links that two limbs do not share."""
    shared = shared_links(*limbs)
    return {link for limb in limbs for link in limb.links[shared:]}


def _way(robot: PinnedRobot, body: int) -> Iterator[int]:
    """Yield a body and all that it hangs from, up to the base."""
    while body != robot.base:
        yield body
        body = int(robot.model.body_parentid[body])


def _within(model: Any, body: int, root: int) -> bool:
    while body not in (0, root):
        body = int(model.body_parentid[body])
    return body == root


def lowest_pair(robot: PinnedRobot) -> tuple[Limb, Limb]:
    """Find the legs: the two mirrored limbs that reach lowest.

    Raises:
        RobotFileError: there are none, or it stands on wheels or on more legs.
    """
    limbs = limbs_of(robot)
    _refuse_wheels(robot, limbs)
    pair = next((p for p in combinations(limbs, 2) if _alike(robot, *p)), None)
    robot.place(robot.neutral)
    ground = _bottom(robot, robot.base)
    if pair is None or pair[0].depth > ground:
        raise _unpaired(robot, limbs, ground)
    reach = _length(robot, pair[0], shared_links(*pair))
    if limbs[0].depth < pair[0].depth - _SAME_DEPTH * reach:
        raise _unpaired(robot, limbs, ground)
    _refuse_more_legs(robot, limbs, pair)
    return pair


def refuse_slides(robot: PinnedRobot, joints: Sequence[int]) -> None:
    """Refuse legs with joints that are no hinges.

    Raises:
        RobotFileError: one of the joints is none.
    """
    for joint in joints:
        if robot.model.jnt_type[joint] != HINGE:
            raise UnfitError(
                f"{robot.joint_name(joint)} in a leg is no hinge; legs need hinges",
                "legs.left and legs.right",
            )


def _alike(robot: PinnedRobot, one: Limb, other: Limb, slides: bool = False) -> bool:
    """Whether two limbs are mirror images: joints, masses, lengths, reach."""
    shared = shared_links(one, other)
    own = [own_joints(robot, limb, shared) for limb in (one, other)]
    all_hinges = all(robot.model.jnt_type[j] == HINGE for j in own[0] + own[1])
    if not (_LIMB_JOINTS <= len(own[0]) == len(own[1]) and (slides or all_hinges)):
        return False
    return not _difference(robot, one, other)


def _difference(robot: PinnedRobot, one: Limb, other: Limb) -> str:
    """Say in what two limbs with as many joints differ; empty if in nothing."""
    shared = shared_links(one, other)
    masses = [robot.model.body_subtreemass[limb.links[shared]] for limb in (one, other)]
    if abs(masses[0] - masses[1]) > _LIKE_MASS * max(masses):
        return "weighs {1:.3g} kg, not {0:.3g}".format(*masses)
    robot.place(robot.neutral)
    spans = [_spans(robot, limb, shared) for limb in (one, other)]
    limit = _LIKE_LENGTH * float(spans[0].sum())
    most = int(np.argmax(np.abs(spans[0] - spans[1])))
    if abs(spans[0][most] - spans[1][most]) >= limit:
        far = f"{spans[1][most]:.3f} m beyond its joint {most + 1}"
        return f"reaches {far}, not {spans[0][most]:.3f}"
    if abs(one.depth - other.depth) >= 2.0 * limit:
        return "is bent otherwise in the file's pose, within the ranges of its joints"
    return ""


def _spans(robot: PinnedRobot, limb: Limb, shared: int) -> Array:
    """Distances from joint to joint and on to the end's CoM [m]."""
    points = [robot.anchor(j) for j in own_joints(robot, limb, shared)]
    points.append(np.array(robot.data.xipos[limb.links[-1]]))
    return np.array([np.linalg.norm(b - a) for a, b in pairwise(points)])


def _length(robot: PinnedRobot, limb: Limb, shared: int) -> float:
    robot.place(robot.neutral)
    return float(_spans(robot, limb, shared).sum())


def _unpaired(robot: PinnedRobot, limbs: list[Limb], ground: float) -> UnfitError:
    for other in limbs[1:] if limbs and limbs[0].depth <= ground else ():
        if _alike(robot, limbs[0], other, slides=True):
            shared = shared_links(limbs[0], other)
            refuse_slides(robot, own_joints(robot, limbs[0], shared))
    long = [limb for limb in limbs if len(limb.joints) >= _LIMB_JOINTS]
    most = max((len(limb.joints) for limb in limbs), default=0)
    if not long:
        reason = f"no legs: {len(limbs)} limbs with at most {most} joints each"
    elif long[0].depth > ground:
        reason = "no legs: no limb reaches below the base"
    else:
        reason = (
            f"the limb that reaches lowest ends in {_end(robot, long[0])} and has no "
            f"mirror image{_nearest(robot, long)}"
        )
    reason += (
        "; legs are two mirrored limbs with "
        f"{FEWEST_LEG_JOINTS} to {MOST_LEG_JOINTS} hinges each"
    )
    return UnfitError(reason, _LEGS_OR_UP)


def _nearest(robot: PinnedRobot, limbs: list[Limb]) -> str:
    """Say why the limb that is most like the first one is no mirror image of it."""
    for other in limbs[1:]:
        if why := _unlike(robot, limbs[0], other):
            return f": that which ends in {_end(robot, other)} {why}"
    return ": an arm or a single leg"


def _unlike(robot: PinnedRobot, one: Limb, other: Limb) -> str:
    """Say why a limb is no mirror image of one; empty if it is no leg at all."""
    shared = shared_links(one, other)
    own = [own_joints(robot, limb, shared) for limb in (one, other)]
    fewest, most = sorted(map(len, own))
    if fewest < most:
        low = one.depth + _SAME_DEPTH * _length(robot, one, shared)
        leg = fewest >= _LIMB_JOINTS and other.depth < low
        return f"has {len(own[1])} joints, not {len(own[0])}" if leg else ""
    if any(robot.model.jnt_type[j] != HINGE for j in own[0] + own[1]):
        return "has a slide"
    return _difference(robot, one, other)


def _end(robot: PinnedRobot, limb: Limb) -> str:
    return robot.model.body(limb.links[-1]).name or "an unnamed body"


def _refuse_more_legs(
    robot: PinnedRobot, limbs: list[Limb], pair: tuple[Limb, Limb]
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
        raise UnfitError(
            f"{len(legs)} limbs reach the ground ({ends}); only two-legged robots walk",
            _LEGS_OR_UP,
        )


def _refuse_wheels(robot: PinnedRobot, limbs: list[Limb]) -> None:
    robot.place(robot.neutral)
    heights = {limb: _bottom(robot, limb.links[-1]) for limb in limbs}
    wheels = [limb for limb in limbs if _is_wheel(robot, limb)]
    if len(wheels) < 2:
        return
    ground = min(heights.values())
    size = max(-ground, 0.1)
    low = [w for w in wheels if heights[w] < ground + 0.1 * size]
    if len(low) > 1:
        names = ", ".join(robot.joint_name(w.joints[-1]) for w in low[:4])
        raise UnfitError(f"it rolls on wheels ({names}); walking needs flat feet")


def _bottom(robot: PinnedRobot, link: int) -> float:
    """Return how high above the base the lowest of a link is now [m]."""
    shapes = link_shapes(robot, link)
    return -lowest(shapes, DOWN) if shapes else np.inf


def _is_wheel(robot: PinnedRobot, limb: Limb) -> bool:
    """Whether a limb ends in something round that turns without end about its axis."""
    model, joint, link = robot.model, limb.joints[-1], limb.links[-1]
    if model.jnt_limited[joint] or model.jnt_type[joint] != HINGE:
        return False
    shapes = link_shapes(robot, link)
    if not shapes:
        return False
    across = np.linalg.svd(robot.axis(joint)[None])[2][1:]
    turns = 2.0 * np.pi * np.arange(16) / 16
    ways = np.stack([np.cos(turns), np.sin(turns)], axis=1) @ across
    radii = [lowest(shapes, way) - robot.anchor(joint) @ way for way in ways]
    return bool(min(radii) > (1.0 - _ROUND) * max(radii) > 0.0)
