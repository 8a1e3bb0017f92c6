"""How late servos are: learned from joints alone, and no error of the DCM."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from walk_record import walk_record

from gaitchain.analysis.simulated_walk import run_unrecorded
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.balance.dcm_error import dcm_error
from gaitchain.balance.gains import derive_gains
from gaitchain.balance.leg_kinematics import legs_of
from gaitchain.balance.servo_lag import lag_of, note_lag
from gaitchain.balance.state import (
    SINGLE,
    GaitState,
    Memory,
    Pelvis,
    Planar,
    StepTimes,
)
from gaitchain.gait.schedule import parse_schedule
from gaitchain.robot.box_robot import load_box_robot
from gaitchain.sim.world import World
from gaitchain.walker.walker import Walker

LEGS = legs_of(load_box_robot("res"))
GAINS = derive_gains(LEGS)._replace(error_filter=0.0)
TIMES = StepTimes(
    step=0.46, single=0.4, rise=0.2, shift=1.0, hip_height=0.5, omega=4.0, period=0.004
)
JOINTS = 12
TURN = 4.0 * math.pi
USUAL_S = 0.01


def memory(joints, rates):
    links = np.zeros((2, 3, JOINTS // 2, 3))
    return Memory(joints, joints, links, rates, np.zeros(JOINTS))


def learned(late_s, offsets, seconds=4.0):
    """Learn from joints that swing at 2 Hz, each with another phase."""
    walk, phases = walk_record(GAINS, TIMES), np.linspace(0.0, 6.0, JOINTS)
    for tick in range(round(seconds / TIMES.period)):
        at = TURN * tick * TIMES.period + phases
        reference, rates = 0.1 * np.sin(at), 0.1 * TURN * np.cos(at)
        late = 0.1 * np.sin(at - TURN * late_s) + offsets
        note_lag(walk, late, memory(reference, rates))
    return walk


@given(
    st.floats(0.0, 0.05),
    st.lists(st.floats(-0.03, 0.03), min_size=JOINTS, max_size=JOINTS),
)
def test_the_lag_of_swinging_joints_is_learned_whatever_their_zeros(late_s, offsets):
    walk = learned(late_s, np.array(offsets))
    expected = math.sin(TURN * late_s) / TURN  # the slope of a sine over the lag
    assert walk.state.lag == pytest.approx(expected, abs=2e-3)
    assert lag_of(walk) == pytest.approx(max(walk.state.lag - USUAL_S, 0.0))


def test_joints_that_lead_are_not_late():
    walk = learned(-0.01, np.zeros(JOINTS))
    assert walk.state.lag < -0.005
    assert lag_of(walk) == 0.0


@given(st.floats(0.0, 0.06), st.floats(-0.2, 0.2))
def test_who_stands_neither_learns_nor_forgets(lag, off):
    walk = walk_record(GAINS, TIMES, state=GaitState(lag=lag))
    still = np.zeros(JOINTS)
    for _ in range(500):
        note_lag(walk, still + off, memory(still, still))
    assert walk.state.lag == lag


@given(
    st.floats(0.0, 0.06),
    *4 * (st.floats(-0.1, 0.1),),
    *2 * (st.floats(-0.03, 0.03),),
)
def test_a_robot_on_its_plan_of_a_moment_ago_has_no_error(lag, x, y, vx, vy, px, py):
    """Against the pendulum in closed form: back in time by the lag."""
    omega = TIMES.omega
    ago_x = px + (x - px) * math.cosh(omega * lag) - vx / omega * math.sinh(omega * lag)
    ago_y = py + (y - py) * math.cosh(omega * lag) - vy / omega * math.sinh(omega * lag)
    ago_vx = vx * math.cosh(omega * lag) - omega * (x - px) * math.sinh(omega * lag)
    ago_vy = vy * math.cosh(omega * lag) - omega * (y - py) * math.sinh(omega * lag)
    late = lag + USUAL_S
    state = GaitState(SINGLE, pelvis=Pelvis(x, y, vx, vy), zmp=Planar(px, py), lag=late)
    walk = walk_record(GAINS, TIMES, state=state)
    walk.measured.com.x, walk.measured.com.vx = ago_x, ago_vx
    walk.measured.com.y, walk.measured.com.vy = ago_y, ago_vy
    error = dcm_error(walk)
    assert error.x == pytest.approx(0.0, abs=1e-12)
    assert error.y == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(("delay_s", "lag_s"), [(0.0, 0.001), (0.04, 0.034)])
def test_a_walk_in_physics_tells_how_late_its_servos_are(brisk, delay_s, lag_s):
    walker = Walker(brisk)
    backend = MujocoBackend(brisk.robot, World(delay_s=delay_s))
    run_unrecorded(walker, backend, parse_schedule("0.4,0,0@6"))
    lag = walker.gait._walk.state.lag
    assert lag == pytest.approx(lag_s, abs=0.006)
    assert (lag > USUAL_S) == (delay_s > 0.0)
