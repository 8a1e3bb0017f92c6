"""The linear inverted pendulum and its divergent component of motion (DCM), online.

x'' = omega^2 (x - p): a point at constant height driven by the ZMP p [Kajita01]. Its
DCM xi = x + x' / omega runs away from the ZMP, xi' = omega (xi - p) [Englsberger15];
where xi is at the end of a step decides where the foot must land. Mostly one axis at a
time; everything here is compiled.
"""

import math

from gaitchain.balance.compiled import compiled
from gaitchain.balance.state import Pelvis, Planar


@compiled
def dcm_of(point: Pelvis, omega: float) -> Planar:
    """Return the DCM of a point that moves, xi = x + x' / omega [m]."""
    return Planar(point.x + point.vx / omega, point.y + point.vy / omega)


@compiled
def swing_pendulum(
    x: float, v: float, zmp: float, zmp_rate: float, omega: float, time_s: float
) -> tuple[float, float]:
    """Move the pendulum on while the ZMP moves at a constant rate.

    x(t) = p(t) + (x0 - p0) cosh(w t) + (v0 - p') / w sinh(w t).

    Args:
        x: position [m].
        v: velocity [m/s].
        zmp: p at the start [m].
        zmp_rate: p' [m/s].
        omega: w = sqrt(g / height) [1/s].
        time_s: how long [s].

    Returns:
        Position and velocity at the end.
    """
    cosh, sinh = math.cosh(omega * time_s), math.sinh(omega * time_s)
    dx, dv = x - zmp, v - zmp_rate
    moved = zmp + zmp_rate * time_s + dx * cosh + dv / omega * sinh
    return moved, zmp_rate + omega * dx * sinh + dv * cosh


@compiled
def double_support_map(omega: float, time_s: float) -> tuple[float, float, float]:
    """Weigh what decides the DCM after the ZMP went from one foot to the other.

    xi_1 = growth xi_0 + old p_old + new p_new, the ZMP moving at a constant rate.

    Args:
        omega: of the pendulum [1/s].
        time_s: duration of the double support, > 0 [s].

    Returns:
        growth, old, new; they add up to 1.
    """
    growth = math.exp(omega * time_s)
    slowness = 1.0 / (omega * time_s)
    return (
        growth,
        -slowness + (slowness - 1.0) * growth,
        1.0 + slowness - slowness * growth,
    )


@compiled
def steady_lead(length: float, new: float, growth: float) -> float:
    """Return the DCM ahead of the foot at lift-off that repeats itself step after step.

    b = (1 - new) L / (G - 1) with the DCM's growth G over the step.

    Args:
        length: L, from one step's ZMP to the next one's [m].
        new: weight of the new foot's ZMP in double support.
        growth: G, over single and double support.

    Returns:
        DCM minus ZMP at lift-off [m].
    """
    return (1.0 - new) * length / (growth - 1.0)


@compiled
def swaying_lead(width: float, after: float, new: float, growth: float) -> float:
    """Return the DCM beside the foot at lift-off that repeats itself in two steps.

    b = (1 - new) (G W - W') / (G^2 - 1), as b' = (1 - new) W - G b one step later.
    Where the feet come together after each step aside, W and W' take turns.

    Args:
        width: W, from this step's ZMP to the next one's [m].
        after: W', the same one step later [m].
        new: weight of the new foot's ZMP in double support.
        growth: G, over single and double support.

    Returns:
        DCM minus ZMP at lift-off, towards the swing foot [m].
    """
    return (1.0 - new) * (growth * width - after) / (growth * growth - 1.0)
