"""What may disturb the robot of a service, and how much."""

from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.limits import Limits
from gaitchain.service.schemas import (
    PUNCH_LIMITS,
    PUSH_LIMITS,
    WORLD_LIMITS,
    DisturbanceLimits,
)
from gaitchain.service.settings import Settings
from gaitchain.sim.bodies import body_names
from gaitchain.sim.push import Push

PUSH_MOST = 2.0
"""Speed by which a push or a punch may change a robot's [m/s]."""


def disturbance_limits(
    settings: Settings, library: GaitLibrary
) -> DisturbanceLimits | None:
    """Return the limits for the robot of a library; None where it is not simulated."""
    if settings.backend != "mujoco" or settings.replay is not None:
        return None
    own = settings.own_model is not None  # its bodies have names of their own
    return DisturbanceLimits(
        impulse_ns=PUSH_MOST * library.robot.legs.mass,
        bodies=(Push.body,) if own else body_names(library.robot),
        elevation_deg=_ends(PUSH_LIMITS["elevation_deg"]),
        every_s=_ends(PUNCH_LIMITS["every_s"]),
        payload=_ends(WORLD_LIMITS["payload"]),
    )


def _ends(limits: Limits) -> tuple[float, float]:
    return limits.low, limits.high
