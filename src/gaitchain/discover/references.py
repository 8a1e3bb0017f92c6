"""What refers to what in a model, and what goes when something else is taken out."""

from collections.abc import Callable, Iterable
from typing import Any

import mujoco

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


def names_of(spec: Any) -> Names:
    """Return kind and name of everything that others can refer to."""
    kinds = set(_KINDS.values())
    return {(kind, item.name) for kind in kinds for item in getattr(spec, kind)}


def drop_users(spec: Any, before: Names) -> list[str]:
    """Delete what refers to something that is there no more."""
    gone, count = before - names_of(spec), 0
    while gone:
        known = names_of(spec)
        for tendon in list(spec.tendons):
            pulley = mujoco.mjtWrap.mjWRAP_PULLEY
            if any(w.type != pulley and w.target is None for w in tendon.path):
                spec.delete(tendon)
                count += 1
        for items, refers in _references(spec):
            for item in items:
                if any(reference in gone for reference in refers(item)):
                    spec.delete(item)
                    count += 1
        gone = known - names_of(spec)
    what = "pairs, sensors, actuators, tendons or constraints of what is left out"
    return [f"{count} {what} went with it."] if count else []


def _references(
    spec: Any,
) -> Iterable[tuple[list[Any], Callable[[Any], list[tuple[str | None, str]]]]]:
    """Yield every kind of item that refers to others, and what one refers to."""
    yield list(spec.pairs), lambda p: [("geoms", p.geomname1), ("geoms", p.geomname2)]
    yield (
        list(spec.excludes),
        lambda e: [("bodies", e.bodyname1), ("bodies", e.bodyname2)],
    )
    yield list(spec.equalities), lambda e: [(_constrained(e), n) for n in pair_of(e)]
    yield (
        list(spec.actuators),
        lambda a: [
            (_TRANSMISSIONS.get(a.trntype), a.target),
            *(("sites", site) for site in (a.refsite, a.slidersite)),
        ],
    )
    yield (
        list(spec.sensors),
        lambda s: [
            (_KINDS.get(s.objtype), s.objname),
            (_KINDS.get(s.reftype), s.refname),
        ],
    )


def _constrained(equality: Any) -> str | None:
    return _EQUALITIES.get(equality.type) or _KINDS.get(equality.objtype)


def pair_of(equality: Any) -> tuple[str, str]:
    """Return the names of the two things that a constraint holds together."""
    return equality.name1, equality.name2
