"""How low a robot's hips can go while it steps, from its legs alone.

Ankle and knee have to stay within their ranges, and the knee of the support leg has to
carry the robot. The further a stride, the further the shank leans over the foot that it
leaves behind, most where that foot is level and half up: so less is left at speed.
"""

from gaitchain.errors import UnreachableError
from gaitchain.gait.stride.shape import SINGLE_SHARE
from gaitchain.gait.stride.strides import StridePoses
from gaitchain.messages import GRAVITY
from gaitchain.robot.sagittal_leg import SagittalLeg, sagittal_leg

# Parts of half the ranges of hip, knee, ankle: as of strides that are feasible, but the
# ankle also balances. With 0.98 of it 2 of 10 fast walks of T1 fell.
_HEADROOM = (0.98, 0.98, 0.95)
_TORQUE_HEADROOM = 0.8  # part of the knee's torque: the rest is for the links' motion
_FOLDED = 1.9  # rad: a leg folded further touches itself, whatever its knee's range
_ROUNDS = 12  # halvings: to a fifth of a millimetre for a leg of one metre


def deepest_crouch(poses: StridePoses, stride: float) -> float:
    """Return how much lower the hips can go in steady steps of one length [m].

    Args:
        poses: the candidates.
        stride: their length [m].

    Returns:
        0 where there is no room, or the leg does not bend in one plane.
    """
    leg = sagittal_leg(poses.robot.legs)
    if leg is None:
        return 0.0
    # A hind foot leaves when double support ends, half of that after the step's middle.
    ahead = (0.5 + 0.5 * (1.0 - SINGLE_SHARE)) * stride
    low, high = 0.0, poses.hip_height
    for _ in range(_ROUNDS):
        middle = 0.5 * (low + high)
        if _holds(poses, leg, poses.hip_height - middle, ahead):
            low = middle
        else:
            high = middle
    return low


def _holds(poses: StridePoses, leg: SagittalLeg, height: float, ahead: float) -> bool:
    """Return whether the legs bear a pelvis at a height.

    Args:
        poses: the candidates.
        leg: of the robot, in its plane.
        height: pelvis above the ankles [m].
        ahead: how far it is ahead of its place over a foot that leaves [m].
    """
    legs, biped = poses.robot.legs, poses.robot.reduced
    over = leg.stands_ahead(legs)
    lift = float(poses.parameters[1][:, 2].max())
    try:
        stands = leg.bend(over, height)
        leaves = leg.bend(over + ahead, height - 0.5 * lift)  # as far behind, half up
        swings = leg.bend(over, height - lift)
    except UnreachableError:
        return False
    if swings.fold > _FOLDED:
        return False
    knee = leg.joints[1]
    lever = stands.knee_ahead - biped.sole_offset
    needed = legs.mass * GRAVITY * abs(lever)  # a knee may bend backward
    carried = needed <= _TORQUE_HEADROOM * legs.torque_limit[knee]
    bends = stands, leaves, swings
    return carried and all(leg.within(legs, bend, _HEADROOM) for bend in bends)
