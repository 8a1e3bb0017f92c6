"""The ZMP: multi-link, of a wrench, desired, interpolated; support polygons, margins.

Positions of a step are in its support-foot frame (see `robot.kinematics`): origin under
the support ankle, x forward, y left, with the left leg as the support leg. `to_world`
leaves it.
"""

import math
from collections.abc import Sequence
from enum import Enum

import numpy as np
from numpy.typing import ArrayLike

from gaitchain.gait.motion import State, Timing
from gaitchain.messages import GRAVITY, Array
from gaitchain.robot.kinematics import (
    link_com_accelerations,
    link_coms,
    link_inertias,
    link_masses,
    sway_of_links,
)
from gaitchain.robot.robot import Robot

LEAST_LOAD = 0.02
"""Part of the weight: a sole with less is off the ground, a robot has no ZMP."""
FEET_ON_GROUND = {"rs": (1,), "rl": (0, 1), "ls": (0,), "lr": (0, 1), "stand": (0, 1)}
"""Feet, 0 for the left one, that are on the ground by plan, by the planned support."""
_ON_EDGE = 1e-13  # a corner this close to an edge lies on it [m]
_DIGITS = 12  # decimals to which equal lengths agree [m]


class Support(Enum):
    """Support regions in the paper's order (Sec. VI-B)."""

    RIGHT_SINGLE = "rs"
    RIGHT_TO_LEFT = "rl"
    LEFT_SINGLE = "ls"
    LEFT_TO_RIGHT = "lr"


def support_at(timing: Timing, time_s: float, left_support: bool) -> Support:
    """Return the support region at a time of a step.

    Args:
        timing: the step's key times.
        time_s: time since the step's start [s].
        left_support: whether the left leg is the support leg of the step.

    Returns:
        Single support before heel contact at T_a + T_b, double support after it.
    """
    single = time_s < timing.rise + timing.fall
    if left_support:
        return Support.LEFT_SINGLE if single else Support.LEFT_TO_RIGHT
    return Support.RIGHT_SINGLE if single else Support.RIGHT_TO_LEFT


def zmp(robot: Robot, state: State) -> Array:
    """Compute the multi-link zero moment point on the ground.

    x = -M_y / F_z and y = M_x / F_z of the wrench that moves the links,
    F = sum m (a + g e_z), M = sum (r x m (a + g e_z) + dH/dt), moments about the
    origin [Vukobratovic04]. Links have their full inertia; they are not point masses.

    Args:
        robot: the robot.
        state: poses, velocities, accelerations, each (..., 7).

    Returns:
        (..., 2) ZMP in the support-foot frame, z = 0 [m].
    """
    mass = link_masses(robot.reduced)[:, None]
    position = link_coms(robot.reduced, state.q)
    acceleration = link_com_accelerations(robot.reduced, *state)
    force = mass * (acceleration + np.array([0.0, 0.0, GRAVITY]))
    moment = np.cross(position, force).sum(axis=-2) + _spin_rate(robot, state)
    total = force.sum(axis=-2)
    return np.stack(
        [-moment[..., 1] / total[..., 2], moment[..., 0] / total[..., 2]], axis=-1
    )


def zmp_of_wrench(torque: Array, force: Array, at: Array) -> Array:
    """Compute the ZMP of the wrench that moves a robot.

    The wrench is moved from a point (x, y, z) to the ground: p_x = x - (M_y + z F_x) /
    F_z and p_y = y + (M_x - z F_y) / F_z.

    Args:
        torque: (..., 3) M about the point [N m].
        force: (..., 3) F [N]; NaN where there is no ZMP.
        at: (..., 3) the point, z above the ground [m].

    Returns:
        (..., 2) ZMP in the frame of these, z = 0 [m].
    """
    x, y, z = np.moveaxis(at, -1, 0)
    ahead = x - (torque[..., 1] + z * force[..., 0]) / force[..., 2]
    left = y + (torque[..., 0] - z * force[..., 1]) / force[..., 2]
    return np.stack([ahead, left], axis=-1)


def desired_zmp(robot: Robot, rear: ArrayLike, ahead: ArrayLike) -> Array:
    """Return the desired ZMP at the four key moments (Eq. 3).

    Ours: midway between both soles in double support (kp_1, kp_4), the centre of the
    support sole in single support (kp_2, kp_3).

    Args:
        robot: the robot.
        rear: (...) swing ankle at kp_1, ahead of the support ankle (so <= 0) [m].
        ahead: (...) swing ankle at kp_4, ahead of the support ankle [m].

    Returns:
        (..., 4, 2) positions in the support-foot frame [m].
    """
    start, end = np.broadcast_arrays(
        np.asarray(rear, dtype=float), np.asarray(ahead, dtype=float)
    )
    result = np.zeros((*start.shape, 4, 2))
    result[..., 0, 0], result[..., 3, 0] = 0.5 * start, 0.5 * end
    result[..., (0, 3), 1] = -0.5 * robot.reduced.hip_width
    result[..., 0] += robot.reduced.sole_offset
    return result


def interpolated_zmp(timing: Timing, key_zmp: Array, time_s: Array) -> Array:
    """Interpolate the ZMP between key moments by the paper's third-order spline.

    p_zmp(t) = I(p_zmp(t_j)), Sec. IV-C: the cubic through the four key moments. It is
    exact for a cart-table only; `docs/paper_map.md` shows its error.

    Args:
        timing: the step's key times.
        key_zmp: (4, 2) ZMP at the key moments [m].
        time_s: (N,) times [s].

    Returns:
        (N, 2) ZMP [m].
    """
    moments = np.asarray(timing.key_times)
    result, product = np.zeros((len(time_s), 2)), np.ones((len(time_s), 1))
    rows = np.asarray(key_zmp, dtype=np.float64)
    for order, moment in enumerate(moments):  # Newton's divided differences
        result += product * rows[0]
        product = product * (time_s[:, None] - moment)
        spans = moments[order + 1 :, None] - moments[: -order - 1, None]
        rows = np.diff(rows, axis=0) / spans
    return result


def to_world(points: Array, feet: Array, left_support: ArrayLike) -> Array:
    """Transform points from the support-foot frame to the world.

    Args:
        points: (..., 2) points, left leg as support [m].
        feet: (..., 3) pose of the support foot in the world: x, y [m], yaw [rad].
        left_support: (...) whether the left leg is the support leg; if not, y is
            mirrored.

    Returns:
        (..., 2) points in the world [m].
    """
    x, y = points[..., 0], np.where(left_support, 1.0, -1.0) * points[..., 1]
    cos, sin = np.cos(feet[..., 2]), np.sin(feet[..., 2])
    turned = np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)
    return np.asarray(feet[..., :2] + turned)


def sole_corners(robot: Robot, ankle_xy: ArrayLike, yaw: float = 0.0) -> Array:
    """Return the corners of a level sole, counter-clockwise.

    Args:
        robot: the robot.
        ankle_xy: (2,) the ankle's projection on the ground [m].
        yaw: heading of the foot [rad].

    Returns:
        (4, 2) corners [m].
    """
    rear, front = robot.reduced.sole_x
    half = 0.5 * robot.reduced.sole_width
    corners = np.array([[rear, -half], [front, -half], [front, half], [rear, half]])
    cos, sin = np.cos(yaw), np.sin(yaw)
    turned = corners @ np.array([[cos, sin], [-sin, cos]])
    return np.asarray(turned + np.asarray(ankle_xy, dtype=np.float64))


def support_polygon(soles: Sequence[Array]) -> Array:
    """Return the convex hull of the soles on the ground.

    Args:
        soles: (4, 2) corners of each sole on the ground [m].

    Returns:
        (K, 2) polygon, counter-clockwise [m].
    """
    corners = np.concatenate(soles)
    # Corners at the same x may differ by rounding errors, which must not affect the
    # order.
    order = np.lexsort((corners[:, 1], np.round(corners[:, 0], _DIGITS)))
    along = corners[order].tolist()
    right, left = _chain(along), _chain(along[::-1])
    return np.array(right[:-1] + left[:-1])


def planned_region(robot: Robot, feet: Array, support: str) -> Array:
    """Return the support region of the feet that are on the ground by plan.

    Args:
        robot: the robot.
        feet: (2, 3) x, y [m] and yaw [rad] of both ankles.
        support: the planned support; one that is not in `FEET_ON_GROUND` has both feet.

    Returns:
        (K, 2) polygon, counter-clockwise [m].
    """
    on_ground = FEET_ON_GROUND.get(support, (0, 1))
    soles = [sole_corners(robot, feet[i][:2], feet[i][2]) for i in on_ground]
    return soles[0] if len(soles) == 1 else support_polygon(soles)


def margin(points_xy: Array, polygon: Array) -> Array:
    """Return the signed distance of points to the edge of a convex polygon.

    Args:
        points_xy: (..., 2) points [m].
        polygon: (K, 2) corners, counter-clockwise [m].

    Returns:
        (...) distance to the nearest edge line, positive inside [m].
    """
    edges = np.roll(polygon, -1, axis=0) - polygon
    normals = np.stack([-edges[:, 1], edges[:, 0]], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    inward = np.einsum("...kx,kx->...k", points_xy[..., None, :] - polygon, normals)
    return np.asarray(inward.min(axis=-1))


def _chain(points: list[list[float]]) -> list[list[float]]:
    """Return the right-hand chain of the convex hull, from the first point to the last.

    Points within a rounding error of an edge are left out, as the direction of an edge
    that short is undefined.
    """
    kept: list[list[float]] = []
    for x, y in points:
        while len(kept) > 1:
            (ax, ay), (bx, by) = kept[-2:]
            left = (bx - ax) * (y - ay) - (by - ay) * (x - ax)
            if left > _ON_EDGE * math.hypot(x - ax, y - ay):
                break
            kept.pop()
        kept.append([x, y])
    return kept


def _spin_rate(robot: Robot, state: State) -> Array:
    """Return the sum of dH/dt of the five links that rotate; the feet stay level.

    A link tilts by its sway about x, then leans about its own y. In the link frame
    dH/dt = I a + w x (I w) with a diagonal I; the result is rotated to the world frame.
    """
    tilt, tilt_v, tilt_a = (-sway_of_links(x) for x in state)
    lean, lean_v, lean_a = (x[..., :5] for x in state)
    sin, cos = np.sin(lean), np.cos(lean)
    omega = np.stack([tilt_v * cos, lean_v, tilt_v * sin], axis=-1)
    alpha = np.stack(
        [
            tilt_a * cos - tilt_v * lean_v * sin,
            lean_a,
            tilt_a * sin + tilt_v * lean_v * cos,
        ],
        axis=-1,
    )
    inertia = link_inertias(robot.reduced)[1:6]
    x, y, z = np.moveaxis(inertia * alpha + np.cross(omega, inertia * omega), -1, 0)
    ahead, up = cos * x + sin * z, cos * z - sin * x
    sin_t, cos_t = np.sin(tilt), np.cos(tilt)
    turned = [ahead, cos_t * y - sin_t * up, sin_t * y + cos_t * up]
    return np.asarray(np.stack(turned, axis=-1).sum(axis=-2))
