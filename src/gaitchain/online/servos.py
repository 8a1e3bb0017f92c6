"""From reference joint angles to servo targets: what the servos would otherwise lack.

A position servo pushes with kp (target - q) - kv q'. So that q follows the reference,
the target leads it by the torque that the pose needs and by the damping,
q_target = q_ref + (tau + kv q'_ref) / kp. Ours. Everything here is compiled.
"""

import numpy as np

from gaitchain.kinematics import Array
from gaitchain.online.compiled import compiled
from gaitchain.online.legs import GRAVITY, Legs, holding_torques, leg_links
from gaitchain.online.state import Planar

_FASTEST = 20.0  # rad/s: a reference faster than this has jumped
_HARDEST = 40.0  # m/s^2: the same for the swing foot's links
_SMOOTH = 0.5  # of a new acceleration in the filtered one


@compiled
def track_links(legs: Legs, joints: Array, links: Array, period_s: float) -> None:
    """Follow the legs' link CoMs from the pelvis and differentiate them, in place.

    Seen from the pelvis they move on smoothly when the support foot changes.

    Args:
        legs: the robot.
        joints: (12,) reference angles [rad].
        links: (2, 9, 3) of each leg positions, velocities, accelerations; rewritten.
        period_s: control period [s].
    """
    for leg in range(2):
        points, _ = leg_links(legs, 1.0 - 2.0 * leg, joints[6 * leg : 6 * leg + 6])
        own = links[leg]
        for link in range(3):
            for i in range(3):
                at = points[3 + link, i]
                speed = (at - own[link, i]) / period_s
                jump = (speed - own[3 + link, i]) / period_s
                new = min(max(jump, -_HARDEST), _HARDEST)
                own[link, i] = at
                own[3 + link, i] = speed
                own[6 + link, i] += _SMOOTH * (new - own[6 + link, i])


@compiled
def multi_link_zmp(
    legs: Legs, links: Array, pelvis: Array, pull_x: float, pull_y: float
) -> Planar:
    """Return the ZMP of the reference motion of all links.

    p = sum m_i ((g + z''_i) x_i - z_i x''_i) / sum m_i (g + z''_i), the paper's
    multi-link ZMP, here over trunk, thighs, shanks and feet as points.

    Args:
        legs: the robot.
        links: (2, 9, 3) from `track_links`.
        pelvis: (3,) above the ground, where the ZMP is to be given [m].
        pull_x: acceleration of the pelvis [m/s^2].
        pull_y: the same to the left.

    Returns:
        ZMP in the frame of `pelvis` [m].
    """
    masses = (legs.femur_mass, legs.crus_mass, legs.foot_mass)
    height = pelvis[2] + legs.trunk_com
    weight = legs.trunk_mass * GRAVITY
    x = weight * pelvis[0] - legs.trunk_mass * height * pull_x
    y = weight * pelvis[1] - legs.trunk_mass * height * pull_y
    for leg in range(2):
        for link in range(3):
            at, a, mass = links[leg, link], links[leg, 6 + link], masses[link]
            up = mass * (GRAVITY + a[2])
            height = pelvis[2] + at[2]
            x += up * (pelvis[0] + at[0]) - mass * height * (pull_x + a[0])
            y += up * (pelvis[1] + at[1]) - mass * height * (pull_y + a[1])
            weight += up
    return Planar(x / weight, y / weight)


@compiled
def load_torques(
    legs: Legs,
    side: float,
    joints: Array,
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
        side: +1 left, -1 right foot supports.
        joints: (12,) reference angles [rad].
        force: (3,) ground force, in the trunk's heading [N].
        share: part of it on the support foot.
        zmp: where it acts in the support sole, step frame [m].
        other_zmp: the same in the other sole.
        links: (2, 9, 3) from `track_links`.
        inertia: part of the other leg's accelerations that counts.

    Returns:
        (12,) [N m].
    """
    torques = np.empty(12)
    first = 0 if side > 0 else 6
    second = 6 - first
    still = np.zeros((3, 3))
    torques[first : first + 6] = holding_torques(
        legs,
        side,
        joints[first : first + 6],
        share * force,
        zmp.x,
        side * zmp.y,
        still,
    )
    torques[second : second + 6] = holding_torques(
        legs,
        -side,
        joints[second : second + 6],
        (1.0 - share) * force,
        other_zmp.x,
        side * other_zmp.y,
        inertia * (links[1 if side > 0 else 0, 6:9]),
    )
    return torques


@compiled
def lead(
    legs: Legs, joints: Array, before: Array, torques: Array, period_s: float
) -> Array:
    """Return the servo targets that make the joints follow the reference, (12,) [rad].

    Args:
        legs: the robot.
        joints: (12,) reference [rad].
        before: (12,) reference one control period ago [rad].
        torques: (12,) that the pose needs [N m].
        period_s: control period [s].
    """
    targets = np.empty(12)
    for j in range(12):
        rate = min(max((joints[j] - before[j]) / period_s, -_FASTEST), _FASTEST)
        targets[j] = joints[j] + (torques[j] + legs.damping * rate) / legs.stiffness
    return targets
