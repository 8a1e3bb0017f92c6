"""Where poses lead from some lyings at once, and whether that is the same. Ours."""

import math
from typing import NamedTuple

import numpy as np

from gaitchain.gait.get_up import Side, TimedPose, Way
from gaitchain.getup.fallen_robot import (
    BodyState,
    FallenRobot,
    Start,
    Subject,
    fallen_robot,
)
from gaitchain.getup.ways import height, pose_of, rise_of
from gaitchain.messages import Array

_TILT, _HIGH, _OFF, _LIFTED, _FLAT = 0.35, 0.08, 0.2, 0.2, 0.5  # of a cell
_FURTHEST_OFF, _MOST_LIFTED = 1.5, 1.0
_FAST, _FASTEST = 0.15, 4.0  # what speed takes from a robot's height [s/leg, legs/s]
_ALIKE = BodyState(  # most that two may differ; the tilt is compared as an angle
    up=math.inf,
    ahead=math.inf,
    high=0.12,
    off=0.3,
    lifted=math.inf,
    speed=math.inf,
    flat=0.6,
)
_TURNED = 0.5  # the same of the tilt [rad]
_NEAR, _SOLES_DOWN = 0.7, 0.0  # to its feet, to squat from there [legs, -]
_SITS_UP, _OVER = 0.5, 0.3  # what squats: its trunk up, the CoM that near its feet

Cell = tuple[int, ...]
Numbers = tuple[Array, ...]
"""Of the poses of a way, one row each."""


class Reached(NamedTuple):
    """Where a pose led, from each of some lyings."""

    states: tuple[Array, ...]
    looks: tuple[BodyState, ...]

    @property
    def cell(self) -> Cell:
        """Of the first, by tilt, height, balance and feet."""
        look = self.looks[0]
        off, lifted = min(look.off, _FURTHEST_OFF), min(look.lifted, _MOST_LIFTED)
        parts = _tilt(look) / _TILT, look.high / _HIGH, off / _OFF, lifted / _LIFTED
        return tuple(round(part) for part in (*parts, look.flat / _FLAT))

    @property
    def worth(self) -> float:
        """How far up the robot is, and how calmly, where that is least."""
        return min(
            height(look) - _FAST * min(look.speed, _FASTEST) for look in self.looks
        )

    @property
    def near_its_feet(self) -> bool:
        """Whether it may squat from there."""
        return all(one.off < _NEAR and one.flat > _SOLES_DOWN for one in self.looks)

    @property
    def alike(self) -> bool:
        """Whether robots are about where the first of them is."""
        return all(_differs_little(self.looks[0], other) for other in self.looks[1:])

    def with_more(self, other: "Reached") -> "Reached":
        """Return where it led from the lyings of both."""
        return Reached(self.states + other.states, self.looks + other.looks)


def lying(robot: FallenRobot, side: Side, starts: tuple[Start, ...]) -> Reached:
    """Return the robot as it lies.

    Args:
        robot: which.
        side: what it lies on.
        starts: how, and in what worlds.
    """
    states, looks = list[Array](), list[BodyState]()
    for start in starts:
        robot.lie(side, start)
        states.append(robot.state)
        looks.append(robot.look())
    return Reached(tuple(states), tuple(looks))


def go_on(
    subject: Subject,
    side: Side,
    starts: tuple[Start, ...],
    numbers: Numbers,
    states: tuple[Array, ...],
) -> Reached:
    """Take the last of some poses, from where those before it led.

    Args:
        subject: the robot.
        side: what it lay on.
        starts: how, and in what worlds.
        numbers: of the poses.
        states: of the robot, one for each start.
    """
    robot, after, looks = fallen_robot(subject), list[Array](), list[BodyState]()
    last = _last_of(robot, numbers[:-1])
    way = Way((pose_of(robot, numbers[-1], last),), 0, 1)
    for start, state in zip(starts, states, strict=True):
        robot.go_back(side, start, state)
        robot.move(way, last, hold_s=0.0)
        after.append(robot.state)
        looks.append(robot.look())
    return Reached(tuple(after), tuple(looks))


def rises_on(
    subject: Subject,
    side: Side,
    starts: tuple[Start, ...],
    numbers: Numbers,
    states: tuple[Array, ...],
) -> bool:
    """Squat and rise from where poses led; return whether it stands; see `go_on`."""
    robot = fallen_robot(subject)
    last = _last_of(robot, numbers[:-1])
    rise = rise_of(robot, numbers[-1], last)
    for start, state in zip(starts, states, strict=True):
        robot.go_back(side, start, state)
        if not _rises(robot, rise, last):
            return False
    return True


def _rises(robot: FallenRobot, rise: list[TimedPose], last: Array) -> bool:
    """Whether the robot stands after these poses; it stops where it does not squat."""
    squat, rest, *up = rise
    look = robot.move(Way((squat, rest), 0, 1), last, hold_s=0.0)[-1]
    if look.up < _SITS_UP or look.off > _OVER:
        return False
    return robot.move(Way(tuple(up), 0, 1), np.array(rest.angles))[-1].stands


def _last_of(robot: FallenRobot, numbers: Numbers) -> Array:
    """Return the angles (n,) after some poses [rad]."""
    last = robot.stand
    for row in numbers:
        last = np.array(pose_of(robot, row, last).angles)
    return last


def _differs_little(one: BodyState, other: BodyState) -> bool:
    turned = abs(_tilt(one) - _tilt(other))
    near = abs(np.subtract(one, other)) < _ALIKE
    return bool(min(turned, 2.0 * math.pi - turned) < _TURNED and near.all())


def _tilt(look: BodyState) -> float:
    return math.atan2(look.ahead, look.up)
