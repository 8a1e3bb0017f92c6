"""The sole of a foot: what touches the ground, its frame and its edges."""

import numpy as np

from gaitchain.discover.findings import Array, FoundSole, refusal
from gaitchain.discover.leg_parts import LegParts
from gaitchain.discover.limbs import DOWN
from gaitchain.discover.outline import area_of, inscribed_rectangle, outline_of, slant
from gaitchain.discover.pinned_robot import HeldRobot
from gaitchain.discover.profile import Profile
from gaitchain.discover.shapes import ground_geoms, shapes_of
from gaitchain.discover.sole import Plane, resting_plane

_LEAST_LENGTH, _LEAST_WIDTH = 0.08, 0.03  # of a sole, of the leg
_NOTHING = "no shapes"


def sole_of(
    robot: HeldRobot, leg: LegParts, ankle: Array, length: float, answers: Profile
) -> tuple[FoundSole, str]:
    """Find the flat outline under a foot and the rectangle in it, and say from what."""
    told, name = answers.sole, robot.model.body(leg.foot).name or f"body {leg.foot}"
    plane, geoms, why = _ground_plane(robot, leg, ankle, answers)
    frame = _sole_frame(plane, robot.turn(leg.foot).T[:, 0])
    height = ankle @ plane.normal - told["below"] if "below" in told else plane.height
    point = ankle + (height - ankle @ plane.normal) * plane.normal
    outline = outline_of((plane.points - point) @ frame[:, :2])
    rear, front, right, left = inscribed_rectangle(outline, 0.0)
    middle, half = 0.5 * (left + right), 0.5 * (left - right)
    area = _LEAST_LENGTH * _LEAST_WIDTH * length**2
    if 2.0 * half < _LEAST_WIDTH * length and area_of(outline) > area:
        # As of a point for a heel: as wide as the outline is on average.
        rear, front = float(outline[:, 0].min()), float(outline[:, 0].max())
        half = 0.5 * area_of(outline) / (front - rear)
        why += "; it tapers, so the rectangle of equal area counts"
    if told.keys() & {"front", "rear", "half_width"}:
        rear, front = told.get("rear", rear), told.get("front", front)
        half, why = told.get("half_width", half), f"{why}, and the profile"
        outline = np.array([[rear, -half], [front, -half], [front, half], [rear, half]])
        outline[:, 1] += middle
    return FoundSole(
        body=name,
        origin=point + middle * frame[:, 1],
        rotation=frame,
        outline=outline - [0.0, middle],
        front=front,
        rear=rear,
        half_width=half,
        geoms=tuple(geoms),
    ), why


def _ground_plane(
    robot: HeldRobot, leg: LegParts, ankle: Array, answers: Profile
) -> tuple[Plane, list[int], str]:
    """Return the plane under a foot, the geoms it comes from, and that in words."""
    down = robot.turn(leg.foot).T @ DOWN
    if answers.sole.keys() >= {"front", "rear", "half_width", "below"}:
        below = ankle + answers.sole["below"] * down
        height = float(-below @ down)
        return Plane(-down, height, below[None], False), [], "the profile"
    geoms, kind = ground_geoms(robot.model, set(leg.soles))
    why = f"{len(geoms)} {kind} of {robot.model.body(leg.foot).name}"
    if kind == "visual geoms":
        why += ", as none of it collides"
    shapes = shapes_of(robot.model, robot.data, geoms, leg.foot)
    if not shapes:
        return Plane(-down, float(-ankle @ down), ankle[None], False), [], _NOTHING
    plane = resting_plane(shapes, down)
    if plane.curved:
        why += "; its bottom is curved: what is near its lowest plane counts"
    return plane, geoms, why


def _sole_frame(plane: Plane, forward: Array) -> Array:
    """Return ahead, left and up of a sole as columns, (3, 3)."""
    ahead = forward - (forward @ plane.normal) * plane.normal
    ahead /= np.linalg.norm(ahead)
    left = np.cross(plane.normal, ahead)
    turn = slant(outline_of(plane.points @ np.stack([ahead, left], axis=1)))
    ahead = np.cos(turn) * ahead + np.sin(turn) * left
    return np.stack([ahead, np.cross(plane.normal, ahead), plane.normal], axis=1)


def check_sole(sole: FoundSole, why: str, leg: float, origin: str) -> None:
    """Refuse a sole without area, or one that is not under its ankle."""
    long, wide = _LEAST_LENGTH * leg, _LEAST_WIDTH * leg
    size = sole.front - sole.rear, 2.0 * sole.half_width
    keys = "sole.front, sole.rear, sole.half_width and sole.below"
    if why == _NOTHING:
        raise refusal(
            origin,
            f"foot {sole.body} has no shape that could be read; convert meshes in "
            "other formats, such as .dae, to .stl or .obj, or say where its sole is",
            keys,
        )
    if size[0] < long or size[1] < wide:
        raise refusal(
            origin,
            f"foot {sole.body} has no flat sole: {size[0]:.3f} m long, {size[1]:.3f} m "
            f"wide, from {why}; walking needs at least about {long:.3f} m by "
            f"{wide:.3f} m",
            keys,
        )
    if not sole.rear < 0.0 < sole.front:
        raise refusal(
            origin,
            f"the sole of {sole.body} reaches from {sole.rear:.3f} to {sole.front:.3f} "
            "m ahead of the ankle; the ankle must be above the sole",
            "sole.front and sole.rear",
        )
