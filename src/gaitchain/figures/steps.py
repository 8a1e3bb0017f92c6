"""The steps of a recorded walk, and the plan of each step."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from gaitchain.analysis.record import WalkRecord
from gaitchain.errors import CommandError
from gaitchain.gait.family import STAND
from gaitchain.gait.keypose.cost import PlannedCost
from gaitchain.gait.keypose.key_poses import KeyPoses
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.zmp import interpolated_zmp, sole_corners, zmp
from gaitchain.messages import Array
from gaitchain.robot.robot import Robot


@dataclass(frozen=True)
class WalkedStep:
    """One finished step."""

    number: int
    """Number of the step, 1 for the first step of the schedule."""
    moments: tuple[int, int, int, int]
    """Rows of the record at which kp_1 to kp_4 were reached."""
    gait: tuple[int, int, int, int]
    """Index of the pose in the layer of each key moment."""
    left_support: bool

    @property
    def rows(self) -> slice:
        """Rows of the record from kp_1 to kp_4."""
        return slice(self.moments[0], self.moments[-1])

    @property
    def midstance(self) -> int:
        """Row of the record in the middle of single support."""
        return (self.moments[0] + self.moments[2]) // 2

    @property
    def support_foot(self) -> int:
        """Index of the support foot in `WalkRecord.feet`."""
        return 0 if self.left_support else 1


def walked_steps(record: WalkRecord) -> list[WalkedStep]:
    """Find the steps of a record, without times of standing still.

    Raises:
        CommandError: the robot finished no step.
    """
    steps, pose = list[WalkedStep](), STAND
    for number, (begin, after) in enumerate(pairwise(record.step_ticks), start=1):
        end = _first_stand(record, begin, after)
        layers, poses = record.key_pose[begin:end].T
        if end > len(record.time_s) or set(layers) != {1, 2, 3}:
            pose = STAND
            continue
        first = [int(np.argmax(layers == layer)) for layer in (1, 2, 3)]
        second, third, last = (int(poses[i]) for i in first)
        moments = begin, begin + first[1], begin + first[2], end
        left = str(record.support[begin]) == "ls"
        steps.append(WalkedStep(number, moments, (pose, second, third, last), left))
        pose = last if end == after else STAND
    if not steps:
        raise CommandError("the record holds no finished step; walk at least one")
    return steps


def _first_stand(record: WalkRecord, begin: int, end: int) -> int:
    """Return the first of some rows in which the robot stands, or their end."""
    stands = np.flatnonzero(record.support[begin:end] == "stand")
    return begin + int(stands[0]) if stands.size else end


def two_cycles(record: WalkRecord) -> list[WalkedStep]:
    """Return the steps of the two cycles after the first half step, or fewer."""
    steps = walked_steps(record)
    return steps[1:5] or steps


def step_plan(
    library: GaitLibrary, step: WalkedStep, time_s: Array
) -> tuple[Array, Array]:
    """Return a step's planned ZMP, by the multi-link model and by interpolation.

    Args:
        library: the library that was walked.
        step: the step.
        time_s: (N,) times since its kp_1 [s].

    Returns:
        Two (N, 2) ZMPs in the support-foot frame, left leg as support [m]: that of the
        multi-link model, and the paper's interpolation.
    """
    poses, timing, robot = library.poses_as(KeyPoses), library.timing, library.robot
    full = zmp(robot, poses.motion(step.gait, timing).at(time_s))
    states = PlannedCost(poses, timing).key_states(np.array([step.gait]))
    key_zmp = zmp(robot, states)[0]
    return full, interpolated_zmp(timing, key_zmp, time_s)


def outline(robot: Robot, foot: Array) -> Array:
    """Return the closed outline of a foot's sole in the world, (5, 2) [m].

    Args:
        robot: the robot.
        foot: (3,) pose of the foot: ankle x, y [m] and yaw [rad] in the world.
    """
    corners = sole_corners(robot, foot[:2], foot[2])
    return np.vstack([corners, corners[:1]])
