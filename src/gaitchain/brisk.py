"""The preset `brisk`: strides and swing shapes for walking at a useful speed. Ours.

Strides go forward, backward, sideways and around. Where a pair of strides asks for a
ZMP outside the sole, or for a joint faster than its limit, it is not walked: the plan
itself is run over every pair, without physics, with sensors that report the reference.
"""

from collections.abc import Sequence

import numpy as np

from gaitchain.biped import Biped
from gaitchain.errors import CommandError
from gaitchain.kinematics import Array
from gaitchain.stride_poses import StridePoses
from gaitchain.stride_shape import LANDING, PASSING, StrideShape

NAME = "brisk"
COUNTS = (40, 12, 8, 40)
"""Candidates per layer; of the strides at most as many."""
_FORWARD, _BACKWARD = 0.78, 0.32  # of the leg: longest strides
_OUTWARD, _INWARD = 0.2, 0.0  # of the leg
_TURN_OUT, _TURN_IN = 0.4, 0.12  # rad
_LEAST_TURN, _LEAST_SIDE = 0.5, 0.5  # of the most: the inner ones
_LOW, _HIGH = 0.91, 1.06  # of the shape's step height
_ROUND = 1.01  # strides whose parts of the most add up to this at most


def draw_brisk(
    biped: Biped,
    counts: Sequence[int],
    rng: np.random.Generator,
    shape: StrideShape | None = None,
) -> StridePoses:
    """Draw the candidates.

    Strides lie on a grid: turning and stepping aside leave less for going forward, as
    |length| / most + outward / most + |turn| / most <= 1. Shapes are drawn around one
    that a search in physics found (`docs/design.md`).

    Args:
        biped: the robot.
        counts: candidates per layer; of strides at most this many, the same twice.
        rng: source of randomness.
        shape: how the robot steps; by default as `StrideShape` says.

    Returns:
        The candidates.

    Raises:
        CommandError: the first and the last count differ.
    """
    if counts[0] != counts[3]:
        raise CommandError(
            f"poses per layer {tuple(counts)}: kp_4 is the next step's kp_1, so the "
            "first and last number must be equal"
        )
    leg, shape = biped.leg_length, shape or StrideShape()
    strides = _stride_grid(counts[0]) * np.array([leg, leg, 1.0])
    passing = rng.uniform(
        [0.46, 1.3, _LOW * shape.lift * leg],
        [0.54, 1.6, _HIGH * shape.lift * leg],
        (counts[1], 3),
    )
    landing = rng.uniform([0.0, 0.0], [0.15, 0.2], (counts[2], 2))
    passing[0] = *PASSING, shape.lift * leg
    landing[0] = LANDING
    return StridePoses(
        biped,
        shape.hip_height * leg,
        (strides, passing, landing, strides.copy()),
        shape.balance,
    )


def _stride_grid(most: int) -> Array:
    """Strides of a grid inside the cross polytope, standing first, nearest first."""
    forward = np.linspace(0.0, 1.0, 9)
    lengths = np.concatenate([-forward[2:9:3], forward])
    sides, turns = (0.0, 0.5, 1.0), (-1.0, 0.0, 0.5, 1.0)
    grid = np.array([(x, y, t) for x in lengths for y in sides for t in turns])
    grid = grid[np.abs(grid).sum(axis=1) <= _ROUND]
    order = np.argsort(np.abs(grid).sum(axis=1) + 1e-3 * np.arange(len(grid)))
    grid = grid[order]
    scale = np.where(
        grid < 0.0,
        [_BACKWARD, _INWARD, _TURN_IN],
        [_FORWARD, _OUTWARD, _TURN_OUT],
    )
    stand = np.zeros((1, 3))
    return np.concatenate([stand, grid * scale])[:most]
