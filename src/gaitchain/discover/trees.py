"""Which of the trees of bodies that hang from the world is the robot."""

from typing import Any

import mujoco

from gaitchain.discover.notes import Doubt, listed
from gaitchain.errors import RobotFileError

_MAX_MOVING = 500
_FEWEST = 10  # hinges and slides of two legs
_FREE, _SLIDE = mujoco.mjtJoint.mjJNT_FREE, mujoco.mjtJoint.mjJNT_SLIDE
_HINGE, _BALL = mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_BALL


def keep_one_tree(spec: Any) -> tuple[Any, list[str]]:
    """Delete all trees of bodies but the robot's: a free one, with most joints.

    Args:
        spec: the `mujoco.MjSpec`; changed in place.

    Returns:
        The robot's root, and a note of what was left out, if anything.

    Raises:
        RobotFileError: nothing has joints, too much has, the robot is in parts, or
            the file sets the mass of all trees, which cannot be weighed.
    """
    trees = sorted(spec.worldbody.bodies, key=_rank, reverse=True)
    if not trees or not any(_jointed(tree) for tree in trees):
        raise RobotFileError("it has no joints; a robot that walks has at least ten")
    if (moving := _jointed(trees[0])) > _MAX_MOVING:
        raise RobotFileError(f"{moving} moving bodies; at most {_MAX_MOVING}")
    _refuse_fused(trees)
    others = [tree.name or "(unnamed)" for tree in trees[1:]]
    _share_mass(spec, trees[0], others)
    for tree in trees[1:]:
        spec.delete(tree)
    if not others:
        return trees[0], []
    kept = trees[0].name or "(unnamed)"
    left_out = f"{listed('tree', others)} left out: {kept!r} is the robot."
    return trees[0], [Doubt(left_out)]


def _share_mass(spec: Any, kept: Any, others: list[str]) -> None:
    """Let a total mass that a file sets be what one tree weighs in it.

    Raises:
        RobotFileError: its trees cannot be weighed together.
    """
    total = spec.compiler.settotalmass
    if total <= 0.0 or not others:
        return
    whole = spec.copy()
    tree = whole.worldbody.bodies[list(spec.worldbody.bodies).index(kept)]
    try:
        model = whole.compile()
    except ValueError as error:
        why = " ".join(str(error).removeprefix("Error: ").split())
        raise RobotFileError(
            f'settotalmass="{total:g}" counts {listed("tree", others)}, too, and they '
            f"cannot be weighed: {why}; give the robot alone, with its own total"
        ) from None
    spec.compiler.settotalmass = float(model.body_subtreemass[tree.id])


def _rank(tree: Any) -> tuple[bool, int, int, int]:
    """Whether a tree may be a free robot; its ways to turn, moving bodies, all."""
    bodies = [tree, *tree.find_all("body")]
    joints = [joint for body in bodies for joint in body.joints]
    single = sum(joint.type in (_HINGE, _SLIDE) for joint in joints)
    single += 3 * sum(joint.type == _BALL for joint in joints)
    free = any(joint.type == _FREE for joint in tree.joints)
    return free and single >= _FEWEST, single, _jointed(tree), len(bodies)


def _jointed(tree: Any) -> int:
    """Count the bodies of a tree that move on joints."""
    bodies = [tree, *tree.find_all("body")]
    return sum(any(j.type != _FREE for j in body.joints) for body in bodies)


def _refuse_fused(trees: list[Any]) -> None:
    """Refuse legs that hang from the world, each a tree of its own."""
    held = [
        tree.name or "(unnamed)"
        for tree in trees
        if any(joint.type == _HINGE for joint in tree.joints)
        and not any(joint.type in (_FREE, _SLIDE) for joint in tree.joints)
        and _rank(tree) >= (False, _FEWEST // 2)
    ]
    if len(held) > 1 and (trees[0].name or "(unnamed)") in held:
        raise RobotFileError(
            f"{listed('tree', held)} on hinges: its base is fused into the world, as "
            "MuJoCo's conversion of a URDF does: give the URDF itself, or put these "
            "bodies into one <body> with a <freejoint/>"
        )
