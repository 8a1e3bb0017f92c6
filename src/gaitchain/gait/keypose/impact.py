"""The landing impact: the jump of the joint velocities at heel contact."""

import numpy as np

from gaitchain.gait.motion import State
from gaitchain.messages import Array
from gaitchain.robot.kinematics import link_coms, link_inertias, link_masses, points
from gaitchain.robot.robot import Robot

_STEP = 1e-6  # of the central differences [rad]
_SWING_ANKLE = 6  # in kinematics.POINTS


def velocity_jump(robot: Robot, state: State) -> Array:
    """Compute the joint velocities just after heel contact minus those before.

    The impact is inelastic and instantaneous (Sec. II-A): with generalised velocity
    u = [support foot, dq], u+ = u- - M^-1 J^T (J M^-1 J^T)^-1 J u-, where J u is the
    swing foot's velocity and u- has the support foot at rest [Grizzle01]. Both feet
    stay level, so only their translation is free. Ours: the paper mentions the impact
    without a model (row 19 of `docs/paper_map.md`).

    Args:
        robot: the robot.
        state: (..., 7) pose and velocity at contact.

    Returns:
        (..., 7) jump of the joint velocities [rad/s].
    """
    foot = np.concatenate(
        [_eyes(state.q), _jacobian(robot, state.q)[..., _SWING_ANKLE, :, :]], axis=-1
    )
    mass = _mass_matrix(robot, state.q)
    velocity = np.concatenate([np.zeros_like(state.dq[..., :3]), state.dq], axis=-1)
    response = np.linalg.solve(mass, np.swapaxes(foot, -1, -2))
    closing = np.einsum("...xu,...u->...x", foot, velocity)
    impulse = np.linalg.solve(foot @ response, closing[..., None])
    return np.asarray(-(response @ impulse)[..., 3:, 0])


def _eyes(q: Array) -> Array:
    return np.broadcast_to(np.eye(3), (*q.shape[:-1], 3, 3))


def _jacobian(robot: Robot, q: Array, of_coms: bool = False) -> Array:
    """Return the Jacobian of the points or the link CoMs, (..., 7 points, 3, 7)."""
    where = link_coms if of_coms else points
    shift = _STEP * np.eye(7)
    ahead, behind = (
        where(robot.reduced, q[..., None, :] + s * shift) for s in (1.0, -1.0)
    )
    return np.moveaxis((ahead - behind) / (2.0 * _STEP), -3, -1)


def _mass_matrix(robot: Robot, q: Array) -> Array:
    """Return the mass matrix of support foot translation and joints, (..., 10, 10)."""
    jacobian = np.concatenate(
        [
            np.broadcast_to(np.eye(3), (*q.shape[:-1], 7, 3, 3)),
            _jacobian(robot, q, of_coms=True),
        ],
        axis=-1,
    )
    mass = np.einsum(
        "l,...lxu,...lxv->...uv", link_masses(robot.reduced), jacobian, jacobian
    )
    return np.asarray(mass + _spin_matrix(robot, q))


def _spin_matrix(robot: Robot, q: Array) -> Array:
    """Return the rotational part of the mass matrix, (..., 10, 10).

    Links rotate by lean about their y axis and by sway about the world's x axis.
    """
    inertia = link_inertias(robot.reduced)[1:6]
    lean = q[..., :5]
    about_x = inertia[:, 0] * np.cos(lean) ** 2 + inertia[:, 2] * np.sin(lean) ** 2
    result = np.zeros((*q.shape[:-1], 10, 10))
    for link in range(5):
        result[..., 3 + link, 3 + link] = inertia[link, 1]
    result[..., 8, 8] = about_x[..., 0] + about_x[..., 1]
    result[..., 9, 9] = about_x[..., 3] + about_x[..., 4]
    return result
