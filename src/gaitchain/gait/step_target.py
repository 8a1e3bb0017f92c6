"""What a step shall do: where it lands, and how its foot swings there."""

from typing import NamedTuple


class StepTarget(NamedTuple):
    """What the chain chose for this step."""

    length: float
    """Landing ankle ahead of the support ankle [m]."""
    width: float
    """Landing ankle beside the support ankle [m]."""
    turn: float
    """Landing foot's turn to the outside [rad]."""
    share: float
    """kp_2: part of its way that the foot has gone when it is highest."""
    share_rate: float
    """kp_2: the same per single support."""
    lift: float
    """kp_2: height of the foot [m]."""
    landing_rate: float
    """kp_3: speed along the way at touch-down, ways per single support."""
    fall_rate: float
    """kp_3: speed down at touch-down, lifts per single support."""
    stops: float
    """1 where the step ends standing, else 0."""


class Landing(NamedTuple):
    """Where a stride puts the foot, as `strides.STRIDE`."""

    length: float
    """Ahead of the support ankle [m]."""
    outward: float
    """Further out than the hips are wide [m]."""
    turn: float
    """To the outside [rad]."""
