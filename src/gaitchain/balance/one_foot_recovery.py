"""Keep a robot up that leans over the outer edge of its support foot. Compiled, ours.

Sideways a foot can only land on its own side of the other one. So a DCM that is pushed
outside the support foot is not caught by a step; it can come back by itself, as long as
the ZMP is further out. Until it has, the robot waits on that foot: the swing foot stays
up, the ZMP at the sole's edge.

And the trunk is thrown into the fall, as a person does who walks on a beam. While it
turns, the ground pushes the CoM back: I theta w^2 / (m g) is what the DCM gains by a
lean of theta. RES gains 28 mm by 0.4 rad; its sole's edge is 65 mm from the ankle.
"""

from gaitchain.balance.compiled import compiled
from gaitchain.balance.curves import clip
from gaitchain.balance.leg_kinematics import Legs, Posture, com_from_pelvis, posture
from gaitchain.balance.packed_state import Walk
from gaitchain.balance.pendulum import dcm_of
from gaitchain.balance.rotations import product, rotation, turned
from gaitchain.balance.state import SINGLE, Lean, Planar
from gaitchain.messages import Array

_AHEAD = 1.5  # of the sole's front: as far as a DCM may be while the robot waits
_SUDDEN = 0.24  # of rate^2 x most: the trunk's acceleration, which the hip must bear


@compiled
def measured_dcm(walk: Walk) -> Planar:
    """Return the robot's DCM from its support ankle, step frame [m]."""
    offset = walk.com_offset
    dcm = dcm_of(walk.measured.com, walk.times.omega)
    return Planar(dcm.x + offset.x, dcm.y + walk.state.side * offset.y)


@compiled
def waits_on_one_foot(legs: Legs, walk: Walk, dcm: Planar) -> float:
    """Return 1 where the robot must, and can, wait on its support foot, else 0.

    Only a pushed one must. A robot whose DCM is far ahead of the sole, or behind it,
    must step.

    Args:
        legs: the robot.
        walk: the error and `one_foot` of its state are those of the last period.
        dcm: measured, step frame [m].
    """
    gains, state = walk.gains, walk.state
    low, high = legs.sole_rear, _AHEAD * legs.sole_front
    if state.phase != SINGLE or not low < dcm.x < high:
        return 0.0
    if dcm.y > -gains.one_foot_from and state.error.y > gains.far_zone.y:
        return 1.0
    return 0.0 if dcm.y < -gains.one_foot_until else state.one_foot


@compiled
def lean_on(walk: Walk, dcm: Planar) -> Lean:
    """Return the trunk's lean one control period later.

    It leans further while the robot waits on one foot, and comes back afterwards.

    Args:
        walk: its state's `one_foot` is that of this period.
        dcm: measured, step frame [m].
    """
    gains, state = walk.gains, walk.state
    lean, rate, period = state.lean, gains.lean_rate, walk.times.period
    if state.one_foot > 0.0:
        outside = dcm.y - gains.lean_from
        further = clip(gains.lean * outside, 0.0, gains.lean_most)
        aim = state.side * max(further, state.side * lean.aim)
    else:
        aim = lean.aim * (1.0 - gains.lean_back * period)
    most = _SUDDEN * rate**2 * gains.lean_most
    pull = rate**2 * (aim - lean.angle) - 2.0 * rate * lean.speed
    speed = lean.speed + period * clip(pull, -most, most)
    return Lean(lean.angle + period * speed, speed, aim)


@compiled
def lean_shift(legs: Legs, angle: float) -> float:
    """Return how far to the left the CoM would go by a lean of the trunk [m].

    The pelvis goes as far to the other side: only so does the trunk's turning push.
    """
    return angle * legs.trunk_mass / legs.mass * float(legs.trunk_com[2])


@compiled
def seen_upright(legs: Legs, joints: Array, angle: float) -> tuple[Array, Posture]:
    """Return a reference's CoM and posture from a pelvis that does not lean.

    Args:
        legs: the robot.
        joints: (2 n,) reference joint angles [rad].
        angle: the trunk's lean to the left [rad].

    Returns:
        (3,) CoM from the pelvis that did not give way, in the trunk's heading [m]; the
        posture, turned as the trunk leans.
    """
    found = posture(legs, joints)
    com = com_from_pelvis(legs, found)
    if angle == 0.0:
        return com, found
    com = turned(rotation(0.0, 0.0, -angle), com)
    com[1] -= lean_shift(legs, angle)
    return com, _leaned(found, angle)


@compiled
def _leaned(found: Posture, angle: float) -> Posture:
    """Return a posture of a trunk that leans to the left, seen upright."""
    turn = rotation(0.0, 0.0, -angle)
    centres, axes, coms = found.centres.copy(), found.axes.copy(), found.coms.copy()
    ankles, feet = found.ankles.copy(), found.feet.copy()
    for leg in range(2):
        for j in range(centres.shape[1]):
            centres[leg, j] = turned(turn, found.centres[leg, j])
            axes[leg, j] = turned(turn, found.axes[leg, j])
            coms[leg, j] = turned(turn, found.coms[leg, j])
        ankles[leg] = turned(turn, found.ankles[leg])
        feet[leg] = product(turn, found.feet[leg])
    return Posture(centres, axes, coms, ankles, feet)
