"""How stiff joints outside the legs are held: by the weight that they carry. Ours."""

LEAST = 0.01
"""Least stiffness, or limit, over the robot's m g h."""
_STIFFNESS = 8.0  # over the load of the joint
_TRAVEL = 0.1  # lever that turns the load of a slide into a stiffness [m]


def holding_stiffness(load: float, weight: float, *, hinge: bool) -> float:
    """Return the stiffness of a servo that holds a joint where it is.

    Args:
        load: moment of the weight beyond the joint, with its CoM at the side [N m].
        weight: m g h of the robot, h: of its CoM above the soles [N m].
        hinge: whether the joint turns; else it slides.

    Returns:
        [N m/rad], or [N/m] for a slide.
    """
    stiffness = max(_STIFFNESS * load, LEAST * weight)
    return stiffness if hinge else stiffness / _TRAVEL**2
