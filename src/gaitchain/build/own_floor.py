"""The floor under a robot's own model, and what its soles' contacts are there. Ours.

A file's own floor goes with its scenery. The one that takes its place lets the robot's
geoms say of the contact what they say themselves.
"""

from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np

from gaitchain.backends.model import SOLE_DEPTH_M, ModelBackend
from gaitchain.discover.load import is_mjcf

_NAME = "gaitchain_floor"
_PLANE = mujoco.mjtGeom.mjGEOM_PLANE
_ORDINARY, _ALL = 1, 2**31 - 1  # bits of contype and conaffinity: MuJoCo's own, and all
_OF_PAIR = ("condim", "friction", "solref", "solreffriction", "solimp", "margin", "gap")
_NO_SAFETY = int(mujoco.mjtDisableBit.mjDSBL_REFSAFE)
_Bits = tuple[int, int]
_LEAST_RATE = 1e-9  # 1/s: of a contact without damping


class SoleContacts(NamedTuple):
    """How a robot's soles touch the floor where it stands."""

    friction: float
    """Sliding friction, the least of them."""
    contact_s: float
    """Time constant, the largest of them [s]."""


def add_floor(spec: Any, path: Path) -> None:
    """Add a floor that leaves contacts to the robot's geoms.

    Args:
        spec: the `mujoco.MjSpec` of the robot alone; changed in place.
        path: its file, for the pairs of the robot's geoms with the file's own floor.
    """
    floors, pairs = _own_floor(path)
    contype, conaffinity = _bits(spec, floors)
    # All that matters is set: defaults are the file's, for its own geoms. MuJoCo mixes
    # solref and solimp by solmix, and takes the larger friction and dimension.
    spec.worldbody.add_geom(
        name=_NAME,
        type=_PLANE,
        size=[0, 0, 0.1],
        contype=contype,
        conaffinity=conaffinity,
        condim=3,
        friction=[0.0, 0.0, 0.0],
        priority=0,
        solmix=0.0,
        margin=0.0,
        gap=0.0,
    )
    known = {geom.name for geom in spec.geoms}
    for name, numbers in pairs.items():
        if name in known:
            spec.add_pair(geomname1=name, geomname2=_NAME, **numbers)


def _bits(spec: Any, floors: list[_Bits]) -> _Bits:
    """Return contype and conaffinity of a floor that the robot touches.

    They are those of the file's own floor, if the robot touches it.
    """
    for kinds, affine in (*floors, (_ORDINARY, _ORDINARY)):
        if any(g.contype & affine | g.conaffinity & kinds for g in spec.geoms):
            return kinds, affine
    return _ALL, _ALL


def _own_floor(path: Path) -> tuple[list[_Bits], dict[str, dict[str, Any]]]:
    """Return contype and conaffinity of a file's planes, and its pairs with them."""
    if not is_mjcf(path):  # a URDF has none
        return [], {}
    spec = mujoco.MjSpec.from_file(str(path))
    planes = [geom for geom in spec.worldbody.geoms if geom.type == _PLANE]
    floors, found = {geom.name for geom in planes}, {}
    for pair in spec.pairs:
        ends = {pair.geomname1, pair.geomname2}
        if len(ends - floors) == 1 and ends & floors:
            (name,) = ends - floors
            found[name] = {n: np.array(getattr(pair, n)).tolist() for n in _OF_PAIR}
    return [(plane.contype, plane.conaffinity) for plane in planes], found


def sole_contacts(backend: ModelBackend) -> SoleContacts:
    """Return how the soles of a robot touch the floor, which it sinks into for this."""
    model, data, soles = backend.model, backend.data, backend.touching
    data.qpos[backend.in_model.free + 2] -= SOLE_DEPTH_M
    mujoco.mj_forward(model, data)
    geoms = data.contact.geom
    floored = (model.geom_type[geoms] == _PLANE).any(axis=1)
    of_soles = floored & np.isin(geoms, soles).any(axis=1)
    return SoleContacts(
        friction=float(data.contact.friction[of_soles, 0].min()),
        contact_s=max(_seconds(model, s) for s in data.contact.solref[of_soles]),
    )


def _seconds(model: Any, solref: Any) -> float:
    """Return the time constant with which MuJoCo solves a contact [s]."""
    first, second = map(float, solref)
    if first <= 0.0:  # stiffness and damping themselves, which are below 0
        return 2.0 / max(-second, _LEAST_RATE)
    unsafe = int(model.opt.disableflags) & _NO_SAFETY
    return first if unsafe else max(first, 2.0 * float(model.opt.timestep))
