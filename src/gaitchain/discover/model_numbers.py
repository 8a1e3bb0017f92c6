"""The numbers of a robot's file: finite, and of signs that physics can have. Ours.

MuJoCo compiles NaN, infinities, time steps of 0 and servos that push away from their
targets. What then breaks is far from the file, or nothing does and the walk is wrong.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import mujoco
import numpy as np

from gaitchain.backends.actuators import BY_JOINT, actuator_name
from gaitchain.errors import RobotFileError
from gaitchain.messages import Array

_EQ, _OBJ = mujoco.mjtEq, mujoco.mjtObj
_AFFINE = int(mujoco.mjtBias.mjBIAS_AFFINE)
_KP, _KV = "kp, or gainprm", "kp, kv, or biasprm"


class _Kind(NamedTuple):
    """Numbers of one kind of object: attributes as a file calls them, by array."""

    of: Callable[[Any], Any]
    """Which object each row of the arrays belongs to, by model."""
    called: Callable[[Any, int], str]
    """What messages call an object."""
    finite: dict[str, str]
    numbers: dict[str, str]
    """Those that may be infinite, as the range of what nothing bounds."""


def check_numbers(model: Any) -> None:
    """Refuse numbers of a compiled model that no robot has.

    Args:
        model: the `mujoco.MjModel`.

    Raises:
        RobotFileError: one is no number, infinite where that means nothing, or makes
            a servo, a damper or time run backwards; the message names object and
            attribute.
    """
    for kind in _KINDS:
        for array, attribute in kind.finite.items():
            _check(model, kind, array, attribute, np.isfinite)
        for array, attribute in kind.numbers.items():
            _check(model, kind, array, attribute, _is_number)
    _check_option(model.opt)
    _check_dampers(model)
    _check_servos(model)


def _is_number(values: Array) -> Any:
    return ~np.isnan(values)


def _check(
    model: Any, kind: _Kind, array: str, attribute: str, good: Callable[[Array], Any]
) -> None:
    values = np.asarray(getattr(model, array), float)
    for row, at in zip(kind.of(model), values, strict=True):
        if not np.all(fine := np.ravel(good(at))):
            bad = np.ravel(at)[int(np.argmin(fine))]
            raise RobotFileError(
                f"{kind.called(model, int(row))}: {attribute} = {bad:g}; give a finite "
                "number"
            )


def _check_option(opt: Any) -> None:
    """Check what a file's <option> says; a tolerance may be infinite."""
    for name in (n for n in dir(opt) if not n.startswith("_")):
        value = getattr(opt, name)
        if not isinstance(value, float | np.ndarray):
            continue
        good = _is_number if "tolerance" in name else np.isfinite
        if not np.all(good(np.asarray(value))):
            attribute = name.removeprefix("o_")
            raise RobotFileError(f"option {attribute} = {value}; give finite numbers")
    if opt.timestep <= 0.0:
        raise RobotFileError(
            f"option timestep = {opt.timestep:g} s; give more than 0, MuJoCo's default "
            "is 0.002"
        )


def _check_dampers(model: Any) -> None:
    for dof in np.flatnonzero(model.dof_damping < 0.0):
        joint = int(model.dof_jntid[dof])
        raise RobotFileError(
            f"{_joint(model, joint)}: damping = {model.dof_damping[dof]:g}; give 0 or "
            "more"
        )


def _check_servos(model: Any) -> None:
    """Refuse servos that push a joint away, whatever the sign of their gear."""
    by_joint = np.isin(model.actuator_trntype, BY_JOINT)
    affine = by_joint & (model.actuator_biastype == _AFFINE)
    for order, gain in ((1, "kp"), (2, "kv")):
        for a in np.flatnonzero(affine & (model.actuator_biasprm[:, order] > 0.0)):
            value = model.actuator_biasprm[a, order]
            raise RobotFileError(
                f"{_actuator(model, int(a))}: {gain} = {-value:g} (its biasprm has "
                f"{value:g}), which pushes the joint away; give 0 or more"
            )


def _rows(count: str) -> Callable[[Any], Any]:
    return lambda model: np.arange(getattr(model, count))


def _body(model: Any, body: int) -> str:
    return f"body {model.body(body).name or body!r}"


def _joint(model: Any, joint: int) -> str:
    return f"joint {model.joint(joint).name or joint!r}"


def _geom(model: Any, geom: int) -> str:
    name = model.geom(geom).name
    body = model.body(model.geom_bodyid[geom]).name
    return f"geom {name!r}" if name else f"a geom of body {body!r}"


def _actuator(model: Any, actuator: int) -> str:
    return f"actuator {actuator_name(model, actuator)}"


def _equality(model: Any, tie: int) -> str:
    name, kind = model.equality(tie).name, int(model.eq_type[tie])
    if name:
        return f"equality {name!r}"
    objects = {int(_EQ.mjEQ_JOINT): _OBJ.mjOBJ_JOINT}
    objects[int(_EQ.mjEQ_TENDON)] = _OBJ.mjOBJ_TENDON
    of = objects.get(kind, mujoco.mjtObj(int(model.eq_objtype[tie])))
    return f"equality of {mujoco.mj_id2name(model, of, model.eq_obj1id[tie])!r}"


def _tendon(model: Any, tendon: int) -> str:
    return f"tendon {model.tendon(tendon).name or tendon!r}"


def _coordinates(model: Any) -> Any:
    """Return the joint of each number of `qpos`."""
    return np.searchsorted(model.jnt_qposadr, np.arange(model.nq), "right") - 1


def _named(prefix: str, *names: str) -> dict[str, str]:
    """Return the attributes that arrays are named after."""
    return {f"{prefix}_{name}": name for name in names}


_KINDS = (
    _Kind(
        _rows("nbody"),
        _body,
        {
            "body_ipos": "inertial pos",
            "body_iquat": "inertial quat",
            "body_inertia": "inertia",
            **_named("body", "pos", "quat", "mass"),
        },
        {},
    ),
    _Kind(
        _rows("njnt"),
        _joint,
        {
            "jnt_solref": "solreflimit",
            "jnt_solimp": "solimplimit",
            **_named("jnt", "pos", "axis", "range", "stiffness", "margin"),
        },
        {"jnt_actfrcrange": "actuatorfrcrange"},
    ),
    _Kind(
        lambda model: model.dof_jntid,
        _joint,
        {
            "dof_solref": "solreffriction",
            "dof_solimp": "solimpfriction",
            **_named("dof", "damping", "armature", "frictionloss"),
        },
        {},
    ),
    _Kind(_coordinates, _joint, {"qpos0": "ref", "qpos_spring": "springref"}, {}),
    _Kind(
        _rows("ngeom"),
        _geom,
        _named(
            "geom",
            *("pos", "quat", "size", "friction", "solref", "solimp", "solmix"),
            *("margin", "gap"),
        ),
        {},
    ),
    _Kind(
        _rows("nu"),
        _actuator,
        {"actuator_gear": "gear", "actuator_gainprm": _KP, "actuator_biasprm": _KV},
        _named("actuator", "dynprm", "ctrlrange", "forcerange", "actrange"),
    ),
    _Kind(
        _rows("neq"),
        _equality,
        {"eq_data": "its numbers", **_named("eq", "solref", "solimp")},
        {},
    ),
    _Kind(
        _rows("ntendon"),
        _tendon,
        _named("tendon", "stiffness", "damping", "frictionloss", "margin"),
        {"tendon_range": "range", "tendon_actfrcrange": "actuatorfrcrange"},
    ),
)
