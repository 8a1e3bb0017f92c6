"""How a robot looks: the visible geoms of its file, by the link they are on. Ours.

A library holds no meshes: they are read from the file that it was built from, as long
as that is there.
"""

import logging
from typing import Any, NamedTuple

import mujoco
import numpy as np

from gaitchain.discover.findings import Findings
from gaitchain.discover.loaded_robot import load_with_findings
from gaitchain.discover.origin import check_origin
from gaitchain.discover.reduce import RestPose
from gaitchain.errors import GaitchainError, RobotFileError, needed_by
from gaitchain.gait.library import GaitLibrary
from gaitchain.messages import Array
from gaitchain.robot.compare import differences
from gaitchain.robot.robot import Robot
from gaitchain.sim.bodies import SIDES, has_own_body, link_part
from gaitchain.sim.looks import Look, Triangles
from gaitchain.sim.rotation import quaternion

_LOG = logging.getLogger(__name__)
_SHOWN = 2  # the last group of geoms that MuJoCo's own viewer shows
_FACES = 40_000  # triangles of the whole robot; files have ten times as many
_LEAST = 200  # triangles that a mesh keeps
_FINE = 0.004  # of the leg: details that are not drawn
_SOLID = 4  # points and triangles that a mesh has at least
_KINDS = tuple(
    int(getattr(mujoco.mjtGeom, f"mjGEOM_{kind}"))
    for kind in ("SPHERE", "CAPSULE", "ELLIPSOID", "CYLINDER", "BOX", "MESH")
)
_MESH = int(mujoco.mjtGeom.mjGEOM_MESH)
_PLAIN = (0.5, 0.5, 0.5, 1.0)  # MuJoCo's colour of a geom that has none of its own


def find_looks(library: GaitLibrary) -> tuple[Look, ...]:
    """Read how a library's robot looks.

    Args:
        library: built from a file.

    Returns:
        The visible shapes; none if the file is not here any more, or has changed in
        what walking needs, which the log says, or the robot is one of boxes.
    """
    if library.robot.of_boxes:
        return ()
    try:
        model, findings = _load(library)
    except GaitchainError as error:
        _LOG.warning("drawn as its skeleton: %s", error)
        return ()
    return tuple(read_looks(model, findings, library.robot))


def _load(library: GaitLibrary) -> tuple[Any, Findings]:
    """Load a library's robot from its file, if that is still the same robot's."""
    config, robot = library.config, library.robot
    check_origin(config.robot)
    loaded = load_with_findings(config.robot, config.profile)
    if loaded.findings is None or differences(loaded.robot, robot.in_file):
        raise RobotFileError(
            f"{config.robot} has changed in what walking needs since the library was "
            "built; build it again, or give the file as it was"
        )
    return loaded.model, loaded.findings


def read_looks(model: Any, findings: Findings, robot: Robot) -> list[Look]:
    """Read the visible geoms of a robot's model, with fewer triangles.

    Args:
        model: the robot alone, compiled.
        findings: what was found in it.
        robot: what it was reduced to.

    Raises:
        MissingExtraError: the package that thins meshes out is not installed.
    """
    rest = RestPose(model, findings)
    carried = _carriers(rest, robot)
    shown = [geom for geom in _visible(model) if model.geom_bodyid[geom] in carried]
    meshes = [g for g in shown if model.geom_type[g] == _MESH]
    faces = sum(int(model.mesh_facenum[model.geom_dataid[g]]) for g in meshes)
    thin = _Thinning(_FACES / max(faces, 1), _FINE * robot.reduced.leg_length)
    return [
        _look(rest, geom, *carried[model.geom_bodyid[geom]], thin) for geom in shown
    ]


class _Thinning(NamedTuple):
    """Reduces meshes to what can be seen of them."""

    part: float
    """Of their triangles that are left."""
    fine_m: float
    """Points that are this near to each other become one [m]."""

    def surface(self, model: Any, geom: int) -> Triangles:
        """Return the mesh of a geom with about a part of its triangles.

        Points are joined first: many files have loose triangles, which could not be
        reduced.
        """
        with needed_by("a robot's own looks"):
            from fast_simplification import simplify  # noqa: PLC0415 - to draw with

        mesh = model.mesh(model.geom_dataid[geom])
        vertices = model.mesh_vert[mesh.vertadr[0] :][: mesh.vertnum[0]]
        faces = model.mesh_face[mesh.faceadr[0] :][: mesh.facenum[0]]
        wanted = max(int(self.part * len(faces)), _LEAST)
        joined = self._joined(vertices, faces)
        if min(map(len, joined)) >= _SOLID:
            vertices, faces = joined
        if len(faces) > wanted:
            vertices, faces = simplify(vertices, faces, target_count=wanted)
        return Triangles(vertices, faces)

    def _joined(self, vertices: Array, faces: Array) -> tuple[Array, Array]:
        cells = np.round(vertices / self.fine_m).astype(np.int64)
        _, first, cell = np.unique(
            cells, axis=0, return_index=True, return_inverse=True
        )
        faces = cell.ravel()[faces]
        flat = (faces == np.roll(faces, 1, axis=1)).any(axis=1)
        return vertices[first], faces[~flat]


def _visible(model: Any) -> list[int]:
    """Return the geoms that MuJoCo's own viewer shows, all if it shows none."""
    kinds = np.isin(model.geom_type, _KINDS) & (_colours(model)[:, 3] > 0.0)
    shown = kinds & (model.geom_group <= _SHOWN)
    return np.flatnonzero(shown if shown.any() else kinds).tolist()


def _colours(model: Any) -> Array:
    """Return the (n, 4) colours of all geoms; of materials, where they have no own."""
    colours = np.array(model.geom_rgba)
    plain = (colours == np.array(_PLAIN, np.float32)).all(axis=1)
    painted = plain & (model.geom_matid >= 0)
    colours[painted] = model.mat_rgba[model.geom_matid[painted]]
    return colours


def _carriers(rest: RestPose, robot: Robot) -> dict[int, tuple[str, Array]]:
    """Return, by body of the file, the simulated body and its place in the pelvis."""
    found = {body: ("trunk", np.zeros(3)) for body in rest.trunk_bodies()}
    for side, leg in enumerate(rest.found.legs):
        centres, name = rest.leg(leg).centres, ""
        for joint, bodies in enumerate(rest.link_bodies(leg)):
            if has_own_body(robot.legs, side, joint):
                name = f"{SIDES[side]}_{link_part(joint)}"
            found |= dict.fromkeys(bodies, (name, centres[joint]))
    return found


def _look(rest: RestPose, geom: int, body: str, at: Array, thin: _Thinning) -> Look:
    model, data = rest.model, rest.data
    turn = quaternion(rest.turn(data.geom_xmat[geom].reshape(3, 3)))
    kind = int(model.geom_type[geom])
    return Look(
        body=body,
        kind=kind,
        size=model.geom_size[geom].tolist(),
        position=(rest.place(data.geom_xpos[geom]) - at).tolist(),
        turn=turn.tolist(),
        colour=_colours(model)[geom].tolist(),
        surface=thin.surface(model, geom) if kind == _MESH else None,
    )
