"""The full robot's legs online: forward and inverse kinematics, CoM, holding torques.

Frames: *pelvis* has its origin between the hips, x forward, y left, z up, fixed to the
trunk. *Level* is the same point and heading with z vertical. A leg is given by `side`,
+1 for the left and -1 for the right; its joints are hip yaw, roll, pitch, knee, ankle
pitch, roll, in the order of `joints.LEG_JOINTS`. Everything here is compiled.
"""

import math
from typing import NamedTuple

import numpy as np

from gaitchain.biped import Biped
from gaitchain.kinematics import Array
from gaitchain.online.compiled import compiled
from gaitchain.online.rotations import (
    hip_rotation,
    pitched,
    rolled,
    turned,
    turned_back,
    yaw_rotation,
)

GRAVITY = 9.81
_STRAIGHTEST = 0.999  # of the leg: a knee straighter than this moves too fast


class Legs(NamedTuple):
    """The numbers of the robot that walking online needs, SI units."""

    femur: float
    crus: float
    ankle_height: float
    hip_width: float
    sole_front: float
    """Front edge of the sole, x from the ankle."""
    sole_rear: float
    sole_half_width: float
    femur_mass: float
    crus_mass: float
    foot_mass: float
    trunk_mass: float
    mass: float
    trunk_com: float
    """Height of the trunk's CoM above the hips."""
    stiffness: float
    """Of the servos [N m/rad]."""
    damping: float
    """Of the servos [N m s/rad]."""
    torque_limit: float


def legs_of(biped: Biped) -> Legs:
    """Collect what walking online needs of a robot."""
    rear, front = biped.sole_x
    return Legs(
        femur=biped.femur_length,
        crus=biped.crus_length,
        ankle_height=biped.ankle_height,
        hip_width=biped.hip_width,
        sole_front=front,
        sole_rear=rear,
        sole_half_width=0.5 * biped.sole_width,
        femur_mass=biped.femur_mass,
        crus_mass=biped.crus_mass,
        foot_mass=biped.foot_mass,
        trunk_mass=biped.trunk_mass,
        mass=biped.mass,
        trunk_com=0.5 * biped.trunk_length,
        stiffness=biped.servo_stiffness,
        damping=biped.servo_damping,
        torque_limit=biped.joint_torque_limit,
    )


@compiled
def leg_links(legs: Legs, side: float, joints: Array) -> tuple[Array, Array]:
    """Locate a leg's joints and centres of mass.

    Args:
        legs: the robot.
        side: +1 left, -1 right.
        joints: (6,) joint angles [rad].

    Returns:
        (6, 3) points in the pelvis frame [m]: hip, knee, ankle, CoM of femur, crus and
        foot; and the foot's rotation (3, 3).
    """
    thigh = hip_rotation(joints)
    shank = pitched(thigh, joints[3])
    foot = rolled(pitched(shank, joints[4]), joints[5])
    points = np.empty((6, 3))
    sole_centre = 0.5 * (legs.sole_front + legs.sole_rear)
    for i in range(3):
        hip = 0.5 * side * legs.hip_width if i == 1 else 0.0
        knee = hip - legs.femur * thigh[i, 2]
        ankle = knee - legs.crus * shank[i, 2]
        points[0, i], points[1, i], points[2, i] = hip, knee, ankle
        points[3, i] = 0.5 * (hip + knee)
        points[4, i] = 0.5 * (knee + ankle)
        lower = 0.5 * legs.ankle_height * foot[i, 2]
        points[5, i] = ankle + sole_centre * foot[i, 0] - lower
    return points, foot


@compiled
def leg_joints(legs: Legs, side: float, ankle: Array, foot: Array) -> Array:
    """Solve a leg's inverse kinematics in closed form.

    A target out of reach is met in direction, with the leg as straight as it gets.

    Args:
        legs: the robot.
        side: +1 left, -1 right.
        ankle: (3,) ankle in the pelvis frame [m].
        foot: (3, 3) rotation of the foot in the pelvis frame.

    Returns:
        (6,) joint angles [rad]; the knee bends forward.
    """
    to_hip = np.empty(3)
    to_hip[0] = -ankle[0]
    to_hip[1] = 0.5 * side * legs.hip_width - ankle[1]
    to_hip[2] = -ankle[2]
    seen = turned_back(foot, to_hip)  # the hip as the foot sees it
    upward = math.hypot(seen[1], seen[2])
    reach = min(math.hypot(seen[0], upward), _STRAIGHTEST * (legs.femur + legs.crus))
    bend = (reach**2 - legs.femur**2 - legs.crus**2) / (2.0 * legs.femur * legs.crus)
    joints = np.empty(6)
    joints[3] = math.acos(min(max(bend, -1.0), 1.0))
    lean = math.atan2(
        legs.femur * math.sin(joints[3]),
        legs.crus + legs.femur * math.cos(joints[3]),
    )
    joints[4] = -lean - math.atan2(seen[0], upward)
    joints[5] = math.atan2(seen[1], seen[2])
    thigh = pitched(rolled(foot, -joints[5]), -joints[4] - joints[3])
    joints[0] = math.atan2(-thigh[0, 1], thigh[1, 1])
    joints[1] = math.asin(min(max(thigh[2, 1], -1.0), 1.0))
    joints[2] = math.atan2(-thigh[2, 0], thigh[2, 2])
    return joints


@compiled
def com_from_pelvis(legs: Legs, joints: Array, level: Array) -> Array:
    """Return the CoM of the whole robot from the pelvis, in the level frame.

    Args:
        legs: the robot.
        joints: (12,) joint angles, left leg first [rad].
        level: (3, 3) rotation from the pelvis frame to the level frame.

    Returns:
        (3,) [m].
    """
    moment = np.zeros(3)
    moment[2] = legs.trunk_com * legs.trunk_mass
    for leg in range(2):
        side = 1.0 - 2.0 * leg
        points, _ = leg_links(legs, side, joints[6 * leg : 6 * leg + 6])
        for i in range(3):
            moment[i] += (
                legs.femur_mass * points[3, i]
                + legs.crus_mass * points[4, i]
                + legs.foot_mass * points[5, i]
            )
    return turned(level, moment / legs.mass)


@compiled
def holding_torques(
    legs: Legs,
    side: float,
    joints: Array,
    force: Array,
    zmp_x: float,
    zmp_y: float,
    acceleration: Array,
) -> Array:
    """Return the servo torques that carry a leg: ground force, weight, inertia.

    tau_j = -a_j . sum((r - o_j) x F) over the ground force at the ZMP and each link's
    weight and inertial force, with axis a_j and centre o_j of joint j.

    Args:
        legs: the robot.
        side: +1 left, -1 right.
        joints: (6,) joint angles, with the trunk upright [rad].
        force: (3,) ground force on the sole, level frame [N].
        zmp_x: where it acts, ahead of the ankle in the sole [m].
        zmp_y: the same, left of the ankle [m].
        acceleration: (3, 3) of the CoMs of femur, crus and foot, level frame [m/s^2].

    Returns:
        (6,) torques [N m].
    """
    points, foot = leg_links(legs, side, joints)
    masses = (legs.femur_mass, legs.crus_mass, legs.foot_mass)
    yawed = yaw_rotation(joints[0])
    tilted = rolled(yawed, joints[1])
    axes = np.empty((6, 3))
    axes[0] = (0.0, 0.0, 1.0)
    axes[1] = yawed[:, 0]
    axes[2] = axes[3] = axes[4] = tilted[:, 1]
    axes[5] = foot[:, 0]
    acts = np.empty(3)
    for i in range(3):
        lever = zmp_x * foot[i, 0] + zmp_y * foot[i, 1]
        acts[i] = points[2, i] + lever - legs.ankle_height * foot[i, 2]
    torques = np.empty(6)
    for j in range(6):
        origin = points[0] if j < 3 else points[1] if j == 3 else points[2]
        moment = _cross_dot(axes[j], acts, origin, force[0], force[1], force[2])
        for link in range(0 if j < 3 else 1 if j == 3 else 2, 3):
            mass, a = masses[link], acceleration[link]
            moment += _cross_dot(
                axes[j],
                points[3 + link],
                origin,
                -mass * a[0],
                -mass * a[1],
                -mass * (a[2] + GRAVITY),
            )
        torques[j] = -moment
    return torques


@compiled
def _cross_dot(
    axis: Array, at: Array, origin: Array, fx: float, fy: float, fz: float
) -> float:
    """Axis . ((at - origin) x f)."""
    x, y, z = at[0] - origin[0], at[1] - origin[1], at[2] - origin[2]
    return float(
        axis[0] * (y * fz - z * fy)
        + axis[1] * (z * fx - x * fz)
        + axis[2] * (x * fy - y * fx)
    )
