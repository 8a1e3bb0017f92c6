"""The limbs of a robot's model: chains of links from the base to an end of the tree."""

from dataclasses import dataclass, replace
from typing import Any

import mujoco
import numpy as np

from gaitchain.discover.findings import refusal
from gaitchain.discover.pinned_robot import HeldRobot
from gaitchain.discover.shapes import ground_geoms, lowest, shapes_of

_LIMB_JOINTS = 3  # a limb with fewer is no leg at all
DOWN = np.array([0.0, 0.0, -1.0])
_SWEEPS = 3  # times that every joint of a limb is tried
_SWEEP = np.linspace(0.0, 1.0, 9)
_CLOSING = (int(mujoco.mjtEq.mjEQ_CONNECT), int(mujoco.mjtEq.mjEQ_WELD))


@dataclass(frozen=True, eq=False)
class Limb:
    """Links and joints from the base to an end of the tree."""

    links: tuple[int, ...]
    """Bodies with joints, outwards; what is welded to a body is part of it."""
    joints: tuple[int, ...]
    depth: float
    """How far below the base its end can reach [m], negative."""


def find_base(model: Any, origin: str) -> int:
    """Return the body with the free joint; the heaviest of several.

    Raises:
        RobotFileError: none has one, or a mass or inertia cannot be.
    """
    free = np.flatnonzero(model.jnt_type == int(mujoco.mjtJoint.mjJNT_FREE))
    if not len(free):
        raise refusal(
            origin, "no free joint: the base is fixed to the world, as an arm's is"
        )
    base = int(max(model.jnt_bodyid[free], key=lambda b: model.body_subtreemass[b]))
    for body in range(1, model.nbody):
        if model.body_rootid[body] != model.body_rootid[base]:
            continue
        moves = model.body_weldid[body] == body
        numbers = [*model.body_inertia[body], model.body_mass[body]]
        zero = moves and model.body_subtreemass[body] <= 0.0
        if zero or not np.isfinite(numbers).all() or min(numbers) < 0.0:
            raise refusal(
                origin,
                f"body {model.body(body).name or body}: mass {numbers[3]:g} kg, "
                f"inertia {', '.join(f'{i:g}' for i in numbers[:3])} kg m^2; every "
                "moving body needs finite values above 0",
            )
    return base


def limbs_of(robot: HeldRobot) -> list[Limb]:
    """Return a limb for each end of the tree, deepest first."""
    model = robot.model
    links = [b for b in robot.bodies if model.body_weldid[b] == b and b != robot.base]
    inner = {model.body_weldid[model.body_parentid[b]] for b in links}
    chains = [_chain(robot, b) for b in links if b not in inner]
    # A trunk that bends would bring the arms to the ground.
    trunk: set[int] = set()
    for i, one in enumerate(chains):
        for other in chains[i + 1 :]:
            shared = shared_links(one, other)
            if all(
                len(own_joints(robot, c, shared)) >= _LIMB_JOINTS for c in (one, other)
            ):
                trunk.update(one.links[:shared])
    fixed = {j for j in robot.joints if model.jnt_bodyid[j] in trunk}
    ends = [replace(c, depth=_depth(robot, c, fixed)) for c in chains]
    return sorted(ends, key=lambda limb: limb.depth)


def limb_to(robot: HeldRobot, link: int) -> Limb:
    """Return the limb that ends with a link."""
    chain = _chain(robot, link)
    return replace(chain, depth=_depth(robot, chain, set()))


def bodies_of(robot: HeldRobot, link: int) -> set[int]:
    """Return a link's bodies: itself and what is welded to it."""
    return {b for b in robot.bodies if robot.model.body_weldid[b] == link}


def shared_links(one: Limb, other: Limb) -> int:
    """Count the links that two limbs share, from the base on."""
    same = [a == b for a, b in zip(one.links, other.links, strict=False)]
    return same.index(False) if False in same else len(same)


def own_joints(robot: HeldRobot, limb: Limb, shared: int) -> tuple[int, ...]:
    """Return a limb's joints beyond its first `shared` links."""
    own = set(limb.links[shared:])
    return tuple(j for j in limb.joints if robot.model.jnt_bodyid[j] in own)


def _chain(robot: HeldRobot, link: int) -> Limb:
    model, links = robot.model, [link]
    while (body := int(model.body_weldid[model.body_parentid[links[0]]])) != robot.base:
        links.insert(0, body)
    joints = tuple(
        int(model.body_jntadr[b] + i)
        for b in links
        for i in range(model.body_jntnum[b])
    )
    return Limb(tuple(links), joints, 0.0)


def _depth(robot: HeldRobot, limb: Limb, fixed: set[int]) -> float:
    """Lower a limb's end joint by joint, as far as it goes."""
    link, pose = limb.links[-1], np.array(robot.neutral)
    robot.place(pose)
    geoms, _ = ground_geoms(robot.model, bodies_of(robot, link))
    shapes = shapes_of(robot.model, robot.data, geoms, link)

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


def refuse_loops(robot: HeldRobot, limbs: tuple[Limb, Limb], origin: str) -> None:
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
                raise refusal(
                    origin, f"closed loop at {names}: parallel legs are not supported"
                )


def _within(model: Any, body: int, root: int) -> bool:
    while body not in (0, root):
        body = int(model.body_parentid[body])
    return body == root
