"""Convex outlines in a plane, and the rectangles in them."""

from typing import Any

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from gaitchain.discover.findings import Array

_WIDTH_COUNTS = 1.5  # power of a rectangle's width against its length
_SLANTED = 1.1  # a rectangle with this much more area is turned on purpose
_SLANT_MOST = np.radians(25.0)
_GRID = 81  # edges tried on each side of the inscribed rectangle


def outline_of(points: Array) -> Array:
    """Return the convex outline of points in a plane.

    Args:
        points: (N, 2) [m].

    Returns:
        (K, 2) counter-clockwise; empty where the points span no area.
    """
    try:
        hull = ConvexHull(points)
    except (QhullError, ValueError):  # on one line, or fewer than three
        return np.empty((0, 2))
    return np.asarray(points[hull.vertices])


def inscribed_rectangle(outline: Array, x: float) -> tuple[float, float, float, float]:
    """Find the largest rectangle along the axes within a convex outline.

    Args:
        outline: (K, 2) counter-clockwise [m].
        x: where the ankle is; the rectangle holds it if the outline does.

    Returns:
        Rear and front edge, right and left edge [m]; zeros for no outline.
    """
    if not len(outline):
        return 0.0, 0.0, 0.0, 0.0
    low, high = outline[:, 0].min(), outline[:, 0].max()
    split = min(max(x, low + 1e-3 * (high - low)), high - 1e-3 * (high - low))
    rears = np.linspace(low, split, _GRID)[:-1]
    fronts = np.linspace(split, high, _GRID)[1:]
    below = [_edges(outline, xs, np.min) for xs in (rears, fronts)]
    above = [_edges(outline, xs, np.max) for xs in (rears, fronts)]
    rights = np.maximum(below[0][:, None], below[1][None])
    lefts = np.minimum(above[0][:, None], above[1][None])
    widths = np.maximum(lefts - rights, 0.0)
    # A robot has less room to spare sideways than ahead.
    area = widths**_WIDTH_COUNTS * (fronts[None] - rears[:, None])
    i, j = np.unravel_index(int(np.argmax(area)), area.shape)
    return float(rears[i]), float(fronts[j]), float(rights[i, j]), float(lefts[i, j])


def area_of(outline: Array) -> float:
    """Return the area of an outline, (K, 2) counter-clockwise [m^2]."""
    x, y = outline.T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


def slant(outline: Array) -> float:
    """Return how far a sole is turned to the left, as its own edges tell.

    Args:
        outline: (K, 2) ahead and left, counter-clockwise [m].

    Returns:
        The angle [rad]; 0 where edges along the axes fit as well.
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
    rear, front, right, left = inscribed_rectangle(outline, float(outline[:, 0].mean()))
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
