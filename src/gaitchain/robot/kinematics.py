"""Forward kinematics of the reduced biped; the joint order is defined here.

The pose of the reduced biped is `q`, seven angles [rad], batch first, last axis 7.
Sagittal angles are leans from the vertical, positive when the upper end of the link
leans forward (+x). Sway angles are leans of the leg planes, positive towards the
support side. The paper's q1..q5 are the sagittal angles, q6 and q7 the sways.

All points are given in the support-foot frame (origin under the support ankle on the
ground, x forward, y left, z up) with the *left* leg as support. `exchange_roles` makes
the pose of the next step, whose frame is mirrored in y.
"""

import numpy as np

from gaitchain.messages import Array
from gaitchain.robot.reduced_biped import ReducedBiped

JOINTS = (
    "support_crus",
    "support_femur",
    "trunk",
    "swing_femur",
    "swing_crus",
    "support_sway",
    "swing_sway",
)
SUPPORT_CRUS, SUPPORT_FEMUR, TRUNK, SWING_FEMUR, SWING_CRUS = range(5)
SUPPORT_SWAY, SWING_SWAY = 5, 6

LINKS = (
    "support_foot",
    "support_crus",
    "support_femur",
    "trunk",
    "swing_femur",
    "swing_crus",
    "swing_foot",
)
POINTS = (
    "support_ankle",
    "support_knee",
    "support_hip",
    "trunk_top",
    "swing_hip",
    "swing_knee",
    "swing_ankle",
)

# Sway angle that tilts each of the five leaning links; the trunk has none.
_SWAY_OF_LINK = (SUPPORT_SWAY, SUPPORT_SWAY, None, SWING_SWAY, SWING_SWAY)


def exchange_roles(q: Array) -> Array:
    """Exchange support and swing leg: kp_4 of one step becomes kp_1 of the next.

    Works on angles, velocities and accelerations alike.

    Args:
        q: (..., 7) pose [rad].

    Returns:
        (..., 7) the same body pose, seen from the other foot.
    """
    swapped = q[..., [4, 3, 2, 1, 0, 6, 5]]
    return np.concatenate([swapped[..., :5], -swapped[..., 5:]], axis=-1)


def lean_vectors(q: Array) -> Array:
    """Return the unit vectors from lower to upper end of the five links.

    u = (sin q, cos q sin theta, cos q cos theta), rows 1 and 2 of
    `docs/paper_map.md`: q is the lean from the vertical in the leg's plane, theta the
    plane's tilt.

    Args:
        q: (..., 7) pose [rad].

    Returns:
        (..., 5, 3) unit vectors.
    """
    sway = sway_of_links(q)
    lean = q[..., :5]
    cos = np.cos(lean)
    return np.stack([np.sin(lean), cos * np.sin(sway), cos * np.cos(sway)], axis=-1)


def lean_accelerations(q: Array, dq: Array, ddq: Array) -> Array:
    """Return the second time derivatives of `lean_vectors`.

    Args:
        q: (..., 7) pose [rad].
        dq: (..., 7) velocity [rad/s].
        ddq: (..., 7) acceleration [rad/s^2].

    Returns:
        (..., 5, 3) accelerations of the unit vectors [1/s^2].
    """
    lean, v, a = q[..., :5], dq[..., :5], ddq[..., :5]
    sway, w, b = sway_of_links(q), sway_of_links(dq), sway_of_links(ddq)
    sin, cos = np.sin(lean), np.cos(lean)
    sin_t, cos_t = np.sin(sway), np.cos(sway)
    # Acceleration of cos(lean), and the coupling of both rotations.
    cos_acc = -sin * a - cos * v**2
    coupling = -2.0 * sin * v * w
    return np.stack(
        [
            cos * a - sin * v**2,
            cos_acc * sin_t + coupling * cos_t + cos * (cos_t * b - sin_t * w**2),
            cos_acc * cos_t - coupling * sin_t - cos * (sin_t * b + cos_t * w**2),
        ],
        axis=-1,
    )


def sway_of_links(q: Array) -> Array:
    """Return the sway angle (or its rate) of each of the five leaning links.

    Args:
        q: (..., 7) pose or its derivative.

    Returns:
        (..., 5) sway per link; 0 for the trunk, which stays upright sideways.
    """
    zero = np.zeros_like(q[..., 0])
    return np.stack([zero if i is None else q[..., i] for i in _SWAY_OF_LINK], axis=-1)


def points(biped: ReducedBiped, q: Array) -> Array:
    """Return the named `POINTS` of the skeleton.

    Args:
        biped: the robot.
        q: (..., 7) pose [rad].

    Returns:
        (..., 7, 3) positions in the support-foot frame [m].
    """
    return _linear_map(*_point_map(biped), lean_vectors(q))


def link_coms(biped: ReducedBiped, q: Array) -> Array:
    """Return the centres of mass of the `LINKS`.

    Args:
        biped: the robot.
        q: (..., 7) pose [rad].

    Returns:
        (..., 7, 3) positions in the support-foot frame [m].
    """
    return _linear_map(*_com_map(biped), lean_vectors(q))


def link_com_accelerations(
    biped: ReducedBiped, q: Array, dq: Array, ddq: Array
) -> Array:
    """Return the accelerations of the centres of mass of the `LINKS`.

    Args:
        biped: the robot.
        q: (..., 7) pose [rad].
        dq: (..., 7) velocity [rad/s].
        ddq: (..., 7) acceleration [rad/s^2].

    Returns:
        (..., 7, 3) accelerations [m/s^2].
    """
    weights, offsets = _com_map(biped)
    return _linear_map(weights, 0.0 * offsets, lean_accelerations(q, dq, ddq))


def com(biped: ReducedBiped, q: Array) -> Array:
    """Return the centre of mass of the whole robot.

    Args:
        biped: the robot.
        q: (..., 7) pose [rad].

    Returns:
        (..., 3) position in the support-foot frame [m].
    """
    masses = link_masses(biped)
    weights = masses / masses.sum()
    return np.asarray(np.einsum("l,...lx->...x", weights, link_coms(biped, q)))


def link_masses(biped: ReducedBiped) -> Array:
    """Return the masses of the `LINKS`, (7,) [kg]."""
    leg = [biped.foot_mass, biped.crus_mass, biped.femur_mass]
    return np.array([*leg, biped.trunk_mass, *leg[::-1]])


def link_inertias(biped: ReducedBiped) -> Array:
    """Return the principal inertias of the `LINKS` about their centres.

    I = m/12 (b^2 + c^2, a^2 + c^2, a^2 + b^2) for a uniform box of sides a, b, c.

    Args:
        biped: the robot.

    Returns:
        (7, 3) inertias about the link's own x, y, z [kg m^2].
    """
    sides = link_boxes(biped)
    squares = sides**2
    others = squares.sum(axis=1, keepdims=True) - squares
    return np.asarray(link_masses(biped)[:, None] / 12.0 * others)


def link_boxes(biped: ReducedBiped) -> Array:
    """Return the side lengths of the boxes that model the `LINKS`, (7, 3) [m]."""
    thick = biped.leg_thickness
    foot = [biped.sole_length, biped.sole_width, biped.ankle_height]
    crus = [thick, thick, biped.crus_length]
    femur = [thick, thick, biped.femur_length]
    trunk = [biped.trunk_depth, biped.trunk_width, biped.trunk_length]
    return np.array([foot, crus, femur, trunk, femur, crus, foot])


def _linear_map(weights: Array, offsets: Array, vectors: Array) -> Array:
    # tensordot computes the whole batch as one matrix product.
    summed = np.tensordot(vectors, weights, axes=(-2, 1))
    return np.asarray(np.swapaxes(summed, -1, -2) + offsets)


def _chain_map(biped: ReducedBiped) -> tuple[Array, Array]:
    """Return the weights of the link vectors in hip, swing hip and ankle positions."""
    crus, femur = biped.crus_length, biped.femur_length
    weights = np.zeros((7, 5))
    weights[1:, SUPPORT_CRUS] = crus
    weights[2:, SUPPORT_FEMUR] = femur
    weights[5:, SWING_FEMUR] = -femur
    weights[6:, SWING_CRUS] = -crus
    offsets = np.zeros((7, 3))
    offsets[:, 2] = biped.ankle_height
    offsets[4:, 1] = -biped.hip_width
    return weights, offsets


def _point_map(biped: ReducedBiped) -> tuple[Array, Array]:
    weights, offsets = _chain_map(biped)
    weights[3, TRUNK] = biped.trunk_length
    offsets[3, 1] = -0.5 * biped.hip_width
    return weights, offsets


def _com_map(biped: ReducedBiped) -> tuple[Array, Array]:
    """Return the map to link CoMs, the midpoints between neighbouring points."""
    ends, origin = _chain_map(biped)
    weights, offsets = np.zeros((7, 5)), np.zeros((7, 3))
    for link, low in ((1, 0), (2, 1), (4, 4), (5, 5)):
        weights[link] = 0.5 * (ends[low] + ends[low + 1])
        offsets[link] = origin[link]
    weights[3] = ends[2]
    weights[3, TRUNK] = 0.5 * biped.trunk_length
    offsets[3] = [0.0, -0.5 * biped.hip_width, biped.ankle_height]
    foot = np.array([biped.sole_offset, 0.0, -0.5 * biped.ankle_height])
    offsets[0] = origin[0] + foot
    weights[6], offsets[6] = ends[6], origin[6] + foot
    return weights, offsets
