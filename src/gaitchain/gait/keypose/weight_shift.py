"""How far a robot that was read from a file sways in the paper's walk. Ours.

The ranges of the default preset were found for RES, whose servos sag: there the swing
foot leaves the ground while the CoM is still between the feet, and the robot rolls onto
the support foot. Another robot's servos follow the plan (`balance.keypose_lead`), so
its CoM has to be over the support sole before the other foot leaves, and has to stay
there until that foot is down.
"""

import math
from typing import NamedTuple

from gaitchain.errors import UnreachableError
from gaitchain.gait.keypose.presets import CROUCH, geometric_sway
from gaitchain.gait.motion import Timing
from gaitchain.messages import GRAVITY
from gaitchain.robot.robot import Robot

_INSIDE = 0.55  # of the sole's half width: CoM towards the other foot from the middle
_LEAST = 0.8  # the same, for a robot whose joints allow no more
_MORE = 0.1  # of the sway that brings the CoM over the middle: range at kp_2
_EDGE = 0.8  # of the sole's half width: where the ZMP may be as the weight shifts
_SHORTEST, _LONGEST = 0.2, 0.55  # of a step: double support
_RISE = 0.25  # of single support: until the foot is at its highest


class WeightShift(NamedTuple):
    """Sway over the support foot, and the times of a step that it leaves."""

    sway: float
    """Least sway while one foot is in the air [rad]."""
    most: float
    """Largest sway [rad]."""
    timing: Timing
    """Times of a step."""


def weight_shift(robot: Robot, allowed: float, step_s: float) -> WeightShift:
    """Return the sway that carries a robot's weight, and the time to shift it.

    A cubic over T_c from one side to the other accelerates by 6 (s + s) d / T_c^2 at
    its ends, d half the distance of the feet and s the part of it that the CoM sways;
    the ZMP is then s d + 12 s d / (omega T_c)^2 off the middle and has to be on the
    sole, of half width w: (omega T_c)^2 = 12 s / (1 + 0.8 w / d - s).

    Args:
        robot: the robot.
        allowed: largest sway that the joints allow [rad].
        step_s: time of a step T [s].

    Raises:
        UnreachableError: the joints do not allow the sway that the soles need.
    """
    height = CROUCH * robot.reduced.leg_length
    over = geometric_sway(robot, height)
    wide = robot.reduced.sole_width / robot.reduced.hip_width
    most = min(allowed, over)
    share = min(1.0 - _INSIDE * wide, most / over)
    if share < 1.0 - _LEAST * wide:
        need = math.degrees((1.0 - _LEAST * wide) * over)
        raise UnreachableError(
            f"{robot.name}: its joints allow {math.degrees(allowed):.1f} deg of sway, "
            f"{need:.1f} deg bring the CoM over one sole; wider soles, narrower hips "
            "or hips and ankles that roll further would do, or preset 'brisk'"
        )
    omega = math.sqrt(GRAVITY / (height + robot.reduced.ankle_height))
    time_s = math.sqrt(12.0 * share / (1.0 + _EDGE * wide - share)) / omega
    both = min(max(time_s, _SHORTEST * step_s), _LONGEST * step_s)
    single = step_s - both
    timing = Timing(step_s, _RISE * single, (1.0 - _RISE) * single)
    return WeightShift(share * over, min((share + _MORE) * over, most), timing)
