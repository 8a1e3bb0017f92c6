"""The full robot's legs online: where everything is, how it moves, IK. Compiled.

Frames: *pelvis* has its origin at a point fixed to the trunk between the hips, x
forward, y left, z up. *Level* is the same point and heading with z vertical. A leg is
given by `side`, +1 for the left and -1 for the right, or by its index, 0 and 1; joints
run from hip to ankle, the left leg's first.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from gaitchain.balance.compiled import compiled
from gaitchain.balance.rotations import about
from gaitchain.messages import GRAVITY, Array
from gaitchain.robot.leg_model import MOSTLY, LegModel, Soles
from gaitchain.robot.robot import Robot

_BENDS = 181  # knee angles that are tried to find the straight leg
# Of the leg: a narrower sole stays as it landed. G1's is 0.076, Berkeley's 0.137 wide.
_NARROW = 0.1
_FIRM = 0.75  # of the width that counts: a tapered sole bears the ZMP where it is wider
_SLICES = 101  # places along a sole at which its width is looked at
_STRAIGHTEST = 0.999  # of the leg: a knee straighter than this moves too fast


class Legs(NamedTuple):
    """The numbers of the robot that walking online needs, SI units.

    Geometry is that of `LegModel`, with all leg joints at 0.
    """

    at: Array
    """(2, n, 3) joint centres, each from the one before."""
    axis: Array
    """(2, n, 3)"""
    com: Array
    """(2, n, 3) CoM of each link, from its joint's centre."""
    link_mass: Array
    """(2, n)"""
    foot_at: Array
    """(2, 3) ankle point from the last joint's centre."""
    foot_turn: Array
    """(2, 3, 3) the sole's axes."""
    trunk_mass: float
    trunk_com: Array
    """(3,) from the pelvis."""
    mass: float
    start: Array
    """(2 n,) a pose with bent knees, from which the IK begins [rad]."""
    knee: int
    """Index of the knee in a leg."""
    ankle_rolls: int
    """1 where the ankle has a roll joint, so that the sole can lie flat; else 0."""
    foot_tells_roll: int
    """1 where such a sole does: it is no narrower than a tenth of the leg; else 0."""
    lower: Array
    """(2 n,) least joint angles [rad]."""
    upper: Array
    stiffness: Array
    """(2 n,) of the servos [N m/rad]."""
    damping: Array
    """(2 n,) of the servos [N m s/rad]."""
    leg: float
    """Length of the straight leg from hip to ankle."""
    reach: float
    """How far the IK stretches it."""
    hip_width: float
    """Between the ankle points of a standing robot."""
    ankle_height: float
    sole_front: float
    """Front edge of the sole, x from the ankle point."""
    sole_rear: float
    sole_half_width: float
    sole_taper: float
    """How much a sole on its edge is pitched up for each radian that it leans: a side
    edge's slope, which is 0 along the foot."""
    firm_front: float
    """Front end of where a sole that tapers is three quarters as wide as it counts,
    ahead of the ankle; of any other one its own end."""
    firm_rear: float
    zmp_front: float
    """How far ahead of the ankle the ZMP of one foot can be: the ankle's torque bounds
    it, or the sole."""
    zmp_rear: float
    zmp_half_width: float
    stand_front: float
    """The same as `zmp_front` where two feet share the weight."""
    stand_rear: float

    def __reduce__(self) -> tuple[Any, ...]:
        """Return how a copy is made: with arrays that are read-only as these are."""
        return _ordered, tuple(self)


class Posture(NamedTuple):
    """Where the parts of both legs are, in the pelvis frame."""

    centres: Array
    """(2, n, 3) of the joints."""
    axes: Array
    """(2, n, 3) of the joints."""
    coms: Array
    """(2, n, 3) of the links."""
    ankles: Array
    """(2, 3)"""
    feet: Array
    """(2, 3, 3) rotations of the soles."""


def legs_of(robot: Robot) -> Legs:
    """Collect what walking online needs of a robot."""
    full = robot.legs
    rear, front = robot.reduced.sole_x
    half = 0.5 * robot.reduced.sole_width
    leg = robot.reduced.leg_length
    along, across = _ankle_levers(full)
    firm_rear, firm_front = _firm(robot)
    legs = Legs(
        at=full.at,
        axis=full.axis,
        com=full.com,
        link_mass=full.link_mass,
        foot_at=full.foot_at,
        foot_turn=full.foot_turn,
        trunk_mass=float(full.trunk_mass),
        trunk_com=full.trunk_com,
        mass=full.mass,
        start=full.stand,
        knee=full.knee,
        ankle_rolls=int(np.isfinite(across)),
        foot_tells_roll=int(np.isfinite(across) and 2.0 * half >= _NARROW * leg),
        lower=full.lower,
        upper=full.upper,
        stiffness=full.stiffness,
        damping=full.damping,
        leg=leg,
        reach=_reach(full),
        hip_width=robot.reduced.hip_width,
        ankle_height=robot.reduced.ankle_height,
        sole_front=front,
        sole_rear=rear,
        sole_half_width=half,
        sole_taper=_taper(full.soles, 0.5 * (rear + front)),
        firm_front=firm_front,
        firm_rear=firm_rear,
        zmp_front=min(front, along),
        zmp_rear=max(rear, -along),
        zmp_half_width=min(half, across),
        stand_front=min(front, 2.0 * along),
        stand_rear=max(rear, -2.0 * along),
    )
    return _ordered(*legs)


def _taper(soles: Soles, middle: float) -> float:
    """Return the mean slope, to the outside, of the soles' side edges at their middle.

    Args:
        soles: see `LegModel.soles`.
        middle: x at which a side edge counts [m].
    """
    slopes = []
    for sole in soles:
        for (x, y), (to_x, to_y) in zip(sole, (*sole[1:], sole[0]), strict=True):
            if min(x, to_x) <= middle < max(x, to_x):
                outward = 1.0 if y + to_y > 0.0 else -1.0
                slopes.append(outward * (to_y - y) / (to_x - x))
    return float(np.mean(slopes)) if slopes else 0.0


def _firm(robot: Robot) -> tuple[float, float]:
    """Return between which x, to a hundredth, soles that taper are wide [m].

    On a point behind the ankle a robot is not held upright aside.
    """
    soles, least = robot.legs.soles, _FIRM * robot.reduced.sole_width
    if not soles:
        return robot.reduced.sole_x
    along = [corner[0] for sole in soles for corner in sole]
    xs = np.linspace(min(along), max(along), _SLICES).tolist()
    wide = [x for x in xs if min(_width(sole, x) for sole in soles) >= least]
    return (wide or xs)[0], (wide or xs)[-1]


def _width(sole: tuple[tuple[float, float], ...], x: float) -> float:
    """Return how wide a sole is at one x; 0 where there is none [m]."""
    ys = [
        y + (to_y - y) * (x - from_x) / (to_x - from_x)
        for (from_x, y), (to_x, to_y) in zip(sole, (*sole[1:], sole[0]), strict=True)
        if min(from_x, to_x) <= x <= max(from_x, to_x) and from_x != to_x
    ]
    return max(ys) - min(ys) if ys else 0.0


def _ankle_levers(full: LegModel) -> tuple[float, float]:
    """Return torque limit over m g of the ankle's pitch and roll [m].

    On one foot the ZMP is no further from the ankle than that. A leg without an ankle
    roll has no such limit across, infinity: its sole gives way by the hip.
    """
    limits = full.torque_limit.reshape(2, -1).min(axis=0)
    levers = []
    for turned in (1, 0):
        own = limits[ankle_joints(full, turned)]
        levers.append(float(own[0]) if own.size else np.inf)
    weight = full.mass * GRAVITY
    return levers[0] / weight, levers[1] / weight


def ankle_joints(legs: Legs | LegModel, turned: int) -> list[int]:
    """Return which joints below the knee turn about an axis, in the order of a leg.

    Args:
        legs: the robot; right legs are as left ones.
        turned: 0 for roll, 1 for pitch.

    Returns:
        Their indices in the left leg, often one.
    """
    below = range(legs.knee + 1, legs.axis.shape[1])
    return [j for j in below if abs(legs.axis[0, j, turned]) > MOSTLY]


def _ordered(*numbers: Any) -> Legs:
    return Legs(*map(_in_order, numbers))


def _in_order(value: Any) -> Any:
    """Return an array in C order, read-only: any other would be compiled for anew."""
    if not isinstance(value, np.ndarray):
        return value
    array = np.ascontiguousarray(value)
    array.setflags(write=False)
    return array


def _reach(full: LegModel) -> float:
    """Distance from hip to ankle with the knee nearly straight [m]."""
    knee = full.knee
    bends = np.linspace(full.lower[knee], full.upper[knee], _BENDS)
    thigh, shank, axis = full.at[0, knee], full.at[0, knee + 1], full.axis[0, knee]
    longest = max(
        float(np.linalg.norm(thigh + about(axis, float(b)) @ shank)) for b in bends
    )
    return _STRAIGHTEST * longest


@compiled
def posture(legs: Legs, joints: Array) -> Posture:
    """Locate the parts of both legs.

    Args:
        legs: the robot.
        joints: (2 n,) joint angles [rad].

    Returns:
        Points, axes and rotations in the pelvis frame.
    """
    count = legs.link_mass.shape[1]
    found = unplaced(count)
    for leg in range(2):
        place_leg(legs, leg, joints[count * leg : count * (leg + 1)], found)
    return found


@compiled
def unplaced(count: int) -> Posture:
    """Make room for a posture of so many joints a leg; nothing is in place."""
    return Posture(
        np.empty((2, count, 3)),
        np.empty((2, count, 3)),
        np.empty((2, count, 3)),
        np.empty((2, 3)),
        np.empty((2, 3, 3)),
    )


@compiled
def place_leg(legs: Legs, leg: int, joints: Array, found: Posture) -> None:
    """Locate the parts of one leg; the result is written to its half of `found`.

    Row by row r of the rotation so far, r R(a, q) = r cos q + (r x a) sin q
    + (r . a) a (1 - cos q), Rodrigues' formula without a matrix product.
    """
    turn, at = found.feet[leg], found.ankles[leg]  # so far; the last ones stay
    for i in range(3):
        at[i] = 0.0
        for k in range(3):
            turn[i, k] = 1.0 if i == k else 0.0
    for j in range(joints.shape[0]):
        ahead, a, own = legs.at[leg, j], legs.axis[leg, j], legs.com[leg, j]
        cos, sin = math.cos(joints[j]), math.sin(joints[j])
        for i in range(3):
            x, y, z = turn[i, 0], turn[i, 1], turn[i, 2]
            at[i] += x * ahead[0] + y * ahead[1] + z * ahead[2]
            found.centres[leg, j, i] = at[i]
            along = x * a[0] + y * a[1] + z * a[2]
            found.axes[leg, j, i] = along
            rest = along * (1.0 - cos)
            turn[i, 0] = cos * x + sin * (y * a[2] - z * a[1]) + rest * a[0]
            turn[i, 1] = cos * y + sin * (z * a[0] - x * a[2]) + rest * a[1]
            turn[i, 2] = cos * z + sin * (x * a[1] - y * a[0]) + rest * a[2]
            lever = turn[i, 0] * own[0] + turn[i, 1] * own[1] + turn[i, 2] * own[2]
            found.coms[leg, j, i] = at[i] + lever
    foot, sole = legs.foot_at[leg], legs.foot_turn[leg]
    for i in range(3):
        x, y, z = turn[i, 0], turn[i, 1], turn[i, 2]
        at[i] += x * foot[0] + y * foot[1] + z * foot[2]
        for k in range(3):
            turn[i, k] = x * sole[0, k] + y * sole[1, k] + z * sole[2, k]


@compiled
def com_from_pelvis(legs: Legs, found: Posture) -> Array:
    """Return the CoM of the whole robot in the pelvis frame, (3,) [m]."""
    moment = legs.trunk_mass * legs.trunk_com
    for leg in range(2):
        for j in range(legs.link_mass.shape[1]):
            for i in range(3):
                moment[i] += legs.link_mass[leg, j] * found.coms[leg, j, i]
    return moment / legs.mass


@compiled
def link_speeds(
    legs: Legs, found: Posture, rates: Array, spin: Array
) -> tuple[Array, Array]:
    """Return the velocities of all links' CoMs and of both ankles.

    The pelvis turns, but its origin stands still: v = w x r along the chain, joint by
    joint.

    Args:
        legs: the robot.
        found: its posture.
        rates: (2 n,) joint velocities [rad/s].
        spin: (3,) angular velocity of the pelvis, in its frame [rad/s].

    Returns:
        (2, n, 3) and (2, 3), pelvis frame [m/s].
    """
    count = legs.link_mass.shape[1]
    links, ankles = np.empty((2, count, 3)), np.empty((2, 3))
    turning, speed, arm, moved = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    point = np.empty(3)
    for leg in range(2):
        for i in range(3):
            turning[i], speed[i], point[i] = spin[i], 0.0, 0.0
        for j in range(count):
            for i in range(3):
                arm[i] = found.centres[leg, j, i] - point[i]
                point[i] = found.centres[leg, j, i]
            cross(turning, arm, moved)
            for i in range(3):
                speed[i] += moved[i]
                turning[i] += rates[count * leg + j] * found.axes[leg, j, i]
                arm[i] = found.coms[leg, j, i] - point[i]
            cross(turning, arm, moved)
            for i in range(3):
                links[leg, j, i] = speed[i] + moved[i]
        for i in range(3):
            arm[i] = found.ankles[leg, i] - point[i]
        cross(turning, arm, moved)
        for i in range(3):
            ankles[leg, i] = speed[i] + moved[i]
    return links, ankles


@compiled
def com_velocity(legs: Legs, links: Array, trunk: Array) -> Array:
    """Return the velocity of the CoM, (3,) [m/s].

    Args:
        legs: the robot.
        links: (2, n, 3) velocities of the links' CoMs [m/s].
        trunk: (3,) that of the trunk's CoM [m/s].
    """
    moment = legs.trunk_mass * trunk
    for leg in range(2):
        for j in range(legs.link_mass.shape[1]):
            for i in range(3):
                moment[i] += legs.link_mass[leg, j] * links[leg, j, i]
    return moment / legs.mass


@compiled
def angular_momentum(legs: Legs, coms: Array, links: Array, trunk: Array) -> Array:
    """Return the angular momentum about the CoM over the mass, (3,) [m^2/s].

    L / m = sum m_i / m r_i x v_i - c x v, trunk and links as points. Any velocity of
    the pelvis drops out of it.

    Args:
        legs: the robot.
        coms: (2, n, 3) of the links, from the pelvis [m].
        links: (2, n, 3) their velocities [m/s].
        trunk: (3,) velocity of the trunk's CoM [m/s].
    """
    speed, one, at = com_velocity(legs, links, trunk), np.empty(3), np.empty(3)
    total, com = np.empty(3), legs.trunk_mass * legs.trunk_com
    cross(legs.trunk_com, trunk, total)
    for i in range(3):
        total[i] *= legs.trunk_mass
    for leg in range(2):
        for j in range(legs.link_mass.shape[1]):
            mass = legs.link_mass[leg, j]
            for i in range(3):
                at[i] = mass * coms[leg, j, i]
                com[i] += at[i]
            cross(at, links[leg, j], one)
            for i in range(3):
                total[i] += one[i]
    cross(com, speed, one)
    return (total - one) / legs.mass


@compiled
def cross(a: Array, b: Array, result: Array) -> None:
    """Write a x b of two vectors, (3,), into a third."""
    result[0] = a[1] * b[2] - a[2] * b[1]
    result[1] = a[2] * b[0] - a[0] * b[2]
    result[2] = a[0] * b[1] - a[1] * b[0]
