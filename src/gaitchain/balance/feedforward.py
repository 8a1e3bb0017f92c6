"""From reference joint angles to servo targets: what the servos would otherwise lack.

A position servo pushes with kp (target - q) - kv q'. So that q follows the reference,
the target leads it by the torque that the pose needs and by the damping,
q_target = q_ref + (tau + kv q'_ref) / kp. Ours. Everything here is compiled.
"""

import numpy as np

from gaitchain.balance.compiled import compiled
from gaitchain.balance.leg_kinematics import Legs, Posture
from gaitchain.balance.state import Planar
from gaitchain.messages import GRAVITY, Array

_FASTEST = 20.0  # rad/s: a reference faster than this has jumped
_HARDEST = 40.0  # m/s^2: the same for the swing foot's links
_SMOOTH = 0.5  # of a new acceleration in the filtered one


@compiled
def track_links(found: Posture, links: Array, period_s: float) -> None:
    """Note where the legs' links are, and from that how they move.

    Args:
        found: reference posture.
        links: (2, 3, n, 3) CoMs, velocities and accelerations; rewritten.
        period_s: control period [s].
    """
    for leg in range(2):
        own = links[leg]
        for link in range(found.coms.shape[1]):
            for i in range(3):
                at = found.coms[leg, link, i]
                speed = (at - own[0, link, i]) / period_s
                jump = (speed - own[1, link, i]) / period_s
                new = min(max(jump, -_HARDEST), _HARDEST)
                own[0, link, i] = at
                own[1, link, i] = speed
                own[2, link, i] += _SMOOTH * (new - own[2, link, i])


@compiled
def multi_link_zmp(
    legs: Legs, links: Array, pelvis: Array, pull_x: float, pull_y: float
) -> Planar:
    """Return the ZMP of the reference motion of all links.

    p = sum m_i ((g + z''_i) x_i - z_i x''_i) / sum m_i (g + z''_i), the paper's
    multi-link ZMP, here over trunk and the legs' links as points.

    Args:
        legs: the robot.
        links: (2, 3, n, 3) from `track_links`.
        pelvis: (3,) above the ground, where the ZMP is to be given [m].
        pull_x: acceleration of the pelvis [m/s^2].
        pull_y: the same to the left.

    Returns:
        ZMP in the frame of `pelvis` [m].
    """
    weight = legs.trunk_mass * GRAVITY
    height = legs.trunk_mass * (pelvis[2] + legs.trunk_com[2])
    x = weight * (pelvis[0] + legs.trunk_com[0]) - height * pull_x
    y = weight * (pelvis[1] + legs.trunk_com[1]) - height * pull_y
    for leg in range(2):
        for link in range(links.shape[2]):
            at, a = links[leg, 0, link], links[leg, 2, link]
            mass = legs.link_mass[leg, link]
            up = mass * (GRAVITY + a[2])
            height = mass * (pelvis[2] + at[2])
            x += up * (pelvis[0] + at[0]) - height * (pull_x + a[0])
            y += up * (pelvis[1] + at[1]) - height * (pull_y + a[1])
            weight += up
    return Planar(x / weight, y / weight)


@compiled
def load_torques(
    legs: Legs,
    found: Posture,
    side: float,
    force: Array,
    share: float,
    zmp: Planar,
    other_zmp: Planar,
    links: Array,
    inertia: float,
) -> Array:
    """Return the torques of all joints under the planned ground force.

    Args:
        legs: the robot.
        found: reference posture.
        side: +1 left, -1 right foot supports.
        force: (3,) ground force, in the trunk's heading [N].
        share: part of it on the support foot.
        zmp: where it acts in the support sole, step frame [m].
        other_zmp: the same in the other sole.
        links: (2, 3, n, 3) from `track_links`.
        inertia: part of the other leg's accelerations that counts.

    Returns:
        (2 n,) [N m].
    """
    count = legs.link_mass.shape[1]
    torques = np.empty(2 * count)
    first = 0 if side > 0 else 1
    second = 1 - first
    torques[first * count : (first + 1) * count] = holding_torques(
        legs, found, first, share * force, zmp.x, side * zmp.y, links[first, 2], 0.0
    )
    torques[second * count : (second + 1) * count] = holding_torques(
        legs,
        found,
        second,
        (1.0 - share) * force,
        other_zmp.x,
        side * other_zmp.y,
        links[second, 2],
        inertia,
    )
    return torques


@compiled
def holding_torques(
    legs: Legs,
    found: Posture,
    leg: int,
    force: Array,
    zmp_x: float,
    zmp_y: float,
    acceleration: Array,
    inertia: float,
) -> Array:
    """Return the servo torques that carry a leg: ground force, weight, inertia.

    tau_j = -a_j . sum((r - o_j) x F) over the ground force at the ZMP and each link's
    weight and inertial force, with axis a_j and centre o_j of joint j.

    Args:
        legs: the robot.
        found: its posture, with the trunk upright.
        leg: 0 left, 1 right.
        force: (3,) ground force on the sole, level frame [N].
        zmp_x: where it acts, ahead of the ankle in the sole [m].
        zmp_y: the same, left of the ankle [m].
        acceleration: (n, 3) of the links' CoMs, level frame [m/s^2].
        inertia: part of it that counts.

    Returns:
        (n,) torques [N m].
    """
    count = legs.link_mass.shape[1]
    torques, foot, acts = np.empty(count), found.feet[leg], np.empty(3)
    for i in range(3):
        lever = zmp_x * foot[i, 0] + zmp_y * foot[i, 1]
        acts[i] = found.ankles[leg, i] + lever - legs.ankle_height * foot[i, 2]
    # Force and moment about the pelvis of all that acts beyond the joint.
    fx, fy, fz = force[0], force[1], force[2]
    mx = acts[1] * fz - acts[2] * fy
    my = acts[2] * fx - acts[0] * fz
    mz = acts[0] * fy - acts[1] * fx
    for j in range(count - 1, -1, -1):
        mass, at = legs.link_mass[leg, j], found.coms[leg, j]
        px = -mass * inertia * acceleration[j, 0]
        py = -mass * inertia * acceleration[j, 1]
        pz = -mass * (GRAVITY + inertia * acceleration[j, 2])
        fx, fy, fz = fx + px, fy + py, fz + pz
        mx += at[1] * pz - at[2] * py
        my += at[2] * px - at[0] * pz
        mz += at[0] * py - at[1] * px
        o, a = found.centres[leg, j], found.axes[leg, j]
        torques[j] = -(
            a[0] * (mx - o[1] * fz + o[2] * fy)
            + a[1] * (my - o[2] * fx + o[0] * fz)
            + a[2] * (mz - o[0] * fy + o[1] * fx)
        )
    return torques


@compiled
def lead(
    legs: Legs, joints: Array, before: Array, torques: Array, period_s: float
) -> Array:
    """Return the servo targets that make the joints follow the reference, (2 n,) [rad].

    Args:
        legs: the robot.
        joints: (2 n,) reference [rad].
        before: (2 n,) reference one control period ago [rad].
        torques: (2 n,) that the pose needs [N m].
        period_s: control period [s].
    """
    targets = np.empty(joints.shape[0])
    for j in range(joints.shape[0]):
        rate = min(max((joints[j] - before[j]) / period_s, -_FASTEST), _FASTEST)
        load = torques[j] + legs.damping[j] * rate
        targets[j] = joints[j] + load / legs.stiffness[j]
    return targets
