"""Weigh a standing robot by its servos: where its CoM is, whatever its model says.

A position servo's torque follows from how far it is off its target. The torques of a
leg that stands still are those of its own weight and of the ground's force and moment
on the foot; so the ground's centre of pressure follows, and over it stands the CoM. How
stiff the servos really are follows too: the ground carries the robot's weight. Ours.
"""

import numpy as np

from gaitchain.balance.leg_kinematics import Legs, Posture, com_from_pelvis, posture
from gaitchain.messages import GRAVITY, Array

_LEAST_LOAD = 0.5  # of the weight: with less the robot does not stand on its feet
_STIFFNESS = 0.6, 1.6  # least and most of the servos' stiffness, by their file's
_NEXT, _LAST = np.array([1, 2, 0]), np.array([2, 0, 1])  # axes


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
    torques = legs.stiffness * (targets - joints) - legs.damping * rates
    found, count = posture(legs, joints), len(joints) // 2
    hanging, pushed = np.zeros((2, 3)), np.zeros((2, 3))  # each force and moment
    for leg in range(2):
        own = torques[leg * count : (leg + 1) * count]
        weights = _weight_torques(legs, found, leg, -GRAVITY * level[2])
        by_weight, by_servos = _wrenches(found, leg, np.stack([weights, own], axis=1))
        hanging += by_weight @ level.T
        pushed -= by_servos @ level.T
    weight = legs.mass * GRAVITY
    if not hanging[0, 2] + pushed[0, 2] > _LEAST_LOAD * weight:
        return None
    stiffer = (weight - hanging[0, 2]) / pushed[0, 2]
    force, moment = hanging + float(np.clip(stiffer, *_STIFFNESS)) * pushed
    com = level @ com_from_pelvis(legs, found)
    # Moments about the pelvis; the ground's force is carried down to the soles.
    pressure = np.array([-moment[1], moment[0]]) / force[2]
    tilt = force[:2] / force[2]
    return np.asarray(pressure + tilt * com[2] - com[:2])


def _weight_torques(legs: Legs, found: Posture, leg: int, gravity: Array) -> Array:
    """(n,) torques that hold a leg's own links in the air [N m]."""
    forces = legs.link_mass[leg][:, None] * gravity
    moments = _cross(found.coms[leg], forces)
    # Joint j holds all links from its own to the foot.
    force = np.cumsum(forces[::-1], axis=0)[::-1]
    moment = np.cumsum(moments[::-1], axis=0)[::-1]
    about = moment - _cross(found.centres[leg], force)
    return np.asarray(-np.sum(found.axes[leg] * about, axis=1))


def _wrenches(found: Posture, leg: int, torques: Array) -> Array:
    """(2, 2, 3) force on a foot and its moment about the pelvis, for (n, 2) torques."""
    axes, centres = found.axes[leg], found.centres[leg]
    # A force f with moment m about the pelvis turns joint j by a . (m - o x f).
    levers = np.hstack([-_cross(axes, centres), axes])
    both = np.linalg.lstsq(levers, torques, rcond=None)[0]
    return np.asarray(both.T).reshape(2, 2, 3)


def _cross(a: Array, b: Array) -> Array:
    """(n, 3) a x b; `np.cross` takes longer than the rest of the control period."""
    return a.take(_NEXT, 1) * b.take(_LAST, 1) - a.take(_LAST, 1) * b.take(_NEXT, 1)
