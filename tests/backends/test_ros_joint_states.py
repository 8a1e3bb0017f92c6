"""Joint states by name, without any link."""

import numpy as np
import pytest

from gaitchain.backends.ros.joint_states import JointStates, joint_state
from gaitchain.backends.ros.messages import Header, JointState, Time

NAMES = ("hip", "knee", "ankle")


def message(names, position, velocity=(), stamp_s=0.0):
    return JointState(
        Header(Time.at(round(stamp_s * 1e9))),
        tuple(names),
        np.array(position, dtype=float),
        np.array(velocity, dtype=float),
    )


def test_joints_come_in_any_order_and_others_are_ignored():
    states = JointStates(NAMES)
    assert states.add(
        message(["neck", "ankle", "hip", "knee"], [9, 3, 1, 2], [9, 6, 4, 5]), 1.0
    )
    latest = states.latest()
    assert latest.time == 1.0
    assert latest.position.tolist() == [1.0, 2.0, 3.0]
    assert latest.velocity.tolist() == [4.0, 5.0, 6.0]
    assert states.missing() == ()


def test_a_missing_joint_is_nan_and_named():
    states = JointStates(NAMES)
    states.add(message(["hip", "ankle"], [1, 3], [0, 0]), 1.0)
    assert np.isnan(states.latest().position).tolist() == [False, True, False]
    assert np.isnan(states.latest().velocity).tolist() == [False, True, False]
    assert states.missing() == ("knee",)


def test_an_effort_is_known_where_it_is_told():
    states = JointStates(("hip", "knee"))
    states.add(message(["hip", "knee"], [1, 2], [0, 0]), 1.0)
    assert np.isnan(states.latest().effort).all()
    told = JointState(name=("knee", "hip"), position=np.zeros(2), effort=np.ones(2))
    told.effort[1] = np.nan
    states.add(told, 1.0)
    assert states.latest().effort[1] == 1.0
    assert np.isnan(states.latest().effort[0])


def test_two_publishers_make_one_state():
    states = JointStates(NAMES)
    states.add(message(["hip"], [1], [0]), 1.00)
    states.add(message(["ankle", "knee"], [3, 2], [0, 0]), 1.05)
    assert states.latest().position.tolist() == [1.0, 2.0, 3.0]
    assert states.latest().time == 1.05
    states.add(message(["ankle", "knee"], [3, 2], [0, 0]), 1.2)
    assert states.missing() == ("hip",)


def test_nothing_heard_has_no_time():
    latest = JointStates(NAMES).latest()
    assert np.isnan(latest.time)
    assert np.isnan(latest.position).all()


@pytest.mark.parametrize("clock", ["stamps", "arrivals"])
def test_velocities_that_are_not_told_are_differences(clock):
    states = JointStates(("hip", "knee"))
    for tick in range(3):
        stamp_s = 100.0 + 0.02 * tick if clock == "stamps" else 0.0
        # Arrivals jitter; by the stamps the rate is exact all the same.
        now = tick * 0.02 + (0.005 * (tick % 2) if clock == "stamps" else 0.0)
        told = [np.nan, 7.0] if tick == 2 else []
        states.add(message(["hip", "knee"], [0.01 * tick, 0], told, stamp_s), now)
    assert states.latest().velocity == pytest.approx([0.5, 7.0])


def test_a_clock_that_was_set_back_tells_no_velocity():
    states = JointStates(("hip",))
    for stamp_s in (100.0, 99.0):
        states.add(message(["hip"], [stamp_s], [], stamp_s), stamp_s)
    assert np.isnan(states.latest().velocity).all()
    states.add(message(["hip"], [99.1], [], 99.05), 99.05)
    assert states.latest().velocity == pytest.approx([2.0])


def test_the_same_message_twice_changes_nothing():
    states = JointStates(("hip",))
    for position, stamp_s in ((0.0, 1.0), (0.1, 1.05), (0.1, 1.05)):
        states.add(message(["hip"], [position], [], stamp_s), stamp_s)
    assert states.latest().velocity == pytest.approx([2.0])


def test_a_message_of_efforts_alone_or_of_strangers_tells_nothing():
    states = JointStates(NAMES)
    assert not states.add(message(NAMES, []), 1.0)
    assert not states.add(message(["wheel", "arm"], [1, 2]), 1.0)
    assert states.strangers == ("wheel", "arm")
    assert np.isnan(states.latest().time)


def test_what_is_not_known_is_left_out():
    nan = np.nan
    made = joint_state(
        1_500_000_000,
        NAMES,
        np.array([1.0, nan, 3.0]),
        np.array([4.0, nan, 6.0]),
        np.array([7.0, 8.0, nan]),
    )
    assert made.name == ("hip", "ankle")
    assert made.position.tolist() == [1.0, 3.0]
    assert made.velocity.tolist() == [4.0, 6.0]
    assert made.effort.tolist() == []
    assert (made.header.stamp.sec, made.header.stamp.nanosec) == (1, 500_000_000)
