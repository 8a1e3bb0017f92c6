"""Isolate a robot: one tree of bodies on a free base, and nothing that it lacks."""

from collections.abc import Callable, Sequence
from itertools import takewhile
from typing import Any

import mujoco
import numpy as np

from gaitchain.backends.actuators import BY_JOINT
from gaitchain.discover.gears import driven_by
from gaitchain.discover.notes import Doubt, listed
from gaitchain.discover.trees import keep_one_tree
from gaitchain.errors import RobotFileError
from gaitchain.messages import GRAVITY

_DUMMY_KG = 0.01  # a body that weighs less, without a shape, only carries a joint
_WEIGHT = (0.0, 0.0, -GRAVITY)
_FREE, _SLIDE = mujoco.mjtJoint.mjJNT_FREE, mujoco.mjtJoint.mjJNT_SLIDE
_HINGE, _BALL = mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_BALL
_TURN = 2.0 * np.pi  # of a joint's range in radians, at most
_WIDEST = 4.0 * np.pi  # end of the range of a hinge that turns more than once [rad]
_MOST_DEG = 360.0  # of a range in degrees; beyond it stand for none
_NQ = {_FREE: 7, _BALL: 4}
_EULER = mujoco.mjtOrientation.mjORIENTATION_EULER
_AXISANGLE = mujoco.mjtOrientation.mjORIENTATION_AXISANGLE
# What walking cannot do without; other flags of a file stay.
_FLAGS = ("CONSTRAINT", "EQUALITY", "LIMIT", "CONTACT", "GRAVITY", "ACTUATION")

_OBJ, _TRN, _EQ = mujoco.mjtObj, mujoco.mjtTrn, mujoco.mjtEq
_KINDS = {
    _OBJ.mjOBJ_BODY: "bodies",
    _OBJ.mjOBJ_XBODY: "bodies",
    _OBJ.mjOBJ_GEOM: "geoms",
    _OBJ.mjOBJ_SITE: "sites",
    _OBJ.mjOBJ_JOINT: "joints",
    _OBJ.mjOBJ_CAMERA: "cameras",
    _OBJ.mjOBJ_TENDON: "tendons",
    _OBJ.mjOBJ_ACTUATOR: "actuators",
}
_TRANSMISSIONS = {
    _TRN.mjTRN_JOINT: "joints",
    _TRN.mjTRN_JOINTINPARENT: "joints",
    _TRN.mjTRN_TENDON: "tendons",
    _TRN.mjTRN_SITE: "sites",
    _TRN.mjTRN_SLIDERCRANK: "sites",
    _TRN.mjTRN_BODY: "bodies",
}
_EQUALITIES = {_EQ.mjEQ_JOINT: "joints", _EQ.mjEQ_TENDON: "tendons"}

Names = set[tuple[str, str]]
"""Kinds and names of what others can refer to."""


def isolate(spec: Any) -> list[str]:
    """Delete all but the robot from its file, and free its base.

    Args:
        spec: the `mujoco.MjSpec`; changed in place.

    Returns:
        A note for everything that was repaired or left out.

    Raises:
        RobotFileError: there is no robot in it, or its base cannot be freed.
    """
    notes = _drop_strangers(spec) + _drop_disabled(spec) + _drop_gearless(spec)
    size = sum(_NQ.get(joint.type, 1) for joint in spec.joints)
    fitting = [len(key.qpos) in (0, size) for key in spec.keys]
    before = names_of(spec)
    base, others = keep_one_tree(spec)
    notes += others + _strip_world(spec)
    freed = _free_base(spec, base)
    users = drop_users(spec, before)
    notes += freed + users + _drop_welds(spec) + _turn_back(spec)
    kept = iter(fitting)
    notes += drop_keys(spec, lambda _: not next(kept) or bool(freed))
    notes += _reset_options(spec)
    notes += _name_all(spec)
    notes += _doubt_radians(spec) + _into_radians(spec) + _doubt_ranges(spec)
    if not spec.actuators:
        notes.append("It has no actuators; servos have to be added.")
    return notes


def drop_keys(spec: Any, unfit: Callable[[Any], bool]) -> list[str]:
    """Delete the keyframes that do not fit the robot."""
    gone = [key for key in list(spec.keys) if unfit(key)]
    names = [key.name for key in gone]
    for key in gone:
        spec.delete(key)
    return [f"{listed('keyframe', names)} left out: of another size."] if gone else []


def drop_actuators(spec: Any, gone: Sequence[Any]) -> list[str]:
    """Delete actuators, and what refers to them.

    Args:
        spec: the `mujoco.MjSpec`; changed in place.
        gone: of its actuators.

    Returns:
        A note of what went with them, if anything.
    """
    if not gone:
        return []
    before = names_of(spec)
    for actuator in gone:
        spec.delete(actuator)
    for key in spec.keys:
        key.ctrl, key.act = [], []  # of another size now; nobody reads them
    return drop_users(spec, before)


def _drop_disabled(spec: Any) -> list[str]:
    """Delete the actuators of disabled groups, which MuJoCo leaves without force."""
    groups = int(spec.option.disableactuator)
    # Of a group beyond the bits of that number none can be disabled.
    off = [a for a in spec.actuators if a.group >= 0 and groups >> a.group & 1]
    spec.option.disableactuator = 0
    if not off:
        return []
    note = f"{_listed_actuators(off)} left out: the file disables their groups."
    return [note, *drop_actuators(spec, off)]


def _drop_gearless(spec: Any) -> list[str]:
    """Delete the actuators that have no force on anything, and no gain at a joint."""
    off = [a for a in spec.actuators if a.gear[0] == 0.0 and _is_on_one(spec, a)]
    if not off:
        return []
    doubt = Doubt(f"{_listed_actuators(off)} left out: gear 0 turns nothing.")
    return [doubt, *drop_actuators(spec, off)]


def _is_on_one(spec: Any, actuator: Any) -> bool:
    """Whether the first number of an actuator's gear is all that counts of it."""
    if actuator.trntype == _TRN.mjTRN_TENDON:
        return True
    kinds = {joint.name: joint.type for joint in spec.joints}
    by_joint = actuator.trntype in BY_JOINT
    return by_joint and kinds.get(actuator.target) in (_HINGE, _SLIDE)


def _listed_actuators(actuators: Sequence[Any]) -> str:
    return listed("actuator", [a.name or a.target for a in actuators])


def _strip_world(spec: Any) -> list[str]:
    world = spec.worldbody
    # A geom deleted twice is freed twice: the world's own may be terrain as well.
    terrain = [g for g in spec.geoms if g.hfieldname and g.parent != world]
    scenery = {
        "geom": [*world.geoms, *terrain],
        "site": list(world.sites),
        "camera": list(world.cameras),
        "light": list(spec.lights),
        "skin": list(spec.skins),
    }
    unseen = [*spec.hfields, *spec.tuples]  # nothing of a robot refers to them
    for item in [*(i for items in scenery.values() for i in items), *unseen]:
        spec.delete(item)
    counts = [
        f"{len(items)} {kind}{'s' if len(items) > 1 else ''}"
        for kind, items in scenery.items()
        if items
    ]
    return [f"Scenery left out: {', '.join(counts)}."] if counts else []


def _free_base(spec: Any, base: Any) -> list[str]:
    """Put the base on a free joint if it is on none."""
    base.mocap = False
    taken = {joint.name for joint in spec.joints}
    for joint in base.joints:
        if joint.type == _FREE:
            joint.name = joint.name or _unused("base", taken)
            return []
    stand_in = _stand_in(spec, base)
    names = [joint.name for joint in stand_in]
    for joint in stand_in:
        spec.delete(joint)
    if base.joints:
        raise RobotFileError(
            f"body {base.name!r} hangs from the world by joint "
            f"{base.joints[0].name or '(unnamed)'!r}; a robot that walks has a base "
            "that nothing holds: a body without joints, or with a free one"
        )
    base.add_freejoint(name=_unused("base", taken))
    how = f"in place of {listed('joint', names)}" if names else "where it was fixed"
    return [f"A free joint added to the base {base.name!r}, {how}."]


def _stand_in(spec: Any, base: Any) -> list[Any]:
    """Return the joints that stand for a free one: two slides or more, undriven.

    They may be on massless bodies, one each, above the first that is part of the robot.
    """
    body = base
    joints = list(base.joints)
    while len(body.bodies) == 1 and not body.geoms and body.mass < _DUMMY_KG:
        body = body.bodies[0]
        joints += body.joints
    joints = list(takewhile(lambda joint: not driven_by(spec, joint), joints))
    return joints if sum(j.type == _SLIDE for j in joints) > 1 else []


def _drop_welds(spec: Any) -> list[str]:
    """Delete the constraints that hold the robot to the world."""
    held = [
        equality
        for equality in list(spec.equalities)
        if equality.type in (mujoco.mjtEq.mjEQ_WELD, mujoco.mjtEq.mjEQ_CONNECT)
        and equality.objtype == mujoco.mjtObj.mjOBJ_BODY
        and not {"", "world"}.isdisjoint((equality.name1, equality.name2))
    ]
    for equality in held:
        spec.delete(equality)
    return [f"{len(held)} constraints to the world left out."] if held else []


def _turn_back(spec: Any) -> list[str]:
    """Let cameras that follow what is left out look as they are mounted."""
    known = {body.name for body in spec.bodies}
    lost = [c for c in spec.cameras if c.targetbody and c.targetbody not in known]
    for camera in lost:
        camera.mode, camera.targetbody = mujoco.mjtCamLight.mjCAMLIGHT_FIXED, ""
    names = [camera.name for camera in lost]
    return [f"{listed('camera', names)} of what is left out: fixed."] if lost else []


def _reset_options(spec: Any) -> list[str]:
    notes = []
    flags = {n: int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{n}")) for n in _FLAGS}
    off = [name for name, flag in flags.items() if spec.option.disableflags & flag]
    for name in off:
        spec.option.disableflags &= ~flags[name]
    if off:
        notes.append(f"Switched on again: {', '.join(off).lower()}.")
    if not np.allclose(spec.option.gravity, _WEIGHT, atol=0.05):
        was = ", ".join(f"{part:g}" for part in spec.option.gravity)
        notes.append(f"Gravity was [{was}]; now it is the Earth's.")
        spec.option.gravity = _WEIGHT
    if lifted := [body for body in spec.bodies if body.gravcomp]:
        for body in lifted:
            body.gravcomp = 0.0
        notes.append(f"{len(lifted)} bodies were spared gravity; now none is.")
    spec.memory = spec.njmax = spec.nconmax = -1
    # Bodies stay as the file has them, whatever the file says of welding or hiding.
    spec.compiler.fusestatic = spec.compiler.discardvisual = False
    return notes


def _name_all(spec: Any) -> list[str]:
    """Give a name to what has none: others refer to it."""
    notes = []
    for kind, items in (("body", spec.bodies), ("joint", spec.joints)):
        taken = {item.name for item in items}
        unnamed = [item for item in items if not item.name]
        for item in unnamed:
            item.name = _unused(kind, taken)
            taken.add(item.name)
        if unnamed:
            first = unnamed[0].name
            notes.append(f"{len(unnamed)} {kind} names made up, as {first!r}.")
    return notes


def _unused(name: str, taken: set[str]) -> str:
    if name not in taken:
        return name
    return next(n for n in (f"{name}_{i}" for i in range(2, 10**6)) if n not in taken)


def _into_radians(spec: Any) -> list[str]:
    """Convert every angle of a file in degrees, and of what it attaches."""
    kinds = ("joints", "bodies", "geoms", "sites", "cameras", "frames")
    items = [item for kind in kinds for item in getattr(spec, kind)]
    in_degrees = [item for item in items if item.compiler.degree]
    notes = _doubt_degrees(in_degrees)
    for item in in_degrees:
        _turn_into_radians(item)
    # What was attached has the compiler of its own file, and all of that share it.
    for compiler in (spec.compiler, *(item.compiler for item in in_degrees)):
        compiler.degree = False
    return notes


def _doubt_degrees(items: list[Any]) -> list[str]:
    """Doubt that ranges are in degrees if all of them would fit one turn in radians."""
    hinges = [i for i in items if isinstance(i, mujoco.MjsJoint) and i.type == _HINGE]
    widest = max((float(np.abs(hinge.range).max()) for hinge in hinges), default=0.0)
    if not 0.0 < widest <= _TURN:
        return []
    return [
        Doubt(
            f"The ranges of its hinges end at most {widest:.1f} deg from 0: is "
            '<compiler angle="radian"/> missing?'
        )
    ]


def _doubt_radians(spec: Any) -> list[str]:
    """Doubt ranges in radians that no hinge needs, and one in degrees may."""
    hinges = [j for j in spec.joints if j.type == _HINGE and not j.compiler.degree]
    wide = [j.name for j in hinges if _WIDEST < np.abs(j.range).max() <= _MOST_DEG]
    if not wide:
        return []
    return [
        Doubt(
            f"Limits of {listed('joint', wide)} beyond {_WIDEST:.3g} rad: are they in "
            'degrees? A URDF has radians, an MJCF says <compiler angle="degree"/>.'
        )
    ]


def _doubt_ranges(spec: Any) -> list[str]:
    """Doubt ranges that MuJoCo leaves out, as the lower end is not the lower one."""
    auto = mujoco.mjtLimited.mjLIMITED_AUTO
    turned = [
        joint.name
        for joint in spec.joints
        if joint.limited == auto and any(joint.range)
        if joint.range[0] >= joint.range[1]
    ]
    if not turned:
        return []
    what = listed("joint", turned)
    why = "the lower end of its range does not lie below the upper"
    return [Doubt(f"{what} without limits: {why}.")]


def _turn_into_radians(item: Any) -> None:
    """Convert the angles of a joint, or those by which something else is turned."""
    if isinstance(item, mujoco.MjsJoint):
        if item.type in (_HINGE, _BALL):
            item.range = np.radians(item.range)
            item.ref, item.springref = np.radians([item.ref, item.springref])
        return
    for turn in [item.alt] + ([item.ialt] if isinstance(item, mujoco.MjsBody) else []):
        if turn.type == _EULER:
            turn.euler = np.radians(turn.euler)
        elif turn.type == _AXISANGLE:
            turn.axisangle = [*turn.axisangle[:3], np.radians(turn.axisangle[3])]


def names_of(spec: Any) -> Names:
    """Return kind and name of everything that others can refer to."""
    kinds = set(_KINDS.values())
    return {(k, item.name) for k in kinds for item in getattr(spec, k) if item.name}


def drop_users(spec: Any, before: Names) -> list[str]:
    """Delete what refers to something that was deleted.

    MjSpec does this for the bodies of a tree, not for single joints, geoms and sites.

    Args:
        spec: the `mujoco.MjSpec`; changed in place.
        before: its names before the deletion.

    Returns:
        A note of how much it was, if anything.
    """
    gone, count = before - names_of(spec), 0
    while gone:
        known = names_of(spec)
        for tendon in list(spec.tendons):
            pulley = mujoco.mjtWrap.mjWRAP_PULLEY
            if any(w.type != pulley and w.target is None for w in tendon.path):
                spec.delete(tendon)
                count += 1
        for kind, refers in _REFERENCES.items():
            for item in list(getattr(spec, kind)):
                if any(reference in gone for reference in refers(item)):
                    spec.delete(item)
                    count += 1
        gone = known - names_of(spec)
    what = "pairs, sensors, actuators, tendons or constraints of what is left out"
    return [f"{count} {what} went with it."] if count else []


def _drop_strangers(spec: Any) -> list[str]:
    """Delete pairs and sensors of what was never there: of a scene around the robot."""
    known = names_of(spec)
    gone: dict[str, list[str]] = {}
    for kind in ("pairs", "sensors"):
        for item in list(getattr(spec, kind)):
            for what, name in _REFERENCES[kind](item):
                if name and what and (what, name) not in known:
                    gone.setdefault(kind, []).append(name)
                    spec.delete(item)
                    break
    return [
        f"{listed(kind[:-1], list(dict.fromkeys(names)))} left out: of what is not in "
        "the file; where a scene includes it, give the scene."
        for kind, names in gone.items()
    ]


def _constrained(equality: Any) -> str | None:
    return _EQUALITIES.get(equality.type) or _KINDS.get(equality.objtype)


_REFERENCES: dict[str, Callable[[Any], list[tuple[str | None, str]]]] = {
    "pairs": lambda p: [("geoms", p.geomname1), ("geoms", p.geomname2)],
    "excludes": lambda e: [("bodies", e.bodyname1), ("bodies", e.bodyname2)],
    "equalities": lambda e: [(_constrained(e), name) for name in (e.name1, e.name2)],
    "actuators": lambda a: [
        (_TRANSMISSIONS.get(a.trntype), a.target),
        *(("sites", site) for site in (a.refsite, a.slidersite)),
    ],
    "sensors": lambda s: [
        (_KINDS.get(s.objtype), s.objname),
        (_KINDS.get(s.reftype), s.refname),
    ],
}
"""Kind and name of what the items of each kind refer to."""
