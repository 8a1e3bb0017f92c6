"""How far the robot is off its plan: the DCM error, and what counts as a push.

Every step has an error of its own, on any floor and without a push: physics measured
it at the build, for each pair of strides. What goes beyond that is a disturbance.
Compiled, ours.
"""

import math
from typing import Any

import numpy as np

from gaitchain.balance.compiled import compiled
from gaitchain.balance.crouch import hips_above_ankles
from gaitchain.balance.curves import clip
from gaitchain.balance.leg_kinematics import (
    Legs,
    Posture,
    angular_momentum,
    com_from_pelvis,
)
from gaitchain.balance.packed_state import Walk, put
from gaitchain.balance.pendulum import dcm_of
from gaitchain.balance.servo_lag import lag_of
from gaitchain.balance.state import SINGLE, Pelvis, Planar
from gaitchain.messages import Array


@compiled
def dcm_error(walk: Walk) -> Planar:
    """Return the DCM of the robot minus that of the reference pose, filtered.

    xi = c + L / (m z w), with L the angular momentum about the foot: that of the CoM's
    speed, and what the robot turns about its CoM. No force at the foot changes it at
    once, and the pendulum predicts it better than c + c' / w [Gong22]. Both robots
    follow from joint angles, so a swinging leg's reaction is in both. How far the
    robot's CoM is off its model's is learned meanwhile, and so is how late it is: the
    reference is that of as long ago, p + (xi - p) exp(-w tau) with the planned ZMP p.
    """
    state, omega, measured = walk.state, walk.times.omega, walk.measured
    com, offset = walk.com, walk.com_offset
    part = walk.gains.turning / omega
    yaw = -state.side * state.pelvis_yaw
    c, s = math.cos(yaw), math.sin(yaw)
    ahead = com.x + com.vx / omega + part * walk.turning.x
    left = com.y + com.vy / omega + part * walk.turning.y
    planned, seen = dcm_of(state.pelvis, omega), dcm_of(measured.com, omega)
    late = 1.0 - math.exp(-omega * lag_of(walk))
    x = planned.x - late * (planned.x - state.zmp.x)
    y = planned.y - late * (planned.y - state.zmp.y)
    x += c * ahead - s * left
    y += state.side * (s * ahead + c * left)
    new_x = seen.x + part * measured.turning.x - x + offset.x
    new_y = seen.y + part * measured.turning.y - y + state.side * offset.y
    kept = walk.gains.error_filter
    return Planar(
        new_x + kept * (state.error.x - new_x), new_y + kept * (state.error.y - new_y)
    )


@compiled
def note_com(legs: Legs, walk: Any, found: Posture, links: Array) -> None:
    """Note where the reference's CoM is, how fast, and how the robot turns about it.

    Args:
        legs: the robot.
        walk: its `com` and `turning` are rewritten.
        found: reference posture.
        links: (2, 3, n, 3) from `note_motion`.
    """
    times, com = walk.times, com_from_pelvis(legs, found)
    vx, vy = (com[0] - walk.com.x) / times.period, (com[1] - walk.com.y) / times.period
    put(walk.com, Pelvis(com[0], com[1], vx, vy))
    momentum = angular_momentum(legs, links[:, 0], links[:, 1], np.zeros(3))
    height = hips_above_ankles(walk) + legs.ankle_height + com[2]
    put(walk.turning, Planar(momentum[1] / height, -momentum[0] / height))


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
