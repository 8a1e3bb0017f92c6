"""Building libraries of strides: search of the step's shape, draw, rollout."""

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gaitchain.build.gait_build import Candidates, Draw, Drawing, GaitBuild
from gaitchain.build.grid import DYNAMIC_GRID
from gaitchain.build.shape_search import GENERATIONS, Found, search_shape
from gaitchain.build.step_meter import StepTerms
from gaitchain.build.stride_feasibility import (
    feasible_pairs,
    first_fault,
    furthest_strides,
    joint_speeds,
)
from gaitchain.build.stride_rollout import walk_strides
from gaitchain.chain.layered_chain import IntArray
from gaitchain.chain.policy import Regret
from gaitchain.chain.sampling import Mask
from gaitchain.errors import CommandError, LibraryError
from gaitchain.gait.build_config import BuildConfig
from gaitchain.gait.command_range import CommandRange
from gaitchain.gait.family import STAND
from gaitchain.gait.motion import Timing
from gaitchain.gait.stride.draw import draw_strides
from gaitchain.gait.stride.presets import STRIDE_PRESETS, Reach
from gaitchain.gait.stride.shape import BOX_SHAPE, MODEL_SHAPE, StrideShape
from gaitchain.gait.stride.strides import StridePoses
from gaitchain.messages import GRAVITY, Array
from gaitchain.robot.robot import Robot
from gaitchain.sim.robot_faults import unsure_fields
from gaitchain.sim.world import DISTURBANCES, World
from gaitchain.sim.world_range import WorldRange, trained

LONGEST = 1.35
"""Strides that are tried, times those of the pace that a search found."""
MODEL_ERROR = 0.1
"""Relative error of each link's mass model in the worlds of a user's trials."""


class StrideBuild(GaitBuild):
    """Strides are trained and qualified with feedback."""

    grid = DYNAMIC_GRID

    def draw(self, draw: Draw) -> Candidates:
        """Draw strides up to the longest feasible one, and check every pair of them.

        If the config requires it, a search in physics for the step's shape comes first.
        """
        return self.drawings(draw)[0]()

    def drawings(self, draw: Draw) -> list[Drawing]:
        """See `GaitBuild.drawings`: the others are of what else a search came by."""
        found = self._shape(draw)
        shapes = found.shape, *found.others
        return [partial(_strides, draw, shape, found.pace) for shape in shapes]

    def roll_out(
        self, poses: StridePoses, timing: Timing, gaits: NDArray[np.int64], world: World
    ) -> StepTerms:
        """See `walk_strides`."""
        return walk_strides(poses, timing, gaits, world)

    def training_worlds(
        self, poses: StridePoses, speed_limit: float | None
    ) -> WorldRange:
        """See `GaitBuild`; with feedback, model errors, delays and pushes are added.

        What is left unknown of an identified robot is drawn, too. The unit of pushes,
        m sqrt(g h), has the height of the hips here: nothing stands yet whose CoM
        could be measured, as for the grid's.
        """
        height = poses.hip_height + poses.robot.reduced.ankle_height
        share = DISTURBANCES["push"].strides.trained
        assert isinstance(share, float)
        push_ns = share * poses.robot.reduced.mass * math.sqrt(GRAVITY * height)
        numbers = trained(balanced=True) | unsure_fields(poses.robot)
        return WorldRange(push_ns, speed_limit, **numbers)

    def trial_worlds(self) -> tuple[WorldRange, Mapping[str, Any]]:
        """See `GaitBuild`; friction varies, and the links differ from the model."""
        worlds = WorldRange(servo_gain=(1.0, 1.0), mass=(1.0, 1.0))
        return worlds, {"model_error": MODEL_ERROR}

    def planned_cost(
        self, poses: StridePoses, timing: Timing, gaits: IntArray
    ) -> Array:
        """Raise: the planned ZMP of a stride is always inside the sole.

        No `BuildConfig` asks for it.
        """
        raise CommandError("strides have no planned cost")

    def planned_regret(
        self, poses: StridePoses, timing: Timing, edges: tuple[Mask, ...], seed: int
    ) -> Regret | None:
        """Return None, as strides have no planned cost."""
        return None

    def steady_ends(self, most: CommandRange) -> list[tuple[int, int]]:
        """Return all ends except those at 0."""
        ends = [(axis, end) for axis in range(3) for end in range(2)]
        return [(axis, end) for axis, end in ends if most.ends[axis][end] != 0.0]

    def _shape(self, draw: Draw) -> Found:
        config, robot, crew = draw.config, draw.robot, draw.crew
        boxes, name = robot.of_boxes, str(config.preset)
        usual = BOX_SHAPE if boxes else MODEL_SHAPE
        start = replace(usual, **STRIDE_PRESETS[name].shape)
        own = 0 if boxes else GENERATIONS
        generations = own if config.search is None else config.search
        if not generations:
            return Found(start, math.inf)
        poses = draw_strides(robot, name, 2)
        worlds = self.training_worlds(poses, config.speed_limit_deg_s)
        given = any(
            t is not None for t in (config.step_s, config.rise_s, config.fall_s)
        )
        return search_shape(
            robot,
            draw.search,
            replace(crew, worlds=worlds),
            start=start,
            generations=generations,
            seconds=math.inf if config.search_s is None else config.search_s,
            rhythm=partial(_rhythm, config, robot) if given else None,
        )


def _strides(draw: Draw, shape: StrideShape, pace: float) -> Candidates:
    """Draw strides of a shape, up to those of a pace and somewhat longer ones.

    Raises:
        LibraryError: the robot can make none from a stand.
    """
    config, robot, name = draw.config, draw.robot, str(draw.config.preset)
    preset, timing = STRIDE_PRESETS[name], _rhythm(config, robot, shape)
    speed = joint_speeds(robot, config.speed_limit_deg_s)
    tried = _within(preset.reach, robot, timing, LONGEST * pace)
    reach = furthest_strides(robot, shape, timing, speed, tried)
    most = config.poses_per_layer[0] if config.poses_per_layer else preset.most
    poses = draw_strides(robot, name, most, shape=shape, reach=reach)
    sizes = pairwise(poses.counts)
    edges = tuple(np.ones(size, dtype=np.bool_) for size in sizes)
    pairs = feasible_pairs(poses, timing, speed, workers=draw.crew.workers)
    if not pairs[STAND].any():
        fault = first_fault(poses, timing, speed)
        raise LibraryError(
            f"{robot.name} can make no step from a stand: {fault}; `gaitchain "
            "inspect FILE` shows its legs as they were found"
        )
    return Candidates(poses, timing, edges, pairs)


def _within(most: Reach, robot: Robot, timing: Timing, pace: float) -> Reach:
    """Limit strides ahead to those of a pace, speed / sqrt(g leg)."""
    length = pace * timing.step * math.sqrt(GRAVITY / robot.reduced.leg_length)
    return replace(most, ahead=min(most.ahead, length))


def _rhythm(config: BuildConfig, robot: Robot, shape: StrideShape) -> Timing:
    """Return the step times for a shape, or those that the config gives."""
    return config.scaled_timing(shape.timing(robot))


STRIDE_BUILD = StrideBuild()
