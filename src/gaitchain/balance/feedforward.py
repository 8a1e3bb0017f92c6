"""Servo targets that make the joints follow the reference. Compiled, ours.

A position servo pushes with kp (target - q) - kv q'. So that q follows the reference,
the target leads it by the torque that the pose needs and by the damping,
q_target = q_ref + (tau + kv q'_ref) / kp. The torque is that of the planned ground
force, of the links' weight, and of the swing leg's inertia.
"""

from typing import Any, NamedTuple

import numpy as np

from gaitchain.balance.compiled import compiled
from gaitchain.balance.crouch import hips_above_ankles
from gaitchain.balance.curves import clip
from gaitchain.balance.gains import zmp_ends
from gaitchain.balance.leg_kinematics import Legs, Posture
from gaitchain.balance.packed_state import Walk, put
from gaitchain.balance.rotations import rotation, turned_back
from gaitchain.balance.state import DOUBLE, SINGLE, Planar
from gaitchain.messages import GRAVITY, Array

_EDGE = 0.14  # of the sole's half-width: how near its edge the ankles push
_FASTEST = 20.0  # rad/s: a reference faster than this has jumped
_HARDEST = 40.0  # m/s^2: the same for the swing foot's links
_ON_TOES = 0.05  # rad: pitch from which on a foot bears on its toes alone
_SMOOTH = 0.5  # of a new acceleration in the filtered one


class Effort(NamedTuple):
    """What a reference needs of its motors, beside its angles."""

    velocity: Array
    """(2 n,) [rad/s]."""
    torque: Array
    """(2 n,) [N m]."""


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


class LegLoad(NamedTuple):
    """What a leg carries."""

    force: Array
    """(3,) of the ground on the sole, in the trunk's heading [N]."""
    x: float
    """Where it acts in the sole, ahead of the ankle [m]."""
    y: float
    """The same, left of the ankle [m]."""
    inertia: float
    """Part of the links' accelerations that counts."""


@compiled
def load_torques(
    legs: Legs, found: Posture, left: LegLoad, right: LegLoad, links: Array
) -> Array:
    """Return the torques of all joints under the planned ground force.

    Args:
        legs: the robot.
        found: reference posture.
        left: what the left leg carries.
        right: what the right leg carries.
        links: (2, 3, n, 3) from `track_links`.

    Returns:
        (2 n,) [N m].
    """
    count = legs.link_mass.shape[1]
    torques = np.empty(2 * count)
    torques[:count] = holding_torques(legs, found, 0, left, links[0, 2])
    torques[count:] = holding_torques(legs, found, 1, right, links[1, 2])
    return torques


@compiled
def holding_torques(
    legs: Legs, found: Posture, leg: int, load: LegLoad, acceleration: Array
) -> Array:
    """Return the servo torques that carry a leg: ground force, weight, inertia.

    tau_j = -a_j . sum((r - o_j) x F) over the ground force at the ZMP and each link's
    weight and inertial force, with axis a_j and centre o_j of joint j.

    Args:
        legs: the robot.
        found: its posture, with the trunk upright.
        leg: 0 left, 1 right.
        load: what that leg carries.
        acceleration: (n, 3) of the links' CoMs, level frame [m/s^2].

    Returns:
        (n,) torques [N m].
    """
    count = legs.link_mass.shape[1]
    torques, foot, acts = np.empty(count), found.feet[leg], np.empty(3)
    for i in range(3):
        lever = load.x * foot[i, 0] + load.y * foot[i, 1]
        acts[i] = found.ankles[leg, i] + lever - legs.ankle_height * foot[i, 2]
    # Force and moment about the pelvis of all that acts beyond the joint.
    fx, fy, fz = load.force[0], load.force[1], load.force[2]
    mx = acts[1] * fz - acts[2] * fy
    my = acts[2] * fx - acts[0] * fz
    mz = acts[0] * fy - acts[1] * fx
    inertia = load.inertia
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
def ankle_shift(legs: Legs, walk: Walk) -> Planar:
    """Return how far the ZMP in the sole is to be off the pendulum's [m].

    The ankles push against the error, and carry the reaction of the swing leg.
    """
    gains, state = walk.gains, walk.state
    x = gains.ankle.x * state.error.x + gains.reaction.x * walk.reaction.x
    y = gains.ankle.y * state.error.y + gains.reaction.y * walk.reaction.y
    half = legs.zmp_half_width
    if state.phase != SINGLE:
        return Planar(
            clip(x, legs.stand_rear, legs.stand_rear * -0.5),
            clip(y, -0.5 * half, 0.5 * half),
        )
    edge, zmp = _EDGE * half, state.zmp
    rear, front = zmp_ends(legs, gains)
    return Planar(
        clip(x, rear + edge - zmp.x, front - edge - zmp.x),
        clip(y, -half + edge - zmp.y, half - edge - zmp.y),
    )


@compiled
def note_motion(legs: Legs, walk: Any, found: Posture, links: Array) -> None:
    """Note how the links move, and how far that puts the ZMP off the pendulum's.

    The links are taken as if the trunk had the heading of the step: their share is up
    to 14 mm aside at RES' fastest turn, and to turn it there makes no walk steadier
    (docs/experiments.md).

    Args:
        legs: the robot.
        walk: its state is the reference at the end of this period; its reaction is
            rewritten.
        found: reference posture.
        links: (2, 3, n, 3) CoMs, velocities and accelerations; rewritten.
    """
    times, state = walk.times, walk.state
    track_links(found, links, times.period)
    put(walk.reaction, Planar(0.0, 0.0))
    if state.phase != SINGLE:
        return
    side, square = state.side, times.omega**2
    pelvis = np.empty(3)
    pelvis[0], pelvis[1] = state.pelvis.x, side * state.pelvis.y
    pelvis[2] = hips_above_ankles(walk) + legs.ankle_height
    pull_x = square * (state.pelvis.x - state.zmp.x)
    pull_y = side * square * (state.pelvis.y - state.zmp.y)
    zmp = multi_link_zmp(legs, links, pelvis, pull_x, pull_y)
    put(walk.reaction, Planar(zmp.x - state.zmp.x, side * zmp.y - state.zmp.y))


@compiled
def carry(legs: Legs, walk: Any, found: Posture, links: Array) -> Array:
    """Return the torques of all joints for the planned ground force, (2 n,) [N m].

    Args:
        legs: the robot.
        walk: its `sole_zmp` is rewritten.
        found: reference posture.
        links: (2, 3, n, 3) from `note_motion`.
    """
    gains, state = walk.gains, walk.state
    shift, square = ankle_shift(legs, walk), walk.times.omega**2
    zmp = Planar(state.zmp.x + shift.x, state.zmp.y + shift.y)
    put(walk.sole_zmp, zmp)
    force = np.empty(3)
    force[0] = legs.mass * square * (state.pelvis.x - state.zmp.x)
    force[1] = state.side * legs.mass * square * (state.pelvis.y - state.zmp.y)
    force[2] = legs.mass * GRAVITY
    force = turned_back(rotation(-state.side * state.pelvis_yaw, 0.0, 0.0), force)
    share, inertia = support_share(walk), 0.0
    if state.phase == SINGLE:
        inertia = gains.inertia
        x, here, there = zmp.x, zmp.y, zmp.y
    else:
        x = gains.foot_zmp.x + shift.x
        if state.phase != DOUBLE:  # as far ahead of both ankles
            x = zmp.x - (1.0 - share) * state.lift_off.x
        here, there = gains.foot_zmp.y + shift.y, -gains.foot_zmp.y + shift.y
    toes = min(state.heel / _ON_TOES, 1.0)
    front = x + toes * (legs.sole_front - x)
    own = LegLoad(share * force, front, state.side * here, 0.0)
    other = LegLoad((1.0 - share) * force, x, state.side * there, inertia)
    if state.side > 0.0:
        return load_torques(legs, found, own, other, links)
    return load_torques(legs, found, other, own, links)


@compiled
def support_share(walk: Walk) -> float:
    """Return the part of the ground's force that the support foot is to bear."""
    times, state = walk.times, walk.state
    if state.phase == SINGLE:
        return 1.0
    if state.phase == DOUBLE:
        share = clip((times.step - state.time) / (times.step - times.single), 0.0, 1.0)
        return share if walk.target.stops == 0.0 else 0.5 + 0.5 * share
    return clip(1.0 - state.zmp.y / state.lift_off.y, 0.0, 1.0)


@compiled
def rates_of(joints: Array, before: Array, period_s: float) -> Array:
    """Return how fast a reference moves, (2 n,) [rad/s].

    Args:
        joints: (2 n,) reference [rad].
        before: (2 n,) reference one control period ago [rad].
        period_s: control period [s].
    """
    rates = np.empty(joints.shape[0])
    for j in range(joints.shape[0]):
        rates[j] = min(max((joints[j] - before[j]) / period_s, -_FASTEST), _FASTEST)
    return rates


@compiled
def lead(legs: Legs, joints: Array, rates: Array, torques: Array) -> Array:
    """Return the servo targets that make the joints follow the reference, (2 n,) [rad].

    Args:
        legs: the robot.
        joints: (2 n,) reference [rad].
        rates: (2 n,) of the reference [rad/s].
        torques: (2 n,) that the pose needs [N m].
    """
    targets = np.empty(joints.shape[0])
    for j in range(joints.shape[0]):
        load = torques[j] + legs.damping[j] * rates[j]
        targets[j] = joints[j] + load / legs.stiffness[j]
    return targets
