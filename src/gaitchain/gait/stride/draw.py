"""Draw the strides of a preset, for walking at useful speeds. Ours.

Strides go forward, backward, sideways and around. Pairs of strides that need a ZMP
outside the sole, or a joint beyond its limits, are removed later: there the plan is run
over every pair without physics (`build.stride_feasibility`).
"""

import numpy as np

from gaitchain.gait.stride.presets import STRIDE_PRESETS, Reach
from gaitchain.gait.stride.shape import ARRIVAL, StrideShape
from gaitchain.gait.stride.strides import StridePoses
from gaitchain.messages import Array
from gaitchain.robot.robot import Robot

_AHEAD, _BACK = 7, 3  # grid values of the length ahead (0 included) and back
_ROUND = 1.01  # largest sum of a stride's parts of the limits; 1 but for rounding


def draw_strides(
    robot: Robot,
    preset: str,
    most: int,
    *,
    shape: StrideShape | None = None,
    reach: Reach | None = None,
) -> StridePoses:
    """Return the candidates of a preset.

    Strides lie on a grid with |length| / most + outward / most + |turn| / most <= 1, so
    that strides that turn or go aside are shorter. How the swing foot passes between
    them is one pose of kp_2 and one of kp_3, from the shape of the robot's steps: which
    of several is taken has no effect in physics (`docs/experiments.md`).

    Args:
        robot: the robot.
        preset: one of `STRIDE_PRESETS`.
        most: upper limit on the number of strides; standing is one of them.
        shape: shape of the robot's steps; that of `StrideShape()` by default.
        reach: the furthest strides; those of the preset by default.

    Returns:
        The candidates.
    """
    leg = robot.reduced.leg_length
    grid = _stride_grid(reach or STRIDE_PRESETS[preset].reach, most)
    strides = grid * np.array([leg, leg, 1.0])
    return shaped_poses(robot, shape or StrideShape(), strides)


def shaped_poses(robot: Robot, shape: StrideShape, strides: Array) -> StridePoses:
    """Return strides, between which the swing foot passes as a shape says.

    Args:
        robot: the robot.
        shape: of its steps.
        strides: (N, 3) lengths and outward shifts [m], turns [rad]; standing first.
    """
    biped = robot.reduced
    swing = np.array([shape.passing(biped.leg_length)]), np.array([ARRIVAL])
    return StridePoses(
        robot,
        shape.hip_height * biped.leg_length,
        (strides, *swing, strides.copy()),
        shape.balance,
        shape.stance * biped.hip_width,
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
