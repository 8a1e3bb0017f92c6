"""One control period of the walk: sensors in, servo targets out. Compiled.

The reference pose follows from the plan: the pelvis swings as a pendulum over the
planned ZMP, the swing foot goes from lift-off over kp_2 to its landing in two cubic
Hermite segments, as the chain's key poses ask. Inverse kinematics makes joint angles
of it, `feedforward` makes targets of those.

Each stage reads the walk's record and writes its own fields there; those of a stage
that has not run yet are of the period before.
"""

import math
from typing import Any

from gaitchain.balance.compiled import compiled
from gaitchain.balance.crouch import follow_crouch, hips_above_ankles
from gaitchain.balance.curves import clip
from gaitchain.balance.dcm_error import dcm_error, learn_offset, note_com, pushed_error
from gaitchain.balance.feedforward import carry, lead, note_motion, rates_of
from gaitchain.balance.leg_kinematics import Legs, posture
from gaitchain.balance.packed_state import Row, put
from gaitchain.balance.pendulum import swing_pendulum
from gaitchain.balance.reference_pose import pose_joints
from gaitchain.balance.servo_lag import note_lag
from gaitchain.balance.standing import settling_zmp, shift_weight
from gaitchain.balance.state import DOUBLE, SHIFT, SINGLE, Foot, Memory, Pelvis, Planar
from gaitchain.balance.step_plan import (
    follow,
    landing_zmp,
    plan_single,
)
from gaitchain.balance.support_foot import Touch, note_slip, see_support, touched_down
from gaitchain.messages import Array

_SLACK_S = 1e-9  # control periods do not add up exactly
_HOME = 5.0  # 1/s: how fast joints that move no foot return to where they stand


@compiled
def control_step(
    legs: Legs, numbers: Row, joints: Array, rates: Array, memory: Memory
) -> Array:
    """Carry the walk on by one control period.

    Args:
        legs: the robot.
        numbers: (1,) row of the walk; all but what the sensors, the chain and the
            robot's size decide is rewritten.
        joints: (2 n,) measured [rad].
        rates: (2 n,) measured [rad/s].
        memory: of the last period; rewritten.

    Returns:
        (2 n,) servo targets [rad].
    """
    walk = numbers[0]
    state, times = walk.state, walk.times
    view = see_support(legs, walk.attitude, state.side, joints, rates, state.heel)
    put(walk.measured, view)
    note_lag(walk, joints, memory)
    put(state.error, dcm_error(walk))
    learn_offset(walk)
    note_slip(walk)
    state.sag -= walk.gains.rise * times.period * state.sag
    follow_crouch(walk)
    touch = touched_down(legs, walk)
    advance_plan(legs, walk)
    advance_time(legs, walk, touch)
    reference = pose_joints(legs, walk, memory.next_joints)
    found = posture(legs, reference)
    note_motion(legs, walk, found, memory.links)
    torques = carry(legs, walk, found, memory.links)
    rates = rates_of(reference, memory.joints, times.period)
    targets = lead(legs, reference, rates, torques)
    note_com(legs, walk, found, memory.links)
    expect(legs, reference, times.period, memory)
    memory.joints[:] = reference
    memory.rates[:], memory.torques[:] = rates, torques
    return targets


@compiled
def expect(legs: Legs, reference: Array, period: float, memory: Memory) -> None:
    """Write where the next pose is looked for from: where the joints are going.

    A leg of seven joints can move all of them and leave its foot where it is. Nothing
    would end such a motion if it were carried on, so it begins where the leg is, and a
    little nearer to where it stands.

    Args:
        legs: the robot.
        reference: (2 n,) pose of this period [rad].
        period: control period [s].
        memory: of the last period; its next joints are rewritten.
    """
    free = legs.link_mass.shape[1] > 6
    home = min(_HOME * period, 1.0)
    for j in range(reference.shape[0]):
        way = reference[j] - memory.joints[j]
        if free:
            way = home * (legs.start[j] - reference[j])
        memory.next_joints[j] = reference[j] + way


@compiled
def advance_plan(legs: Legs, walk: Any) -> None:
    """Move the plan on by one control period.

    Args:
        legs: the robot.
        walk: its pelvis, ZMP, landing and rate are rewritten.
    """
    times, state = walk.times, walk.state
    pelvis = follow(walk)
    state.rate = 1.0
    if state.phase == SHIFT:
        zmp, pelvis = shift_weight(legs, walk, pelvis)
        put(state.zmp, zmp)
        put(state.pelvis, pelvis)
        return
    start = Planar(state.zmp.x, state.zmp.y)
    if state.phase == SINGLE:
        plan = plan_single(legs, walk, pelvis)
        put(state.landing, plan.landing)
        state.rate = plan.rate
        if math.isnan(state.first_zmp.x):
            put(state.first_zmp, plan.zmp)
        start = end = plan.zmp
    elif state.phase == DOUBLE:
        part = times.period / max(times.step - state.time, times.period)
        aim = landing_zmp(walk.gains, walk.target, state.landing)
        end = Planar(
            start.x + part * (aim.x - start.x), start.y + part * (aim.y - start.y)
        )
    else:
        start = end = settling_zmp(legs, walk, pelvis)
    omega, period = times.omega, times.period
    rate_x, rate_y = (end.x - start.x) / period, (end.y - start.y) / period
    x, vx = swing_pendulum(pelvis.x, pelvis.vx, start.x, rate_x, omega, period)
    y, vy = swing_pendulum(pelvis.y, pelvis.vy, start.y, rate_y, omega, period)
    put(state.zmp, end)
    put(state.pelvis, Pelvis(x, y, vx, vy))


@compiled
def land(legs: Legs, walk: Any) -> None:
    """Begin double support with the swing foot where it is.

    A pushed robot puts its foot elsewhere than planned, and lower or higher against
    its hips. Targets that insist on the plan press the feet apart or the robot up.

    Args:
        legs: the robot.
        walk: its phase, time, sag and landing are rewritten.
    """
    gains, times, state = walk.gains, walk.times, walk.state
    state.phase, state.time = DOUBLE, times.single
    sag = hips_above_ankles(walk) + legs.ankle_height - walk.measured.swing_height
    state.sag = clip(sag, -gains.sag_reach, gains.sag_reach)
    if state.worst > pushed_error(walk):
        swing = walk.measured.swing
        put(state.landing, Foot(swing.x, swing.y, state.landing.yaw))


@compiled
def advance_time(legs: Legs, walk: Any, touch: Touch) -> None:
    """Move the step's time on by one control period; touch-down ends single support.

    A foot that touches down early ends it where it is; that is believed of a robot that
    is far off its plan: on uneven ground a foot can be level with the other in the air.
    One that is late is waited for.

    Args:
        legs: the robot.
        walk: its phase, time and pelvis_yaw are rewritten, landing and sag at
            touch-down.
        touch: whether the swing foot is on the ground.
    """
    gains, times, state = walk.gains, walk.times, walk.state
    state.time += times.period * state.rate
    off = math.hypot(state.error.x, state.error.y)
    state.worst = max(state.worst, off)
    if state.phase == SINGLE:
        part = state.time / times.single
        early = touch.sure and off > pushed_error(walk) and part > gains.earliest
        due = part >= 1.0 - _SLACK_S
        if early or (due and (touch.likely or part > 1.0 + gains.latest)):
            land(legs, walk)
    part = 0.0
    if state.phase in (SINGLE, DOUBLE):
        part = clip(state.time / times.step, 0.0, 1.0)
    yaw = state.lift_off.yaw + part * (state.landing.yaw - state.lift_off.yaw)
    state.pelvis_yaw = 0.5 * yaw
