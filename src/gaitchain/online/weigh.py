"""Weigh a standing robot by its servos: where its CoM is, whatever its model says.

A position servo's torque follows from how far it is off its target. The torques of a
leg that stands still are those of its weight and of the ground's force and moment on
the foot; so the ground's centre of pressure follows, and over it stands the CoM. Both
force and moment go with the stiffness, so the place does not depend on it. Ours.
"""

import numpy as np

from gaitchain.kinematics import Array
from gaitchain.online.legs import GRAVITY, Legs, Posture, com_from_pelvis, posture
from gaitchain.online.servos import holding_torques

_LEAST_LOAD = 0.5  # of the weight: with less the robot does not stand on its feet


def weigh_offset(
    legs: Legs, joints: Array, rates: Array, targets: Array, level: Array
) -> Array | None:
    """Measure how far the robot's CoM is off that of its model.

    Args:
        legs: the robot.
        joints: (2 n,) measured [rad].
        rates: (2 n,) measured [rad/s].
        targets: (2 n,) what the servos were told last [rad].
        level: (3, 3) rotation from the pelvis frame to the level frame.

    Returns:
        (2,) ahead and left in the level frame [m]; None if it does not stand.
    """
    torques = legs.stiffness * (targets - joints) - legs.damping * rates
    found, count = posture(legs, joints), len(joints) // 2
    force, moment = np.zeros(3), np.zeros(3)
    for leg in range(2):
        own = torques[leg * count : (leg + 1) * count]
        push, turn = _ground_wrench(legs, found, leg, own)
        force += level @ push
        moment += level @ turn
    weight = legs.mass * GRAVITY
    if not force[2] > _LEAST_LOAD * weight:
        return None
    com = level @ com_from_pelvis(legs, found)
    # Moments about the pelvis; the ground's force is carried down to the soles.
    pressure = np.array([-moment[1], moment[0]]) / force[2]
    tilt = force[:2] / force[2]
    return np.asarray(pressure + tilt * com[2] - com[:2])


def _ground_wrench(
    legs: Legs, found: Posture, leg: int, torques: Array
) -> tuple[Array, Array]:
    """Force on a foot and its moment about the pelvis, pelvis frame [N, N m]."""
    none, still = np.zeros(3), np.zeros((legs.link_mass.shape[1], 3))
    hanging = holding_torques(legs, found, leg, none, 0.0, 0.0, still, 0.0)
    axes, centres = found.axes[leg], found.centres[leg]
    # A force f with moment m about the pelvis turns joint j by a . (m - o x f).
    levers = np.hstack([-np.cross(axes, centres), axes])
    wrench = np.linalg.lstsq(levers, hanging - torques, rcond=None)[0]
    return wrench[:3], wrench[3:]
