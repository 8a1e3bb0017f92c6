"""Weigh a standing robot by its servos: where its CoM is, whatever its model says.

A position servo's torque follows from how far it is off its target. The torques of a
leg that stands still are those of its own weight and of the ground's force and moment
on the foot; so the ground's centre of pressure follows, and over it stands the CoM. How
stiff the servos really are follows too: the ground carries the robot's weight. Ours.
"""

import numpy as np

from gaitchain.balance.compiled import compiled
from gaitchain.balance.curves import clip
from gaitchain.balance.least_squares import least_squares
from gaitchain.balance.leg_kinematics import (
    Legs,
    Posture,
    com_from_pelvis,
    cross,
    posture,
)
from gaitchain.balance.rotations import turned
from gaitchain.messages import GRAVITY, Array

_LEAST_LOAD = 0.5  # of the weight: with less the robot does not stand on its feet
_SOFTEST, _STIFFEST = 0.6, 1.6  # bounds of the servos' stiffness, by their file's


def weigh_offset(
    legs: Legs, joints: Array, rates: Array, targets: Array, level: Array
) -> Array | None:
    """Measure how far the robot's CoM is off that of its model.

    Args:
        legs: the robot.
        joints: (2 n,) measured [rad].
        rates: (2 n,) measured [rad/s].
        targets: (2 n,) the latest servo targets [rad].
        level: (3, 3) rotation from the pelvis frame to the level frame.

    Returns:
        (2,) ahead and left in the level frame [m]; None if it does not stand.
    """
    stands, ahead, left = weigh(legs, joints, rates, targets, level)
    return np.array([ahead, left]) if stands else None


@compiled
def weigh(
    legs: Legs, joints: Array, rates: Array, targets: Array, level: Array
) -> tuple[bool, float, float]:
    """Measure how far the robot's CoM is off that of its model, without an array.

    Arguments are those of `weigh_offset`.

    Returns:
        Whether the robot stands, and the offset ahead and left in the level frame [m].
    """
    found, torques = posture(legs, joints), np.empty(joints.shape[0])
    for j in range(joints.shape[0]):
        pushed_off = legs.stiffness[j] * (targets[j] - joints[j])
        torques[j] = pushed_off - legs.damping[j] * rates[j]
    weight = legs.mass * GRAVITY
    hanging, pushed = _ground_wrenches(legs, found, torques, level)
    if not hanging[2] + pushed[2] > _LEAST_LOAD * weight:
        return False, 0.0, 0.0
    stiffer = clip((weight - hanging[2]) / pushed[2], _SOFTEST, _STIFFEST)
    wrench = hanging + stiffer * pushed
    com = turned(level, com_from_pelvis(legs, found))
    # Moments about the pelvis; the ground's force is carried down to the soles.
    ahead = (wrench[0] * com[2] - wrench[4]) / wrench[2] - com[0]
    left = (wrench[1] * com[2] + wrench[3]) / wrench[2] - com[1]
    return True, ahead, left


@compiled
def _ground_wrenches(
    legs: Legs, found: Posture, torques: Array, level: Array
) -> tuple[Array, Array]:
    """Return what the ground bears of the legs' weight, and of what the servos push.

    Args:
        legs: the robot.
        found: its posture.
        torques: (2 n,) of its servos [N m].
        level: (3, 3) rotation from the pelvis frame to the level frame.

    Returns:
        Two of (6,), force and moment about the pelvis in the level frame.
    """
    hanging, pushed = np.zeros(6), np.zeros(6)
    count = legs.link_mass.shape[1]
    down, both = np.empty(3), np.empty((count, 2))
    for i in range(3):
        down[i] = -GRAVITY * level[2, i]
    for leg in range(2):
        for j in range(count):
            both[j, 1] = torques[leg * count + j]
        _weight_torques(legs, found, leg, down, both)
        wrench = least_squares(_levers(found, leg), both)
        for i in range(3):
            for k in range(3):
                hanging[i] += level[i, k] * wrench[k, 0]
                hanging[3 + i] += level[i, k] * wrench[3 + k, 0]
                pushed[i] -= level[i, k] * wrench[k, 1]
                pushed[3 + i] -= level[i, k] * wrench[3 + k, 1]
    return hanging, pushed


@compiled
def _weight_torques(
    legs: Legs, found: Posture, leg: int, gravity: Array, torques: Array
) -> None:
    """Write the torques that hold a leg's links in the air to a first column, (n, 2).

    Joint j holds all links from its own to the foot.
    """
    force, moment, one = np.zeros(3), np.zeros(3), np.empty(3)
    lever, weight = np.empty(3), np.empty(3)
    for j in range(legs.link_mass.shape[1] - 1, -1, -1):
        for i in range(3):
            lever[i] = found.coms[leg, j, i]
            weight[i] = legs.link_mass[leg, j] * gravity[i]
            force[i] += weight[i]
        cross(lever, weight, one)
        moment += one
        cross(found.centres[leg, j], force, one)
        torques[j, 0] = 0.0
        for i in range(3):
            torques[j, 0] -= found.axes[leg, j, i] * (moment[i] - one[i])


@compiled
def _levers(found: Posture, leg: int) -> Array:
    """Return what a force on the foot and its moment do to each joint, (n, 6).

    A force f with moment m about the pelvis turns joint j by a . (m - o x f).
    """
    count = found.centres.shape[1]
    levers, one = np.empty((count, 6)), np.empty(3)
    for j in range(count):
        cross(found.axes[leg, j], found.centres[leg, j], one)
        for i in range(3):
            levers[j, i], levers[j, 3 + i] = -one[i], found.axes[leg, j, i]
    return levers
