"""How far the robot is off its plan: the DCM error, and what counts as a push.

Every step has an error of its own, on any floor and without a push: physics measured
it at the build, for each pair of strides. What goes beyond that is a disturbance.
Compiled, ours.
"""

import math
from typing import Any

from gaitchain.balance.compiled import compiled
from gaitchain.balance.curves import clip
from gaitchain.balance.packed_state import Walk
from gaitchain.balance.pendulum import dcm_of
from gaitchain.balance.state import SINGLE, Planar


@compiled
def dcm_error(walk: Walk) -> Planar:
    """Return the DCM of the robot's CoM minus that of the reference pose, filtered.

    Both CoMs follow from joint angles, so a swinging leg's reaction is in both. How far
    the robot's CoM is off its model's is learned meanwhile.
    """
    state, omega = walk.state, walk.times.omega
    com, offset = walk.com, walk.com_offset
    yaw = -state.side * state.pelvis_yaw
    c, s = math.cos(yaw), math.sin(yaw)
    ahead = com.x + com.vx / omega
    left = com.y + com.vy / omega
    planned, seen = dcm_of(state.pelvis, omega), dcm_of(walk.measured.com, omega)
    x = planned.x + c * ahead - s * left
    y = planned.y + state.side * (s * ahead + c * left)
    new_x = seen.x - x + offset.x
    new_y = seen.y - y + state.side * offset.y
    kept = walk.gains.error_filter
    return Planar(
        new_x + kept * (state.error.x - new_x), new_y + kept * (state.error.y - new_y)
    )


@compiled
def pushed_error(walk: Walk) -> float:
    """Return the DCM error beyond which a robot was pushed in this step [m]."""
    return walk.target.usual_error + walk.gains.pushed


@compiled
def learn_offset(walk: Any) -> None:
    """Move the learned CoM offset by the error's mean over left and right steps.

    The ankles hold a robot that is heavier on one side only where the error stays; so
    the reference is moved until it does not. From a pushed robot nothing is learned.
    """
    gains, state = walk.gains, walk.state
    error, offset = state.error, walk.com_offset
    if state.phase != SINGLE or math.hypot(error.x, error.y) > pushed_error(walk):
        return
    part, most = gains.learning * walk.times.period, gains.offset_reach
    offset.x = clip(offset.x + part * error.x, -most, most)
    offset.y = clip(offset.y + part * state.side * error.y, -most, most)
