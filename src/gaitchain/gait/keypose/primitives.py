"""The action primitives Swing, Lift and Move: apply, compose and factorise.

A pose composed of primitives has five parameters, the paper's Theta (Eq. 1):

==========  =======  ==========================================================
parameter   made by  meaning
==========  =======  ==========================================================
hip_x       Move     hip ahead of the support ankle [m]
hip_height  Move     hip above the support ankle, along the leg's plane [m]
foot_x      Lift     swing ankle ahead of the support ankle, the paper's x6 [m]
foot_z      Lift     swing foot above the ground, the paper's z6 [m]
sway        Swing    lean of both legs to the support side, theta [rad]
==========  =======  ==========================================================
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gaitchain.messages import Array
from gaitchain.robot.kinematics import (
    SUPPORT_CRUS,
    SUPPORT_FEMUR,
    SUPPORT_SWAY,
    SWING_CRUS,
    SWING_FEMUR,
    SWING_SWAY,
)
from gaitchain.robot.robot import Robot
from gaitchain.robot.two_link_leg import leg_leans, leg_rates, leg_span

PARAMETERS = ("hip_x", "hip_height", "foot_x", "foot_z", "sway")


@dataclass(frozen=True)
class Factors:
    """A pose decomposed into primitives, and the residual."""

    parameters: Array
    """(..., 5) the `PARAMETERS`."""
    residual: Array
    """(..., 7) pose minus the pose composed of the parameters [rad]."""


def swing(q: Array, sway: ArrayLike) -> Array:
    """Lean both legs to the designated angle: q~ = {q1, ..., q5, theta, theta}.

    Args:
        q: (..., 7) pose [rad].
        sway: (...) the new sway [rad].

    Returns:
        (..., 7) pose [rad]; q1..q5 unchanged (paper, Sec. III-A 1).
    """
    theta = np.asarray(sway, dtype=float)
    return _with(q, {SUPPORT_SWAY: theta, SWING_SWAY: theta})


def lift(
    robot: Robot,
    q: Array,
    foot_x: ArrayLike,
    foot_z: ArrayLike,
    sway: ArrayLike | None = None,
) -> Array:
    """Move the swing foot to a target; the support leg stays (Sec. III-A 2).

    l1 s1 + l2 s2 - l4 s4 - l5 s5 = x6 and the same with cosines, times cos(theta),
    for z6: the paper's two equations, as interpreted in rows 1 and 2 of
    `docs/paper_map.md`.

    Args:
        robot: the robot.
        q: (..., 7) pose [rad].
        foot_x: (...) swing ankle ahead of the support ankle [m].
        foot_z: (...) swing foot above the ground [m].
        sway: (...) sway at which `foot_z` is reached [rad]; the sway of the pose by
            default. If it is given, Swing commutes with Lift.

    Returns:
        (..., 7) pose with q4, q5 solved, q3 = 0.

    Raises:
        UnreachableError: the target is out of the leg's reach.
    """
    theta = q[..., SUPPORT_SWAY] if sway is None else np.asarray(sway, dtype=float)
    hip_x, hip_height = _hip(robot, q)
    rise = np.asarray(foot_z, dtype=float) / np.cos(theta)
    crus, femur = leg_leans(
        robot.reduced, hip_x - np.asarray(foot_x), hip_height - rise, "Lift"
    )
    zero = np.zeros_like(hip_x)
    return _with(q, {SWING_FEMUR: femur, SWING_CRUS: crus, 2: zero})


def move(robot: Robot, q: Array, hip_x: ArrayLike, hip_height: ArrayLike) -> Array:
    """Move the hip to a target relative to the support foot (Sec. III-A 3).

    Ours: the paper gives the swing leg's angles, and the support leg follows by closure
    (`move_by_swing_leg`); both determine the position of the hip.

    Args:
        robot: the robot.
        q: (..., 7) pose [rad].
        hip_x: (...) hip ahead of the support ankle [m].
        hip_height: (...) hip above the support ankle along the leg's plane [m].

    Returns:
        (..., 7) pose with q1, q2 solved, q3 = 0; the swing leg's angles stay.

    Raises:
        UnreachableError: the target is out of the leg's reach.
    """
    crus, femur = leg_leans(robot.reduced, hip_x, hip_height, "Move")
    return _with(q, {SUPPORT_CRUS: crus, SUPPORT_FEMUR: femur, 2: np.zeros_like(crus)})


def move_by_swing_leg(
    robot: Robot,
    q: Array,
    swing_angles: ArrayLike,
    foot_x: ArrayLike,
    foot_z: ArrayLike = 0.0,
) -> Array:
    """Apply the paper's M(q, q4, q5, x6): the support leg follows by closure.

    Args:
        robot: the robot.
        q: (..., 7) pose [rad]; its sway is that at which `foot_z` is reached.
        swing_angles: (..., 2) q4, q5 [rad].
        foot_x: (...) the paper's x6 [m].
        foot_z: (...) the paper's z6 [m].

    Returns:
        (..., 7) pose with all sagittal angles set, q3 = 0.

    Raises:
        UnreachableError: the closure is out of the support leg's reach.
    """
    femur, crus = np.moveaxis(np.asarray(swing_angles, dtype=float), -1, 0)
    posed = _with(q, {SWING_FEMUR: femur, SWING_CRUS: crus})
    reach_x, reach_z = leg_span(robot.reduced, crus, femur)
    rise = np.asarray(foot_z, dtype=float) / np.cos(posed[..., SUPPORT_SWAY])
    return move(robot, posed, reach_x + np.asarray(foot_x), reach_z + rise)


def compose(robot: Robot, parameters: Array) -> Array:
    """Compose a pose of primitives, S(L(M(q, Theta))) of Eq. 1.

    Args:
        robot: the robot.
        parameters: (..., 5) the `PARAMETERS`.

    Returns:
        (..., 7) pose [rad].

    Raises:
        UnreachableError: a target is out of the leg's reach.
    """
    hip_x, hip_height, foot_x, foot_z, sway = np.moveaxis(parameters, -1, 0)
    pose = np.zeros((*np.shape(hip_x), 7))
    pose = swing(pose, sway)
    return lift(robot, move(robot, pose, hip_x, hip_height), foot_x, foot_z)


def compose_rates(robot: Robot, parameters: Array, rates: Array) -> Array:
    """Compute the joint velocities from the rates of the parameters.

    Ours: the time derivative of Eq. 1, a 2 x 2 linear system for each leg.

    Args:
        robot: the robot.
        parameters: (..., 5) the `PARAMETERS`.
        rates: (..., 5) their time derivatives [per s].

    Returns:
        (..., 7) joint velocities [rad/s].

    Raises:
        UnreachableError: a target is out of the leg's reach, or the velocity of a
            straight leg is undefined.
    """
    q = compose(robot, parameters)
    hip_x, hip_height, foot_x, foot_z, sway = np.moveaxis(rates, -1, 0)
    theta = parameters[..., 4]
    rise = (foot_z + parameters[..., 3] * np.tan(theta) * sway) / np.cos(theta)
    support = leg_rates(robot.reduced, q[..., :2], hip_x, hip_height)
    swing_leg = leg_rates(
        robot.reduced, q[..., 4:2:-1], hip_x - foot_x, hip_height - rise
    )
    trunk = np.zeros_like(sway)
    crus, femur = np.moveaxis(swing_leg, -1, 0)
    return np.stack(
        [support[..., 0], support[..., 1], trunk, femur, crus, sway, sway], axis=-1
    )


def factorise(robot: Robot, q: Array) -> Factors:
    """Decompose a pose into primitives: primitive component analysis.

    Ours: the paper names the analysis without a method (row 18 of `docs/paper_map.md`).
    The parameters are computed from the hip and the swing foot of the pose; the
    residual is the part that they do not determine: trunk lean, unequal sways, knees
    bent the other way.

    Args:
        robot: the robot.
        q: (..., 7) pose [rad].

    Returns:
        The parameters and the residual, which is 0 for poses composed of primitives.

    Raises:
        UnreachableError: a leg is folded further than primitives allow.
    """
    hip_x, hip_height = _hip(robot, q)
    femur, crus = q[..., SWING_FEMUR], q[..., SWING_CRUS]
    swing_x, swing_z = leg_span(robot.reduced, crus, femur)
    sway = 0.5 * (q[..., SUPPORT_SWAY] + q[..., SWING_SWAY])
    foot_z = (hip_height - swing_z) * np.cos(sway)
    parameters = np.stack([hip_x, hip_height, hip_x - swing_x, foot_z, sway], axis=-1)
    return Factors(parameters, q - compose(robot, parameters))


def _hip(robot: Robot, q: Array) -> tuple[Array, Array]:
    return leg_span(robot.reduced, q[..., SUPPORT_CRUS], q[..., SUPPORT_FEMUR])


def _with(q: Array, changes: dict[int, Any]) -> Array:
    """Return a copy of the pose, broadcast to the changes, with these joints set."""
    batch = np.broadcast_shapes(q.shape[:-1], *(np.shape(v) for v in changes.values()))
    result = np.array(np.broadcast_to(q, (*batch, q.shape[-1])), dtype=float)
    for joint, value in changes.items():
        result[..., joint] = value
    return result
