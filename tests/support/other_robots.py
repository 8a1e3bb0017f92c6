"""Robots that differ from one in a few numbers."""

import dataclasses

import numpy as np

from gaitchain.robot.box_robot import box_legs, box_robot


def resized(robot, **numbers):
    """A robot of boxes with other numbers, or another name."""
    return box_robot(dataclasses.replace(robot.reduced, **numbers))


def with_legs(robot, legs, **numbers):
    """The robot with the legs of a file, and with other numbers."""
    reduced = dataclasses.replace(robot.reduced, **numbers)
    return dataclasses.replace(robot, reduced=reduced, legs=legs, boxes=False)


def without_joint(robot, joint):
    """A robot of boxes without a joint; what hangs on it goes to the one before."""
    full = box_legs(robot.reduced)
    kept = [j for j in range(6) if j != joint]
    rows = [*kept, *(6 + j for j in kept)]
    at = np.array(full.at)
    at[:, 1] += at[:, 0] * (joint == 0)
    by_link = {name: np.array(getattr(full, name)) for name in ("com", "inertia")}
    by_link |= {"link_mass": np.array(full.link_mass)}
    if joint == 5:
        for array in by_link.values():
            array[:, 4] = array[:, 5]
    by_joint = ("lower", "upper", "stiffness", "damping", "torque_limit")
    by_joint += ("speed_limit", "armature", "friction_loss", "joint_damping", "stand")
    legs = dataclasses.replace(
        full,
        joint_names=tuple(full.joint_names[row] for row in rows),
        knee=kept.index(full.knee),
        at=at[:, kept],
        axis=full.axis[:, kept],
        **{name: array[:, kept] for name, array in by_link.items()},
        **{name: getattr(full, name)[rows] for name in by_joint},
    )
    return with_legs(robot, legs)
