"""What the planned motion asks of the ground and of the servos. Compiled."""

import numpy as np

from gaitchain.balance.compiled import compiled
from gaitchain.balance.feedforward import load_torques, multi_link_zmp, track_links
from gaitchain.balance.gains import Gains, clip
from gaitchain.balance.leg_kinematics import Legs, Posture
from gaitchain.balance.rotations import rotation, turned_back
from gaitchain.balance.state import DOUBLE, SINGLE, GaitState, Memory, Planar, StepTimes
from gaitchain.gait.step_target import StepTarget
from gaitchain.messages import GRAVITY, Array

_EDGE = 0.14  # of the sole's half-width: how near its edge the ankles push


@compiled
def ankle_shift(legs: Legs, gains: Gains, state: GaitState, reaction: Array) -> Planar:
    """Return how far the ZMP in the sole is to be off the pendulum's [m].

    The ankles push against the error, and carry the reaction of the swing leg.
    """
    x = gains.ankle.x * state.error.x + gains.reaction.x * reaction[0]
    y = gains.ankle.y * state.error.y + gains.reaction.y * reaction[1]
    if state.phase != SINGLE:
        half = 0.5 * legs.sole_half_width
        return Planar(
            clip(x, legs.sole_rear, legs.sole_rear * -0.5), clip(y, -half, half)
        )
    edge = _EDGE * legs.sole_half_width
    return Planar(
        clip(
            x,
            legs.sole_rear + edge - state.zmp.x,
            legs.sole_front - edge - state.zmp.x,
        ),
        clip(
            y,
            -legs.sole_half_width + edge - state.zmp.y,
            legs.sole_half_width - edge - state.zmp.y,
        ),
    )


@compiled
def carry(
    legs: Legs,
    gains: Gains,
    times: StepTimes,
    goal: StepTarget,
    state: GaitState,
    found: Posture,
    memory: Memory,
) -> Array:
    """Return the torques of all joints for the planned ground force, (2 n,) [N m].

    Args:
        legs: the robot.
        gains: of the balance.
        times: the rhythm.
        goal: the chain's choice for this step.
        state: of the walk.
        found: reference posture.
        memory: of the last period; its ZMP is rewritten.
    """
    links = memory.links
    shift = ankle_shift(legs, gains, state, memory.reaction)
    square = times.omega**2
    force = np.empty(3)
    force[0] = legs.mass * square * (state.pelvis.x - state.zmp.x)
    force[1] = state.side * legs.mass * square * (state.pelvis.y - state.zmp.y)
    force[2] = legs.mass * GRAVITY
    in_heading = turned_back(rotation(-state.side * state.pelvis_yaw, 0.0, 0.0), force)
    if state.phase == SINGLE:
        here = Planar(state.zmp.x + shift.x, state.zmp.y + shift.y)
        memory.zmp[0], memory.zmp[1] = here.x, here.y
        return load_torques(
            legs, found, state.side, in_heading, 1.0, here, here, links, gains.inertia
        )
    memory.zmp[0], memory.zmp[1] = state.zmp.x + shift.x, state.zmp.y + shift.y
    x = gains.foot_zmp.x if state.phase == DOUBLE else state.zmp.x
    if state.phase == DOUBLE:
        span = times.step - times.single
        share = clip((times.step - state.time) / span, 0.0, 1.0)
        share = share if goal.stops == 0.0 else 0.5 + 0.5 * share
    else:
        share = clip(1.0 - state.zmp.y / state.lift_off.y, 0.0, 1.0)
    here = Planar(x + shift.x, gains.foot_zmp.y + shift.y)
    there = Planar(x + shift.x, -gains.foot_zmp.y + shift.y)
    return load_torques(
        legs, found, state.side, in_heading, share, here, there, links, 0.0
    )


@compiled
def foresee(
    legs: Legs, times: StepTimes, state: GaitState, found: Posture, memory: Memory
) -> None:
    """Note how the links move, and how far that puts the ZMP off the pendulum's."""
    track_links(found, memory.links, times.period)
    memory.reaction[:] = 0.0
    if state.phase != SINGLE:
        return
    side, square = state.side, times.omega**2
    pelvis = np.empty(3)
    pelvis[0], pelvis[1] = state.pelvis.x, side * state.pelvis.y
    pelvis[2] = times.hip_height + legs.ankle_height
    pull_x = square * (state.pelvis.x - state.zmp.x)
    pull_y = side * square * (state.pelvis.y - state.zmp.y)
    zmp = multi_link_zmp(legs, memory.links, pelvis, pull_x, pull_y)
    memory.reaction[0] = zmp.x - state.zmp.x
    memory.reaction[1] = side * zmp.y - state.zmp.y
