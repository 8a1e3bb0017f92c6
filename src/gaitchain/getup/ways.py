"""Ways of a robot as rows of numbers that a search changes, and what they are worth.

Both sides of the robot do the same. Each pose is a row: the changes of all pairs of
joints from the standing pose, and the logarithm of the time it takes. The last two
numbers are of the squat that ends the way down there: how long it takes to get into it,
and how deep it is. From there the robot rises through squats, in balance all the time.
"""

import math
from typing import NamedTuple

import numpy as np

from gaitchain.gait.get_up import TimedPose, Way
from gaitchain.getup.fallen_robot import BodyState, FallenRobot
from gaitchain.messages import GRAVITY, Array

_USUAL_S, _SHORTEST_S, _LONGEST_S = 0.6, 0.25, 1.6  # of a pose
_RISE, _LEAST_RISE, _RESTS = 12.0, 4.0, 2.4  # from the deepest squat up; rest in it,
# of the time in which something falls twice as far as the CoM is high, sqrt(h / g)
_SQUATS = 4  # poses from a squat to the stand
_FAST = 1.5  # peak over mean speed of a smooth change
TURN = 2.8
"""Furthest from the standing pose [rad]."""
TAIL = 2
"""Numbers of the way from the last pose to the stand."""
_END = 20  # looks at the end that count as one


class Tried(NamedTuple):
    """What came of a way from one start."""

    value: float
    stood: bool


def way_of(robot: FallenRobot, numbers: Array, stood: int = 0, starts: int = 1) -> Way:
    """Return the way that some numbers stand for.

    Args:
        robot: of the joints.
        numbers: (poses (pairs + 1) + 2,) [rad, -].
        stood: see `Way`.
        starts: see `Way`.
    """
    poses, last = [], robot.stand
    for row in numbers[:-TAIL].reshape(-1, len(robot.pairs) + 1):
        poses.append(pose_of(robot, row, last))
        last = np.array(poses[-1].angles)
    return Way((*poses, *rise_of(robot, numbers[-TAIL:], last)), stood, starts)


def pose_of(robot: FallenRobot, row: Array, last: Array) -> TimedPose:
    """Return the pose that a row of numbers stands for.

    Args:
        robot: of the joints.
        row: (pairs + 1,) [rad, -].
        last: (n,) angles before it [rad].
    """
    return timed_pose(robot, last, _angles(robot, row[:-1]), _USUAL_S * _times(row[-1]))


def squatting(robot: FallenRobot, row: Array, part: float) -> Array:
    """Return a row of numbers with the legs of a squat.

    Args:
        robot: of the joints.
        row: (pairs + 1,) [rad, -].
        part: of the deepest squat.
    """
    changes = robot.squats.at(part) - robot.stand
    of_pairs = np.array([changes[pair.left] for pair in robot.pairs])
    legs = np.append([pair.left in robot.leg_rows for pair in robot.pairs], False)
    return np.where(legs, np.append(of_pairs, 0.0), row)


def rise_of(robot: FallenRobot, tail: Array, last: Array) -> list[TimedPose]:
    """Return a squat, a rest in it, and the squats from there to the stand.

    Args:
        robot: of the joints.
        tail: number of the time to the squat, and its part of the deepest one.
        last: (n,) angles before it [rad].
    """
    unit_s = math.sqrt(robot.height / GRAVITY)
    part = float(np.clip(tail[1], 0.0, 1.0))
    squat = robot.squats.at(part)
    down = timed_pose(robot, last, squat, _USUAL_S * _times(tail[0]))
    rise_s = max(_RISE * part, _LEAST_RISE) * unit_s / _SQUATS
    poses = [down, TimedPose(round(_RESTS * unit_s, 3), down.angles)]
    for part_left in part * np.linspace(1.0, 0.0, _SQUATS + 1)[1:]:
        before, squat = squat, robot.squats.at(part_left)
        poses.append(timed_pose(robot, before, squat, rise_s))
    return poses


def _times(number: float) -> float:
    return math.exp(0.5 * float(np.clip(number, -2.0, 2.0)))


def _angles(robot: FallenRobot, changes: Array) -> Array:
    angles = robot.stand.copy()
    for pair, change in zip(robot.pairs, np.clip(changes, -TURN, TURN), strict=True):
        angles[pair.left] = robot.stand[pair.left] + change
        angles[pair.right] = robot.stand[pair.right] + pair.sign * change
    return np.asarray(np.clip(angles, robot.lower, robot.upper))


def timed_pose(
    robot: FallenRobot, last: Array, angles: Array, wanted_s: float
) -> TimedPose:
    """Return a pose, with at least the time that the joints' speed limits need.

    Args:
        robot: of the joints.
        last: (n,) angles before it [rad].
        angles: (n,) of the pose [rad].
        wanted_s: how long it should take [s].
    """
    needed_s = float((_FAST * np.abs(angles - last) / robot.speed_limit).max())
    seconds = max(min(max(wanted_s, _SHORTEST_S), _LONGEST_S), needed_s)
    return TimedPose(round(seconds, 3), tuple(np.round(angles, 4).tolist()))


def judge(seen: list[BodyState]) -> Tried:
    """Return how far a robot came: at its best, and where it stays in the end."""
    heights = [height(look) for look in seen]
    stays = float(np.mean(heights[-_END:]))
    stood = seen[-1].stands
    return Tried(stays + heights[-1] + 0.5 * max(heights) + float(stood), stood)


def height(look: BodyState) -> float:
    """Return how much a robot is up: over its feet, these flat and down, and high."""
    off, lifted = min(look.off, 2.0), min(look.lifted, 1.0)
    return look.high + 0.3 * look.up - off - 0.5 * lifted + 0.5 * look.flat
