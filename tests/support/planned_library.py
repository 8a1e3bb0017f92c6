"""Libraries of a robot's plan alone: what a test needs where no physics is asked."""

from functools import cache
from itertools import pairwise

import numpy as np
from verdicts import PASSED

from gaitchain.build.stride_feasibility import feasible_pairs
from gaitchain.chain.layered_chain import LayeredChain
from gaitchain.gait.build_config import BuildConfig
from gaitchain.gait.family import STAND
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.stride.shape import StrideShape
from gaitchain.gait.stride.strides import StridePoses
from gaitchain.robot.box_robot import load_box_robot


@cache
def planned_res():
    """Return that of RES, one for all tests of a process: they change nothing of it."""
    return planned_library(load_box_robot("res"))


def planned_library(robot, longest=0.45, count=4):
    """So many strides ahead, up to a part of the leg, that the plan can carry out.

    Physics has seen none of them; the library says so only in its name.
    """
    leg, shape = robot.reduced.leg_length, StrideShape()
    strides = np.zeros((2 + count, 3))
    strides[2:, 0] = np.linspace(0.25, 1.0, count) * longest * leg
    shapes = np.array([[0.5, 1.4, shape.lift * leg]]), np.array([[0.08, 0.1]])
    poses = StridePoses(robot, shape.hip_height * leg, (strides, *shapes, strides))
    timing = shape.timing(robot)
    walked = feasible_pairs(poses, timing, np.inf).astype(np.int64)
    walked[1:3, STAND] = 1  # a stop may land further out than planned
    counts = poses.counts
    costs = tuple(np.zeros(shape) for shape in pairwise(counts))
    return GaitLibrary(
        poses=poses,
        timing=timing,
        chain=LayeredChain(tuple(np.full(c.shape, 1.0 / c.shape[1]) for c in costs)),
        edge_costs=costs,
        path_costs=costs,
        pair_advance=0.5 * (strides[:, :1] + strides[:, 0]),
        pair_error=np.full(walked.shape, 0.03 * leg),
        pair_slip=np.full(walked.shape, 0.1),
        pair_runs=walked,
        pair_passes=walked,
        config=BuildConfig(robot="planned", preset="brisk"),
        qualification=PASSED,
    )
