"""Draw the strides and swing shapes of a preset, for walking at useful speeds. Ours.

Strides go forward, backward, sideways and around. Pairs of strides that need a ZMP
outside the sole, or a joint beyond its limits, are removed later: there the plan is run
over every pair without physics (`build.stride_feasibility`).
"""

from collections.abc import Sequence

import numpy as np

from gaitchain.errors import CommandError
from gaitchain.gait.stride.presets import STRIDE_PRESETS, Reach
from gaitchain.gait.stride.shape import LANDING, StrideShape
from gaitchain.gait.stride.strides import StridePoses
from gaitchain.messages import Array
from gaitchain.robot.robot import Robot

# Range of kp_2 relative to the shape's: share, share rate, and part of the step height.
_LOW, _HIGH = np.array([-0.04, -0.1, -0.09]), np.array([0.04, 0.2, 0.06])
_AHEAD, _BACK = 7, 3  # grid values of the length ahead (0 included) and back
_ROUND = 1.01  # largest sum of a stride's parts of the limits; 1 but for rounding


def draw_strides(
    robot: Robot,
    preset: str,
    counts: Sequence[int],
    rng: np.random.Generator,
    *,
    shape: StrideShape | None = None,
    reach: Reach | None = None,
) -> StridePoses:
    """Draw the candidates of a preset.

    Strides lie on a grid with |length| / most + outward / most + |turn| / most <= 1, so
    that strides that turn or go aside are shorter. Swing shapes are drawn around one
    that was found by a search in physics (`docs/experiments.md`).

    Args:
        robot: the robot.
        preset: one of `STRIDE_PRESETS`.
        counts: candidates per layer; for strides (first and last) an upper limit.
        rng: source of randomness.
        shape: shape of the robot's steps; that of `StrideShape()` by default.
        reach: the furthest strides; those of the preset by default.

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
    leg, shape = robot.reduced.leg_length, shape or StrideShape()
    grid = _stride_grid(reach or STRIDE_PRESETS[preset].reach, counts[0])
    strides = grid * np.array([leg, leg, 1.0])
    middle = np.array(shape.passing(leg))
    scale = np.array([1.0, 1.0, middle[2]])
    passing = rng.uniform(middle + _LOW * scale, middle + _HIGH * scale, (counts[1], 3))
    landing = rng.uniform([0.0, 0.0], [0.15, 0.2], (counts[2], 2))
    passing[0] = middle
    landing[0] = LANDING
    return StridePoses(
        robot,
        shape.hip_height * leg,
        (strides, passing, landing, strides.copy()),
        shape.balance,
        shape.stance * robot.reduced.hip_width,
    )


def _stride_grid(reach: Reach, most: int) -> Array:
    """Return the grid's strides inside the cross polytope: standing, then by size."""
    backward = -np.linspace(1.0, 0.0, _BACK, endpoint=False)
    lengths = np.concatenate([backward, np.linspace(0.0, 1.0, _AHEAD)])
    sides, turns = (0.0, 0.5, 1.0), (-1.0, 0.0, 0.5, 1.0)
    grid = np.array([(x, y, t) for x in lengths for y in sides for t in turns])
    grid = grid[np.abs(grid).sum(axis=1) <= _ROUND]
    order = np.argsort(np.abs(grid).sum(axis=1) + 1e-3 * np.arange(len(grid)))
    grid = grid[order]
    least = [reach.back, 0.0, reach.turn_in]
    furthest = [reach.ahead, reach.outward, reach.turn_out]
    scale = np.where(grid < 0.0, least, furthest)
    stand = np.zeros((1, 3))
    return np.concatenate([stand, grid * scale])[:most]
