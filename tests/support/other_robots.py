"""Robots that differ from one in a few numbers."""

import dataclasses

from gaitchain.robot.box_robot import box_robot


def resized(robot, **numbers):
    """A robot of boxes with other numbers, or another name."""
    return box_robot(dataclasses.replace(robot.reduced, **numbers))


def with_legs(robot, legs, **numbers):
    """The robot with the legs of a file, and with other numbers."""
    reduced = dataclasses.replace(robot.reduced, **numbers)
    return dataclasses.replace(robot, reduced=reduced, legs=legs, boxes=False)
