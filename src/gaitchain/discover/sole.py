"""The sole of a foot: the plane that it rests on, its outline, frame and rectangle.

A sole is the plane facing down that most of the foot would rest on, and the convex
hull of the points near it; control uses the largest rectangle in that outline.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from gaitchain.discover.findings import FoundSole, UnfitError
from gaitchain.discover.legs import LegParts
from gaitchain.discover.limbs import DOWN
from gaitchain.discover.pinned_robot import PinnedRobot
from gaitchain.discover.profile import Profile
from gaitchain.discover.shapes import MESH, VISUAL, Shape, ground_geoms, shapes_of
from gaitchain.messages import Array

_LEAST_LENGTH, _LEAST_WIDTH = 0.08, 0.03  # of a sole, of the leg
_NOTHING = "no shapes"
_BAND = 0.01  # of the foot's length: what is this close to the lowest plane touches
_CURVED_BAND = 0.03  # the same for a mesh without any flat part
_FLAT_SHARE = 0.4  # of the footprint: less of it flat, and the bottom is curved
_TILT = 0.5  # cosine between a sole's normal and the way down as the foot is held
_FACETS = 60  # candidate planes that are looked at
_AS_DRAWN = 0.8  # of the best plane's area: the drawn one is meant
_SAME_AREA = 0.97  # planes with this share of the best one's area are its equals
_WIDTH_COUNTS = 1.5  # power of a rectangle's width against its length
_SLANTED = 1.1  # a rectangle with this much more area is turned on purpose
_SLANT_MOST = np.radians(25.0)
_GRID = 81  # edges tried on each side of the inscribed rectangle
_SQUARE = 1e-3  # of a sole's length: corners less far apart along it make a square edge


@dataclass(frozen=True, eq=False)
class _Plane:
    """A plane that a foot rests on, and what of the foot touches it."""

    normal: Array
    """(3,) up, in the foot's frame."""
    height: float
    """Distance of the plane along `normal` from the foot's origin [m]."""
    points: Array
    """(N, 3) touching points, foot's frame [m]."""
    curved: bool
    """Whether nothing is flat, so that a thicker band counts as touching."""


def sole_of(
    robot: PinnedRobot, leg: LegParts, ankle: Array, length: float, answers: Profile
) -> tuple[FoundSole, str]:
    """Find the flat outline under a foot and the rectangle in it.

    Args:
        robot: as it stands.
        leg: whose foot it is.
        ankle: (3,) ankle point, foot's frame [m].
        length: of the leg [m].
        answers: of the profile, which go before what is found.

    Returns:
        The sole, whatever its size (see `check_sole`), and in words what it came from.
    """
    given, name = answers.sole, robot.model.body(leg.foot).name or f"body {leg.foot}"
    plane, geoms, why = _ground_plane(robot, leg, ankle, answers)
    frame = _sole_frame(plane, robot.turn(leg.foot).T[:, 0])
    height = ankle @ plane.normal - given["below"] if "below" in given else plane.height
    point = ankle + (height - ankle @ plane.normal) * plane.normal
    outline = outline_of((plane.points - point) @ frame[:, :2])
    rear, front, right, left = _inscribed_rectangle(outline, 0.0)
    middle, half = 0.5 * (left + right), 0.5 * (left - right)
    area = _LEAST_LENGTH * _LEAST_WIDTH * length**2
    tapers = 2.0 * half < _LEAST_WIDTH * length and _area_of(outline) > area
    if tapers:
        # As of a point for a heel: as wide as the outline is on average.
        rear, front = float(outline[:, 0].min()), float(outline[:, 0].max())
        half = 0.5 * _area_of(outline) / (front - rear)
        why += "; it tapers, so the rectangle of equal area counts"
    if given.keys() & {"front", "rear", "half_width"}:
        rear, front = given.get("rear", rear), given.get("front", front)
        half = given.get("half_width", half)
        outline = np.array([[rear, -half], [front, -half], [front, half], [rear, half]])
        outline[:, 1] += middle
        tapers = False
    if given and geoms:  # else all of it is the profile's, or it has to be
        why += ", and the profile"
    return FoundSole(
        body=name,
        origin=point + middle * frame[:, 1],
        rotation=frame,
        outline=outline - [0.0, middle],
        front=front,
        rear=rear,
        half_width=half,
        tapers=tapers,
        geoms=tuple(geoms),
    ), why


def _ground_plane(
    robot: PinnedRobot, leg: LegParts, ankle: Array, answers: Profile
) -> tuple[_Plane, list[int], str]:
    """Return the plane under a foot, the geoms it comes from, and that in words."""
    down = robot.turn(leg.foot).T @ DOWN
    if answers.sole.keys() >= {"front", "rear", "half_width", "below"}:
        below = ankle + answers.sole["below"] * down
        height = float(-below @ down)
        return _Plane(-down, height, below[None], False), [], "the profile"
    geoms, kind = ground_geoms(robot.model, set(leg.soles))
    why = f"{len(geoms)} {kind} of {robot.model.body(leg.foot).name}"
    if kind == VISUAL:
        why += ", as none of it collides"
    shapes = shapes_of(robot.model, robot.data, geoms, leg.foot)
    if not shapes:
        return _Plane(-down, float(-ankle @ down), ankle[None], False), [], _NOTHING
    plane = _resting_plane(shapes, down)
    if plane.curved:
        why += "; its bottom is curved: what is near its lowest plane counts"
    return plane, geoms, why


def _sole_frame(plane: _Plane, forward: Array) -> Array:
    """Return ahead, left and up of a sole as columns, (3, 3)."""
    ahead = forward - (forward @ plane.normal) * plane.normal
    ahead /= np.linalg.norm(ahead)
    left = np.cross(plane.normal, ahead)
    turn = _slant(outline_of(plane.points @ np.stack([ahead, left], axis=1)))
    ahead = np.cos(turn) * ahead + np.sin(turn) * left
    return np.stack([ahead, np.cross(plane.normal, ahead), plane.normal], axis=1)


def check_sole(sole: FoundSole, why: str, leg: float, toes: bool) -> None:
    """Refuse a sole without area or beyond its leg, or one not under its ankle."""
    long, wide = _LEAST_LENGTH * leg, _LEAST_WIDTH * leg
    size = sole.front - sole.rear, 2.0 * sole.half_width
    keys = "sole.front, sole.rear, sole.half_width and sole.below"
    past_toes = f"legs.left and legs.right where {sole.body} is toes" if toes else None
    if why == _NOTHING:
        raise UnfitError(
            f"foot {sole.body} has no shape that could be read; put its meshes where "
            "the file says, convert those in other formats, such as .wrl, to .stl or "
            ".obj, or say where its sole is",
            keys,
        )
    if max(size) > leg:
        raise UnfitError(
            f"the sole of {sole.body} is {size[0]:.3g} m long and {size[1]:.3g} m "
            f"wide, from {why}; its leg has {leg:.3g} m: if the foot's mesh is in mm, "
            'give it scale="0.001 0.001 0.001"',
            keys,
        )
    if size[0] < long or size[1] < wide:
        raise UnfitError(
            f"foot {sole.body} has no flat sole: {size[0]:.3f} m long, {size[1]:.3f} m "
            f"wide, from {why}; walking needs at least about {long:.3f} m by "
            f"{wide:.3f} m",
            keys,
            "up if z is not up" + (f", or {past_toes}" if past_toes else ""),
        )
    if not sole.rear < 0.0 < sole.front:
        raise UnfitError(
            f"the sole of {sole.body} reaches from {sole.rear:.3f} to {sole.front:.3f} "
            "m ahead of the ankle; the ankle must be above the sole",
            "sole.front and sole.rear",
            past_toes,
        )


def _resting_plane(shapes: list[Shape], down: Array) -> _Plane:
    """Find the plane with the largest area of contact; among equals the flattest.

    Shapes and the way down, (3,) as the foot is held, are in the foot's frame. Planes
    up to 60 deg away from it count.
    """
    everything = np.concatenate([s.touching(down) for s in shapes])
    length = float(np.linalg.norm(np.ptp(everything, axis=0)))
    meshes = all(s.kind == MESH for s in shapes)
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
        hull = scipy.spatial.ConvexHull(points)
    except (scipy.spatial.QhullError, ValueError):  # all in one plane or line
        return []
    sides = points[hull.simplices]
    areas = np.linalg.norm(
        np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0]), axis=1
    )
    normals: Array = hull.equations[:, :3]
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
) -> _Plane:
    planes = [_plane(shapes, down, band, curved) for down in directions]
    areas = np.array([_area(p) for p in planes])
    equals = [
        p for p, a in zip(planes, areas, strict=True) if a >= _SAME_AREA * areas.max()
    ]
    return min(equals, key=lambda p: float(np.ptp(p.points @ p.normal)) // 1e-5)


def _plane(shapes: list[Shape], down: Array, band: float, curved: bool) -> _Plane:
    points = np.concatenate([s.touching(down) for s in shapes])
    depth = points @ down
    near = points[depth >= depth.max() - band]
    return _Plane(-down, -float(depth.max()), near, curved)


def _area(plane: _Plane) -> float:
    return _hull_area(plane.points, plane.normal)


def _hull_area(points: Array, normal: Array) -> float:
    across = np.linalg.svd(normal[None])[2][1:]
    try:
        return float(scipy.spatial.ConvexHull(points @ across.T).volume)
    except (scipy.spatial.QhullError, ValueError):
        return 0.0


def outline_of(points: Array) -> Array:
    """Return the convex outline of points in a plane.

    Args:
        points: (N, 2) [m].

    Returns:
        (K, 2) counter-clockwise; empty where the points span no area.
    """
    try:
        hull = scipy.spatial.ConvexHull(points)
    except (scipy.spatial.QhullError, ValueError):  # on one line, or fewer than three
        return np.empty((0, 2))
    return np.asarray(points[hull.vertices])


def corners_of(outline: Array, most: int = 6) -> Array:
    """Return the corners of an outline that make up nearly all of its area.

    Args:
        outline: (K, 2) convex polygon [m].
        most: number of corners that are left.

    Returns:
        (most, 2) or fewer, in the same order.
    """
    left = outline
    while len(left) > most:
        before, after = (
            np.roll(left, 1, axis=0) - left,
            np.roll(left, -1, axis=0) - left,
        )
        lost = np.abs(before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0])
        left = np.delete(left, int(np.argmin(lost)), axis=0)
    return left


def _inscribed_rectangle(outline: Array, x: float) -> tuple[float, float, float, float]:
    """Find the largest rectangle along the axes within an outline, (K, 2) [m].

    It holds the ankle at `x` if the outline does. Rear and front edge, right and left
    edge [m]; zeros for no outline.
    """
    if not len(outline):
        return 0.0, 0.0, 0.0, 0.0
    low, high = outline[:, 0].min(), outline[:, 0].max()
    split = min(max(x, low + 1e-3 * (high - low)), high - 1e-3 * (high - low))
    # Of an edge that is square but for rounding both corners are ends, or a step of the
    # grid would be lost.
    xs, near = outline[:, 0], _SQUARE * (high - low)
    rears = np.union1d(np.linspace(low, split, _GRID)[:-1], xs[xs < low + near])
    fronts = np.union1d(np.linspace(split, high, _GRID)[1:], xs[xs > high - near])
    below = [_edges(outline, xs, np.min) for xs in (rears, fronts)]
    above = [_edges(outline, xs, np.max) for xs in (rears, fronts)]
    rights = np.maximum(below[0][:, None], below[1][None])
    lefts = np.minimum(above[0][:, None], above[1][None])
    widths = np.maximum(lefts - rights, 0.0)
    # A robot has less room to spare sideways than ahead.
    area = widths**_WIDTH_COUNTS * (fronts[None] - rears[:, None])
    i, j = np.unravel_index(int(np.argmax(area)), area.shape)
    return float(rears[i]), float(fronts[j]), float(rights[i, j]), float(lefts[i, j])


def _area_of(outline: Array) -> float:
    """Return the area of an outline, (K, 2) counter-clockwise [m^2]."""
    x, y = outline.T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


def _slant(outline: Array) -> float:
    """Return how far a sole, (K, 2) [m], is turned to the left by its edges [rad].

    0 where edges along the axes fit as well.
    """
    if not len(outline):
        return 0.0
    edges = np.roll(outline, -1, axis=0) - outline
    turns = np.arctan2(edges[:, 1], edges[:, 0])
    turns = (turns + 0.25 * np.pi) % (0.5 * np.pi) - 0.25 * np.pi
    best, most = 0.0, _SLANTED * _rectangle_area(outline)
    for turn in turns[np.abs(turns) < _SLANT_MOST]:
        cos, sin = np.cos(turn), np.sin(turn)
        area = _rectangle_area(outline @ np.array([[cos, -sin], [sin, cos]]))
        if area > most + 1e-12:
            best, most = float(turn), area
    return best


def _rectangle_area(outline: Array) -> float:
    rear, front, right, left = _inscribed_rectangle(
        outline, float(outline[:, 0].mean())
    )
    return (front - rear) * (left - right)


def _edges(outline: Array, xs: Array, pick: Any) -> Array:
    """Return the lowest or highest y of a convex outline at each x."""
    found = np.full(len(xs), np.nan)
    for i, x in enumerate(xs):
        ys = []
        for a, b in zip(outline, np.roll(outline, -1, axis=0), strict=True):
            if min(a[0], b[0]) <= x <= max(a[0], b[0]):
                run = b[0] - a[0]
                share = (x - a[0]) / run if abs(run) > 1e-12 else 0.0
                ys += [a[1] + share * (b[1] - a[1])]
                if abs(run) <= 1e-12:
                    ys += [b[1]]
        found[i] = pick(ys)
    return found
