"""The gains of the balance: named, documented, and scaled to the robot."""

from typing import NamedTuple

from gaitchain.online.compiled import compiled
from gaitchain.online.state import Planar


class Gains(NamedTuple):
    """Every gain of the balance, in SI units; `derive_gains` scales them to a robot."""

    dead_zone: Planar
    """Errors that are left to the servos [m]."""
    follow: Planar
    """How fast the reference takes over errors beyond that [1/s]."""
    far_zone: Planar
    """Errors beyond which the robot was pushed [m]."""
    far_follow: Planar
    """How fast the reference takes those over [1/s]."""
    ankle: Planar
    """ZMP shift per error, where servos are stiff against m g h."""
    zmp_reach: Planar
    """How far the planned ZMP may leave the step's first one for balance [m]."""
    sole_margin: float
    """Between planned ZMP and the sole's edge [m]."""
    foot_zmp: Planar
    """Where in the foot the ZMP is planned: ahead, and outward [m]."""
    landing_reach: Planar
    """How far a landing may be moved [m]."""
    landing_speed: Planar
    """How fast it may be moved [m/s]."""
    narrowest: float
    """Least distance between the ankles sideways [m]."""
    fixed_s: float
    """Before touch-down the landing is no longer moved [s]."""
    hurry_beyond: Planar
    """A landing moved further than this makes the step hurry [m]."""
    fastest: float
    """Of the step's time, 1 is nominal."""
    slowest: float
    shortest_s: float
    """Left of a hurried single support [s]."""
    trunk: float
    """Part of the trunk's tilt that the support hip corrects."""
    swing_tilt: float
    """Part of the trunk's tilt that the swing leg allows for."""
    error_filter: float
    """Part of the old error that is kept, each control period."""
    counter_swing: float
    """How far the pelvis gives way to the swing foot, part of the foot's lead."""
    inertia: float
    """Part of the swing leg's inertia that the servos are told of."""
    heading: float
    """Part of a heading error that one step corrects."""
    odometry: float
    """Part of the distance owed that one step corrects."""


@compiled
def clip(value: float, low: float, high: float) -> float:
    """Return the value, held between its bounds."""
    return min(max(value, low), high)
