"""Inverse kinematics of the reduced biped's two-link leg: leans and their rates."""

import numpy as np
from numpy.typing import ArrayLike

from gaitchain.errors import UnreachableError
from gaitchain.messages import Array
from gaitchain.robot.reduced_biped import ReducedBiped

# A straight knee is a singular pose, so a target may come this close to it [m].
_STRAIGHT_MARGIN = 1e-9


def leg_leans(
    biped: ReducedBiped, x: ArrayLike, z: ArrayLike, primitive: str
) -> tuple[Array, Array]:
    """Return the leans of crus and femur with the hip at (x, z) from the ankle.

    Uses the law of cosines; of the two solutions, the one with the knee forward.
    """
    x, z = np.broadcast_arrays(np.asarray(x, float), np.asarray(z, float))
    reach = np.hypot(x, z)
    crus, femur = biped.crus_length, biped.femur_length
    _check_reach(reach, abs(crus - femur), crus + femur, primitive)
    bend_crus = np.arccos(_unit((crus**2 + reach**2 - femur**2) / (2 * crus * reach)))
    bend_femur = np.arccos(_unit((femur**2 + reach**2 - crus**2) / (2 * femur * reach)))
    line = np.arctan2(x, z)
    return line + bend_crus, line - bend_femur


def leg_span(biped: ReducedBiped, crus: Array, femur: Array) -> tuple[Array, Array]:
    """Return x and z of the hip from the ankle [m] for these leans [rad]."""
    x = biped.crus_length * np.sin(crus) + biped.femur_length * np.sin(femur)
    z = biped.crus_length * np.cos(crus) + biped.femur_length * np.cos(femur)
    return x, z


def leg_rates(biped: ReducedBiped, leans: Array, dx: Array, dz: Array) -> Array:
    """Return the rates of both leans that move the hip at a velocity.

    Args:
        biped: the robot.
        leans: (..., 2) leans of crus and femur from the vertical [rad].
        dx: (...) velocity of the hip from the ankle, ahead [m/s].
        dz: (...) the same, up [m/s].

    Returns:
        (..., 2) rates of both [rad/s].

    Raises:
        UnreachableError: the leg is straight and the hip is to move.
    """
    crus, femur = biped.crus_length, biped.femur_length
    columns = [crus * np.cos(leans[..., 0]), femur * np.cos(leans[..., 1])]
    rows = [-crus * np.sin(leans[..., 0]), -femur * np.sin(leans[..., 1])]
    determinant = columns[0] * rows[1] - columns[1] * rows[0]
    moving = (dx != 0.0) | (dz != 0.0)
    straight = np.abs(determinant) < _STRAIGHT_MARGIN
    if np.any(straight & moving):
        raise UnreachableError(
            "a straight leg has no speed to give: its knee is a singular pose; bend "
            "it, or ask for rates of 0"
        )
    determinant = np.where(straight, 1.0, determinant)  # at rest: 0 / 1
    return np.stack(
        [
            (rows[1] * dx - columns[1] * dz) / determinant,
            (columns[0] * dz - rows[0] * dx) / determinant,
        ],
        axis=-1,
    )


def _unit(cosine: Array) -> Array:
    return np.clip(cosine, -1.0, 1.0)


def _check_reach(reach: Array, low: float, high: float, primitive: str) -> None:
    bad = ~((reach > low) & (reach <= high + _STRAIGHT_MARGIN))  # true for NaN too
    if np.any(bad):
        worst = np.atleast_1d(reach)[np.atleast_1d(bad)][0]
        raise UnreachableError(
            f"{primitive}: the target puts hip and ankle {worst:.4f} m apart; "
            f"reachable: {low:.4f} to {high:.4f} m"
        )
