"""Tendons: servos that turn a joint by way of one. Ours.

A fixed tendon over one joint is as long as its coefficient times the joint's angle: its
actuators are the joint's own, geared by the coefficient. Others turn no joint alone, so
that walking cannot use them, and in the legs they would hold it back.
"""

from collections.abc import Collection, Iterator
from typing import Any

import mujoco
import numpy as np

from gaitchain.backends.actuators import BY_JOINT
from gaitchain.discover.notes import listed
from gaitchain.discover.ranges import inherit_range, is_limited
from gaitchain.sim.bodies import subtree

_TRN, _WRAP, _LIMITED = mujoco.mjtTrn, mujoco.mjtWrap, mujoco.mjtLimited
_MUSCLE = mujoco.mjtGain.mjGAIN_MUSCLE  # pulls by the range of what it is on


def fold_tendons(spec: Any) -> list[str]:
    """Move actuators from tendons over one joint to that joint.

    Args:
        spec: the `mujoco.MjSpec` of the robot alone; changed in place.

    Returns:
        A note of those that were moved, and one of those that drive no joint.
    """
    tendons = {tendon.name: tendon for tendon in spec.tendons}
    names = []
    for actuator in spec.actuators:
        tendon = tendons.get(actuator.target)
        by_tendon = actuator.trntype == _TRN.mjTRN_TENDON and tendon is not None
        if by_tendon and _turns_one(tendon) and actuator.gaintype != _MUSCLE:
            names.append(_called(actuator))
            _fold(actuator, tendon)
    unused = [_called(a) for a in spec.actuators if a.trntype not in BY_JOINT]
    notes = []
    if names:
        what = f"{listed('actuator', names)} of tendons over one joint"
        notes.append(
            f"{what} taken for the joints' own: targets are angles, not lengths."
        )
    if unused:
        what = f"{listed('actuator', unused)} of tendons, sites or bodies not used"
        notes.append(f"{what}: servos are those of joints.")
    return notes


def pulling_at(spec: Any, joints: Collection[str]) -> list[Any]:
    """Return the actuators that act on some joints by a tendon, a site or a crank.

    Args:
        spec: the `mujoco.MjSpec` of the robot alone.
        joints: their names.
    """
    wanted = set(joints)
    return [a for a in spec.actuators if not wanted.isdisjoint(_turned_by(spec, a))]


def pulled_over_tendons(model: Any, joint: int) -> list[str]:
    """Return the names of actuators that pull at a joint over a tendon.

    Args:
        model: the compiled `mujoco.MjModel`.
        joint: its number.
    """
    by_tendon = model.actuator_trntype == int(_TRN.mjTRN_TENDON)
    return [
        str(model.actuator(a).name or model.tendon(model.actuator_trnid[a, 0]).name)
        for a in np.flatnonzero(by_tendon)
        if _is_over(model, int(model.actuator_trnid[a, 0]), joint)
    ]


def _is_over(model: Any, tendon: int, joint: int) -> bool:
    """Whether a tendon's length depends on a joint."""
    first = model.tendon_adr[tendon]
    path = range(first, first + model.tendon_num[tendon])
    parts = [(int(model.wrap_type[i]), int(model.wrap_objid[i])) for i in path]
    if (int(_WRAP.mjWRAP_JOINT), joint) in parts:
        return True
    moved = set(subtree(model, model.jnt_bodyid[joint]))
    ends = {
        int(model.site_bodyid[at]) in moved
        for kind, at in parts
        if kind == int(_WRAP.mjWRAP_SITE)
    }
    return len(ends) > 1


def _turns_one(tendon: Any) -> bool:
    parts = tendon.path
    return len(parts) == 1 and is_over_joint(parts[0])


def is_over_joint(part: Any) -> bool:
    """Return whether a part of a tendon's path is a joint, and one of the file.

    Args:
        part: a `mujoco.MjsWrap`.
    """
    known = part.type == _WRAP.mjWRAP_JOINT and part.target is not None
    return bool(known and part.coef)


def _called(actuator: Any) -> str:
    """Return an actuator's name, or that of what it is on where it has none."""
    return str(actuator.name or actuator.target)


def _fold(actuator: Any, tendon: Any) -> None:
    (part,) = tendon.path
    inherit_range(actuator, tendon.range)
    if is_limited(tendon.actfrclimited, tendon.actfrcrange):
        own = is_limited(actuator.forcelimited, actuator.forcerange)
        low, high = actuator.forcerange if own else (-np.inf, np.inf)
        least, most = tendon.actfrcrange
        actuator.forcerange = [max(low, least), min(high, most)]
        actuator.forcelimited = _LIMITED.mjLIMITED_TRUE
    actuator.trntype = _TRN.mjTRN_JOINT
    actuator.target = part.target.name
    actuator.gear = np.asarray(actuator.gear) * part.coef


def _turned_by(spec: Any, actuator: Any) -> set[str]:
    """Return the joints that an actuator turns which is on none of its own."""
    if actuator.trntype == _TRN.mjTRN_TENDON:
        return set(_joints_of(spec.tendon(actuator.target)))
    # A site alone is pushed against the world, and by nothing without a target.
    sites = [spec.site(name) for name in _ends(actuator) if name]
    return _between([site.parent for site in sites]) if len(sites) > 1 else set()


def _ends(actuator: Any) -> tuple[str, str]:
    if actuator.trntype == _TRN.mjTRN_SITE:
        return actuator.target, actuator.refsite
    if actuator.trntype == _TRN.mjTRN_SLIDERCRANK:
        return actuator.target, actuator.slidersite
    return "", ""


def _joints_of(tendon: Any) -> Iterator[str]:
    """Yield the joints on which a tendon's length depends."""
    parts = [part for part in tendon.path if part.type != _WRAP.mjWRAP_PULLEY]
    yield from (p.target.name for p in parts if p.type == _WRAP.mjWRAP_JOINT)
    yield from _between([p.target.parent for p in parts if p.type in _ON_BODIES])


_ON_BODIES = (_WRAP.mjWRAP_SITE, _WRAP.mjWRAP_SPHERE, _WRAP.mjWRAP_CYLINDER)


def _between(bodies: list[Any]) -> set[str]:
    """Return the joints that move some of the bodies against others."""
    ways = [set(_above(body)) for body in bodies]
    every = set[str]().union(*ways)
    return {joint for joint in every if not all(joint in way for way in ways)}


def _above(body: Any) -> Iterator[str]:
    """Yield the joints by which a body hangs from the world."""
    while body is not None:
        yield from (joint.name for joint in body.joints)
        body = body.parent
