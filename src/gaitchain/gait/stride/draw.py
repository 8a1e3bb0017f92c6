"""Draw strides and swing shapes for walking at a useful speed, as a preset says. Ours.

Strides go forward, backward, sideways and around. Where a pair of strides asks for a
ZMP outside the sole, or for a joint faster than its limit, it is not walked: the plan
itself is run over every pair, without physics, with sensors that report the reference.
"""

from collections.abc import Sequence

import numpy as np

from gaitchain.errors import CommandError
from gaitchain.gait.stride.presets import STRIDE_PRESETS, StridePreset
from gaitchain.gait.stride.shape import LANDING, StrideShape
from gaitchain.gait.stride.strides import StridePoses
from gaitchain.messages import Array
from gaitchain.robot.robot import Robot

_LOW = np.array([-0.04, -0.1, -0.09])  # kp_2 around that of the shape: share, rate,
_HIGH = np.array([0.04, 0.2, 0.06])  # and part of its step height
_AHEAD, _BACK = 7, 3  # lengths of the grid
_ROUND = 1.01  # strides whose parts of the most add up to this at most


def draw_strides(
    robot: Robot,
    preset: str,
    counts: Sequence[int],
    rng: np.random.Generator,
    *,
    shape: StrideShape | None = None,
    longest: tuple[float, float] | None = None,
) -> StridePoses:
    """Draw the candidates of a preset.

    Strides lie on a grid: turning and stepping aside leave less for going forward, as
    |length| / most + outward / most + |turn| / most <= 1. Shapes are drawn around one
    that a search in physics found (`docs/design.md`).

    Args:
        robot: the robot.
        preset: one of `STRIDE_PRESETS`.
        counts: candidates per layer; of strides at most this many, the same twice.
        rng: source of randomness.
        shape: how the robot steps; by default as `StrideShape` says.
        longest: strides ahead and back, parts of the leg; the preset's by default.

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
    grid = _stride_grid(STRIDE_PRESETS[preset], counts[0], longest)
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
    )


def _stride_grid(
    preset: StridePreset, most: int, longest: tuple[float, float] | None
) -> Array:
    """Strides of a grid inside the cross polytope, standing first, nearest first."""
    backward = -np.linspace(1.0, 0.0, _BACK, endpoint=False)
    lengths = np.concatenate([backward, np.linspace(0.0, 1.0, _AHEAD)])
    sides, turns = (0.0, 0.5, 1.0), (-1.0, 0.0, 0.5, 1.0)
    grid = np.array([(x, y, t) for x in lengths for y in sides for t in turns])
    grid = grid[np.abs(grid).sum(axis=1) <= _ROUND]
    order = np.argsort(np.abs(grid).sum(axis=1) + 1e-3 * np.arange(len(grid)))
    grid = grid[order]
    ahead, back = longest or (preset.ahead, preset.back)
    least = [back, 0.0, preset.turn_in]
    furthest = [ahead, preset.outward, preset.turn_out]
    scale = np.where(grid < 0.0, least, furthest)
    stand = np.zeros((1, 3))
    return np.concatenate([stand, grid * scale])[:most]
