"""From reference joint angles to servo targets: what the servos would otherwise lack.

A position servo pushes with kp (target - q) - kv q'. So that q follows the reference,
the target leads it by the torque that the pose needs and by the damping,
q_target = q_ref + (tau + kv q'_ref) / kp. Ours. Everything here is compiled.
"""

import numpy as np

from gaitchain.kinematics import Array
from gaitchain.online.compiled import compiled
from gaitchain.online.legs import Legs, holding_torques, leg_links
from gaitchain.online.state import Planar

_FASTEST = 20.0  # rad/s: a reference faster than this has jumped
_HARDEST = 40.0  # m/s^2: the same for the swing foot's links
_SMOOTH = 0.5  # of a new acceleration in the filtered one


@compiled
def track_links(
    legs: Legs,
    side: float,
    joints: Array,
    pelvis: Array,
    links: Array,
    period_s: float,
    fresh: bool,
) -> None:
    """Follow the swing leg's link CoMs and differentiate them twice, in place.

    Args:
        legs: the robot.
        side: of the swing leg.
        joints: (6,) its reference angles [rad].
        pelvis: (3,) reference pelvis in a frame that stands still [m].
        links: (9, 3) positions, velocities, accelerations; rewritten.
        period_s: control period [s].
        fresh: whether the leg just began to swing: no acceleration yet.
    """
    points, _ = leg_links(legs, side, joints)
    for link in range(3):
        for i in range(3):
            at = points[3 + link, i] + pelvis[i]
            speed = (at - links[link, i]) / period_s
            jump = (speed - links[3 + link, i]) / period_s
            new = 0.0 if fresh else min(max(jump, -_HARDEST), _HARDEST)
            links[link, i] = at
            links[3 + link, i] = speed
            links[6 + link, i] += _SMOOTH * (new - links[6 + link, i])


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
        links: (9, 3) from `track_links`.
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
        inertia * links[6:9],
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
