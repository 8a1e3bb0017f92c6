"""The same robot, seen from its other foot."""

import math

from gaitchain.balance.state import Foot, GaitState, Pelvis, Planar


def seen_from(other: Foot, state: GaitState) -> GaitState:
    """Return a state in the step frame of the foot that stands at `other`.

    Step frames of the right foot are mirrored, so left and right change sign.
    """
    c, s = math.cos(other.yaw), math.sin(other.yaw)

    def seen(x: float, y: float) -> tuple[float, float]:
        return c * x - s * y, -(s * x + c * y)

    p = state.pelvis
    x, y = seen(p.x - other.x, p.y - other.y)
    vx, vy = seen(p.vx, p.vy)
    old_x, old_y = seen(-other.x, -other.y)
    zmp = seen(state.zmp.x - other.x, state.zmp.y - other.y)
    return state._replace(
        side=-state.side,
        pelvis=Pelvis(x, y, vx, vy),
        pelvis_yaw=other.yaw - state.pelvis_yaw,
        lift_off=Foot(old_x, old_y, other.yaw),
        landing=Foot(old_x, old_y, other.yaw),
        zmp=Planar(*zmp),
        error=Planar(*seen(state.error.x, state.error.y)),
    )
