"""The target of a step: landing and motion of the swing foot; and what was made."""

from typing import NamedTuple


class StepTarget(NamedTuple):
    """Landing and motion of the swing foot that the chain chose for a step."""

    length: float
    """Landing ankle ahead of the support ankle [m]."""
    width: float
    """Lateral distance from the support ankle to the landing ankle [m]."""
    turn: float
    """Outward turn of the landing foot [rad]."""
    share: float
    """kp_2: part of the swing path completed when the foot is highest."""
    share_rate: float
    """kp_2: rate of `share` per single support."""
    lift: float
    """kp_2: height of the foot [m]."""
    landing_rate: float
    """kp_3: speed along the path at touch-down, path lengths per single support."""
    fall_rate: float
    """kp_3: downward speed at touch-down, lifts per single support."""
    stops: float
    """1 if the robot stands at the end of the step, else 0."""
    usual_error: float
    """Largest DCM error that such a step usually has [m]."""
    next_width: float
    """`width` of the step that is expected to follow [m]."""


class Landing(NamedTuple):
    """Landing of the swing foot, the parameters of `strides.STRIDE`."""

    length: float
    """Landing ankle ahead of the support ankle [m]."""
    outward: float
    """Lateral distance of the ankles beyond the hip width [m]."""
    turn: float
    """Outward turn of the landing foot [rad]."""


class Step(NamedTuple):
    """A step made, as the legs measured it at touch-down."""

    ahead: float
    """[m]"""
    left: float
    """[m]"""
    turn: float
    """To the left [rad]."""
    lasted: float = 1.0
    """Time that it took, in planned step times."""
