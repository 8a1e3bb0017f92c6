"""A robot's geoms as contact with a plane sees them.

Each shape contributes the points with which it would touch a plane: a sphere one, a
capsule two, a box or a mesh its corners, a cylinder its rim.
"""

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
import scipy

from gaitchain.messages import Array

_RIM = 32  # points on a cylinder's rim
_BOX = int(mujoco.mjtGeom.mjGEOM_BOX)
_CAPSULE = int(mujoco.mjtGeom.mjGEOM_CAPSULE)
_CYLINDER = int(mujoco.mjtGeom.mjGEOM_CYLINDER)
_ELLIPSOID = int(mujoco.mjtGeom.mjGEOM_ELLIPSOID)
MESH = int(mujoco.mjtGeom.mjGEOM_MESH)
_SPHERE = int(mujoco.mjtGeom.mjGEOM_SPHERE)
VISUAL = "visual geoms"
"""What messages call geoms of a body of which none collides."""
_SOLID = (_SPHERE, _CAPSULE, _ELLIPSOID, _CYLINDER, _BOX, MESH)


@dataclass(frozen=True, eq=False)
class Shape:
    """A geom as contact sees it: place, kind, sizes and, of a mesh, its corners."""

    kind: int
    size: Array
    centre: Array
    turn: Array
    """(3, 3) rotation into the frame of `centre`."""
    corners: Array
    """(N, 3) corners of a box, rim or mesh, in the shape's own frame."""

    def touching(self, down: Array) -> Array:
        """Return the points that may touch a plane below.

        Args:
            down: (3,) unit vector towards the plane.

        Returns:
            (N, 3) points in the frame of `centre`.
        """
        local = self.turn.T @ down
        if self.kind == _SPHERE:
            points = self.size[0] * local[None]
        elif self.kind == _CAPSULE:
            ends = np.array([[0.0, 0.0, -self.size[1]], [0.0, 0.0, self.size[1]]])
            points = ends + self.size[0] * local
        elif self.kind == _ELLIPSOID:
            scaled = self.size * local
            points = (self.size * scaled / np.linalg.norm(scaled))[None]
        elif self.kind == _CYLINDER and abs(local[2]) < 0.1:
            side = local[:2] / np.hypot(*local[:2]) * self.size[0]
            points = np.array([[*side, -self.size[1]], [*side, self.size[1]]])
        else:
            points = self.corners
        return np.asarray(self.centre + points @ self.turn.T)


def ground_geoms(model: Any, bodies: set[int]) -> tuple[list[int], str]:
    """Select the geoms with which bodies would touch the ground.

    Args:
        model: the compiled robot.
        bodies: ids of the bodies.

    Returns:
        Their ids, and in words what they are: "collision geoms", "contact pairs" or,
        where nothing collides, "visual geoms".
    """
    own = [
        g
        for g in range(model.ngeom)
        if model.geom_bodyid[g] in bodies and model.geom_type[g] in _SOLID
    ]
    masks = model.geom_contype | model.geom_conaffinity
    pairs = np.stack([model.pair_geom1, model.pair_geom2], axis=1).reshape(-1, 2)
    with_ground = pairs[(model.geom_bodyid[pairs] == 0).any(axis=1)]
    paired = set((with_ground if len(with_ground) else pairs).ravel().tolist())
    explicit = [g for g in own if g in paired]
    colliding = [g for g in own if masks[g] or g in explicit]
    if colliding:
        return colliding, "contact pairs" if explicit else "collision geoms"
    # Simple shapes that do not collide are meant for contact more likely than meshes.
    plain = [g for g in own if model.geom_type[g] != MESH]
    return plain or own, VISUAL


def shapes_of(model: Any, data: Any, geoms: list[int], frame: int) -> list[Shape]:
    """Collect geoms as shapes in a body's frame.

    Args:
        model: the compiled robot.
        data: the robot in a pose.
        geoms: ids of the geoms.
        frame: id of the body; 0 for the world's frame.
    """
    at, turn = data.xpos[frame], data.xmat[frame].reshape(3, 3)
    return [
        Shape(
            kind=int(model.geom_type[g]),
            size=np.array(model.geom_size[g]),
            centre=turn.T @ (data.geom_xpos[g] - at),
            turn=turn.T @ data.geom_xmat[g].reshape(3, 3),
            corners=_corners(model, g),
        )
        for g in geoms
    ]


def lowest(shapes: list[Shape], down: Array) -> float:
    """Return how far down shapes reach, along `down` from their frame's origin [m]."""
    return max(float((s.touching(down) @ down).max()) for s in shapes)


def _corners(model: Any, geom: int) -> Array:
    size, kind = model.geom_size[geom], model.geom_type[geom]
    if kind == _BOX:
        signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, 8).T
        return np.asarray(signs * size)
    if kind == _CYLINDER:
        turn = 2.0 * np.pi * np.arange(_RIM) / _RIM
        rim = np.stack([np.cos(turn), np.sin(turn), np.ones(_RIM)], axis=1)
        rim = np.concatenate([rim, rim * [1, 1, -1]])
        return np.asarray(rim * [size[0], size[0], size[1]])
    if kind != MESH:
        return np.empty((0, 3))
    mesh = model.geom_dataid[geom]
    start, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    corners = np.array(model.mesh_vert[start : start + count], dtype=np.float64)
    try:
        return np.asarray(corners[scipy.spatial.ConvexHull(corners).vertices])
    except scipy.spatial.QhullError:  # a flat mesh is its own hull
        return corners
