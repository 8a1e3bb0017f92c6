"""The plane that a foot rests on, the outline in it, and the rectangle for control.

A sole is the plane facing down that most of the foot would rest on, and the convex
hull of the points near it.
"""

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from gaitchain.discover.findings import Array
from gaitchain.discover.shapes import Shape

_BAND = 0.01  # of the foot's length: what is this close to the lowest plane touches
_CURVED_BAND = 0.03  # the same for a mesh without any flat part
_FLAT_SHARE = 0.4  # of the footprint: less of it flat, and the bottom is curved
_TILT = 0.5  # cosine between a sole's normal and the way down as the foot is held
_FACETS = 60  # candidate planes that are looked at
_AS_DRAWN = 0.8  # of the best plane's area: the drawn one is meant
_SAME_AREA = 0.97  # planes with this share of the best one's area are its equals
_MESH = int(mujoco.mjtGeom.mjGEOM_MESH)


@dataclass(frozen=True, eq=False)
class Plane:
    """A plane that a foot rests on, and what of the foot touches it."""

    normal: Array
    """(3,) up, in the foot's frame."""
    height: float
    """Of the plane along `normal`, from the foot's origin [m]."""
    points: Array
    """(N, 3) touching points, foot's frame [m]."""
    curved: bool
    """Whether nothing is flat, so that a thicker band counts as touching."""


def resting_plane(shapes: list[Shape], down: Array) -> Plane:
    """Find the plane that a foot rests on.

    Args:
        shapes: the foot's, in its frame.
        down: (3,) way down in it as the foot is held; planes up to 60 deg away count.

    Returns:
        The plane with the largest area of contact; among equals the flattest.
    """
    everything = np.concatenate([s.touching(down) for s in shapes])
    length = float(np.linalg.norm(np.ptp(everything, axis=0)))
    meshes = all(s.kind == _MESH for s in shapes)
    directions = [down, *_facets(everything, down)]
    # Rounded shapes touch elsewhere when tilted: look again from where it got to.
    for near in directions[1:4]:
        again = np.concatenate([s.touching(near) for s in shapes])
        directions += _facets(again, near)[:4]
    # The facets of a mesh are noisy: the plane as drawn counts unless it is wrong.
    if meshes and _area(_plane(shapes, down, _BAND * length, False)) > _AS_DRAWN * max(
        _area(_plane(shapes, d, _BAND * length, False)) for d in directions
    ):
        directions = [down]
    plane = _best_plane(shapes, directions, _BAND * length, curved=False)
    if meshes and _area(plane) < _FLAT_SHARE * _hull_area(everything, down):
        plane = _best_plane(shapes, [down], _CURVED_BAND * length, curved=True)
    return plane


def _facets(points: Array, down: Array) -> list[Array]:
    """Return outward normals of a hull's facets that face down, largest first."""
    try:
        hull = ConvexHull(points)
    except (QhullError, ValueError):  # everything lies in one plane, or in a line
        return []
    sides = points[hull.simplices]
    areas = np.linalg.norm(
        np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0]), axis=1
    )
    normals: NDArray[np.float64] = hull.equations[:, :3]
    kept: dict[tuple[float, ...], tuple[float, Array]] = {}
    for normal, area in zip(normals, areas, strict=True):
        if normal @ down > _TILT:
            key = tuple(np.round(normal / 0.02))
            total, largest = kept.get(key, (0.0, normal))
            kept[key] = (total + area, largest)
    ordered = sorted(kept.values(), key=lambda entry: -entry[0])
    return [normal for _, normal in ordered[:_FACETS]]


def _best_plane(
    shapes: list[Shape], directions: list[Array], band: float, *, curved: bool
) -> Plane:
    planes = [_plane(shapes, down, band, curved) for down in directions]
    areas = np.array([_area(p) for p in planes])
    equals = [
        p for p, a in zip(planes, areas, strict=True) if a >= _SAME_AREA * areas.max()
    ]
    return min(equals, key=lambda p: float(np.ptp(p.points @ p.normal)) // 1e-5)


def _plane(shapes: list[Shape], down: Array, band: float, curved: bool) -> Plane:
    points = np.concatenate([s.touching(down) for s in shapes])
    depth = points @ down
    near = points[depth >= depth.max() - band]
    return Plane(-down, -float(depth.max()), near, curved)


def _area(plane: Plane) -> float:
    return _hull_area(plane.points, plane.normal)


def _hull_area(points: Array, normal: Array) -> float:
    across = np.linalg.svd(normal[None])[2][1:]
    try:
        return float(ConvexHull(points @ across.T).volume)
    except (QhullError, ValueError):
        return 0.0
