"""One control period of the walk: sensors in, servo targets out. Compiled.

The reference pose follows from the plan: the pelvis swings as a pendulum over the
planned ZMP, the swing foot goes from lift-off over kp_2 to its landing in two cubic
Hermite segments, as the chain's key poses ask. Inverse kinematics makes joint angles
of it, `servos` makes targets of those.
"""

import math

from gaitchain.balance.compiled import compiled
from gaitchain.balance.feedforward import lead
from gaitchain.balance.forces import carry, foresee
from gaitchain.balance.gains import Gains, clip
from gaitchain.balance.leg_kinematics import Legs
from gaitchain.balance.one_foot_recovery import (
    held,
    lean_on,
    measured_dcm,
    seen_upright,
)
from gaitchain.balance.packed_state import (
    Row,
    attitude_in,
    put_state,
    put_view,
    state_in,
)
from gaitchain.balance.pendulum import dcm_of, swing_pendulum
from gaitchain.balance.reference_pose import pose_joints
from gaitchain.balance.standing import settling_zmp, shift_weight
from gaitchain.balance.state import (
    DOUBLE,
    SHIFT,
    SINGLE,
    Foot,
    GaitState,
    Memory,
    Pelvis,
    Planar,
    StepTimes,
    View,
)
from gaitchain.balance.step_plan import StepPlan, follow, plan_held, plan_single
from gaitchain.balance.support_foot import Touch, see_support, touched_down
from gaitchain.balance.terminal_dcm import landing_zmp
from gaitchain.gait.step_target import StepTarget
from gaitchain.messages import Array

_SLACK_S = 1e-9  # control periods do not add up exactly


@compiled
def dcm_error(
    gains: Gains, times: StepTimes, state: GaitState, view: View, memory: Memory
) -> Planar:
    """Return the DCM of the robot's CoM minus that of the reference pose, filtered.

    Both CoMs follow from joint angles, so a swinging leg's reaction is in both. How far
    the robot's CoM is off its model's is learned meanwhile.
    """
    com, offset = memory.com, memory.offset
    yaw = -state.side * state.pelvis_yaw
    c, s = math.cos(yaw), math.sin(yaw)
    ahead = com[0] + com[2] / times.omega
    left = com[1] + com[3] / times.omega
    planned, seen = dcm_of(state.pelvis, times.omega), dcm_of(view.com, times.omega)
    x = planned.x + c * ahead - s * left
    y = planned.y + state.side * (s * ahead + c * left)
    new_x = seen.x - x + offset[0]
    new_y = seen.y - y + state.side * offset[1]
    kept = gains.error_filter
    return Planar(
        new_x + kept * (state.error.x - new_x), new_y + kept * (state.error.y - new_y)
    )


@compiled
def learn_offset(
    gains: Gains, times: StepTimes, state: GaitState, error: Planar, memory: Memory
) -> None:
    """Take what the error is on the mean, over left and right, for an offset CoM.

    The ankles hold a robot that is heavier on one side only where the error stays; so
    the reference is moved until it does not. A robot that was pushed teaches nothing.
    """
    if state.phase != SINGLE or math.hypot(error.x, error.y) > gains.pushed:
        return
    part, most = gains.learning * times.period, gains.offset_reach
    memory.offset[0] = clip(memory.offset[0] + part * error.x, -most, most)
    memory.offset[1] = clip(memory.offset[1] + part * state.side * error.y, -most, most)


@compiled
def advance_plan(
    legs: Legs,
    gains: Gains,
    times: StepTimes,
    goal: StepTarget,
    state: GaitState,
    error: Planar,
    com_y: float,
) -> tuple[StepPlan, Planar, Pelvis]:
    """Move the plan on by one control period.

    Args:
        legs: the robot.
        gains: of the balance.
        times: the rhythm.
        goal: the chain's choice.
        state: of the walk.
        error: of the DCM [m].
        com_y: reference CoM beside the pelvis, step frame [m]; it counts where the
            robot is held, which takes longer than a swing of the pendulum.

    Returns:
        The plan, its ZMP after the period, and the pelvis after the period.
    """
    plan = StepPlan(state.zmp, state.landing, 1.0)
    pelvis = follow(state.pelvis, error, gains, times.omega, times.period, state.holds)
    if state.phase == SHIFT:
        zmp, pelvis = shift_weight(legs, gains, times, state, pelvis)
        return StepPlan(zmp, state.landing, 1.0), zmp, pelvis
    moved, beside = state.zmp, 0.0
    if state.holds > 0.0:
        plan = plan_held(legs, gains, times, goal, pelvis, state.landing, state.time)
        moved, beside = plan.zmp, com_y
    elif state.phase == SINGLE:
        plan = plan_single(
            legs,
            gains,
            times,
            goal,
            pelvis,
            state.landing,
            state.first_zmp,
            state.time,
        )
        moved = plan.zmp
    elif state.phase == DOUBLE:
        left = max(times.step - state.time, times.period)
        part = times.period / left
        aim = landing_zmp(gains, goal, state.landing)
        moved = Planar(
            state.zmp.x + part * (aim.x - state.zmp.x),
            state.zmp.y + part * (aim.y - state.zmp.y),
        )
    else:
        moved = settling_zmp(legs, gains, times, pelvis, state.lift_off)
        plan = StepPlan(moved, state.landing, 1.0)
    period = times.period
    x, vx = swing_pendulum(
        pelvis.x,
        pelvis.vx,
        plan.zmp.x,
        (moved.x - plan.zmp.x) / period,
        times.omega,
        period,
    )
    y, vy = swing_pendulum(
        pelvis.y,
        pelvis.vy,
        plan.zmp.y - beside,
        (moved.y - plan.zmp.y) / period,
        times.omega,
        period,
    )
    return plan, moved, Pelvis(x, y, vx, vy)


@compiled
def move_on(
    times: StepTimes,
    state: GaitState,
    plan: StepPlan,
    zmp: Planar,
    pelvis: Pelvis,
    error: Planar,
    view: View,
    gains: Gains,
    dcm: Planar,
    touch: Touch,
) -> GaitState:
    """Return the state one control period later; touch-down ends single support.

    A foot that touches down early ends it where it is; that is believed of a robot that
    is far off its plan: on uneven ground a foot can be level with the other in the air.
    One that is late is waited for.
    """
    time = state.time + times.period * plan.rate
    phase, landing = state.phase, plan.landing
    off = math.hypot(error.x, error.y)
    if phase == SINGLE:
        part = time / times.single
        if touch.sure and off > gains.pushed and gains.earliest < part < gains.usual:
            phase, time = DOUBLE, times.single
            landing = Foot(view.swing.x, view.swing.y, landing.yaw)
        elif part >= 1.0 - _SLACK_S and (touch.likely or part > 1.0 + gains.latest):
            phase, time = DOUBLE, times.single
    part = 0.0
    if phase in (SINGLE, DOUBLE):
        part = clip(time / times.step, 0.0, 1.0)
    yaw = state.lift_off.yaw + part * (landing.yaw - state.lift_off.yaw)
    first = state.first_zmp
    if state.phase == SINGLE and math.isnan(first.x):
        first = plan.zmp
    return GaitState(
        phase,
        state.side,
        time,
        pelvis,
        0.5 * yaw,
        state.lift_off,
        landing,
        zmp,
        first,
        error,
        plan.rate,
        state.holds,
        lean_on(gains, times, state, dcm),
        max(state.worst, off),
        state.caution,
    )


@compiled
def tick(
    legs: Legs, numbers: Row, joints: Array, rates: Array, memory: Memory
) -> Array:
    """Carry the walk on by one control period.

    Args:
        legs: the robot.
        numbers: (1,) row of the walk; its state and view are rewritten.
        joints: (2 n,) measured [rad].
        rates: (2 n,) measured [rad/s].
        memory: of the last period; rewritten.

    Returns:
        (2 n,) servo targets [rad].
    """
    walk = numbers[0]
    gains, times, goal = walk.gains, walk.times, walk.goal
    attitude = attitude_in(walk.attitude)
    view = see_support(legs, attitude, walk.state.side, joints, rates)
    dcm = measured_dcm(times, walk.state.side, view, memory.offset)
    walk.state.holds = held(legs, gains, walk.state, dcm)
    before = state_in(walk.state)
    error = dcm_error(gains, times, before, view, memory)
    learn_offset(gains, times, before, error, memory)
    com_y = before.side * memory.com[1]
    plan, zmp, pelvis = advance_plan(legs, gains, times, goal, before, error, com_y)
    touch = touched_down(legs, gains, before.side, view, memory.load)
    state = move_on(times, before, plan, zmp, pelvis, error, view, gains, dcm, touch)
    reference = pose_joints(
        legs, gains, times, goal, state, attitude, memory.offset, memory.next_joints
    )
    com, found = seen_upright(legs, reference, state.lean.angle)
    foresee(legs, times, state, found, memory)
    torques = carry(legs, gains, times, goal, state, found, memory)
    targets = lead(legs, reference, memory.joints, torques, times.period)
    for i in range(2):
        memory.com[2 + i] = (com[i] - memory.com[i]) / times.period
        memory.com[i] = com[i]
    for j in range(reference.shape[0]):
        memory.next_joints[j] = 2.0 * reference[j] - memory.joints[j]
    memory.joints[:] = reference
    put_state(walk.state, state)
    put_view(walk.seen, view)
    return targets
