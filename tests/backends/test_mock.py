"""Backends without a bus: what they refuse of who drives them by Python."""

from functools import partial

import numpy as np
import pytest

from gaitchain.backends.mock import MockBackend
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.errors import BackendError, CommandError
from gaitchain.robot.box_robot import load_box_robot

ODD = (
    (np.zeros(3), "have 3 values, needs 12"),
    (np.zeros((2, 6)), r"have shape \(2, 6\), needs 12"),
    (np.full(12, np.nan), "joint angle 0 is nan, each must be a finite number"),
    ("x", "joint angles 'x': need 12 finite numbers"),
    ([10**400] * 12, r"joint angles \[10+: need 12 finite numbers"),
)


def backends():
    return MujocoBackend(load_box_robot("res")), MockBackend(0.01)


@pytest.mark.parametrize("odd, told", ODD)
def test_targets_that_are_none_are_refused_and_change_nothing(odd, told):
    for backend in backends():
        backend.connect(np.zeros(12))
        before = backend.read()
        with pytest.raises(CommandError, match=told):
            backend.write(odd)
        assert backend.read().time == before.time
        assert backend.read().joint_position == pytest.approx(before.joint_position)


@pytest.mark.parametrize("odd, told", ODD)
def test_a_start_that_is_none_is_refused(odd, told):
    with pytest.raises(CommandError, match=told):
        backends()[0].connect(odd)


def test_lists_are_joint_angles_as_well():
    for backend in backends():
        backend.connect([0.0] * 12)
        backend.write([0.0] * 12)
        assert backend.read().time > 0.0


@pytest.mark.parametrize("period_s", [-1, 0.0, np.nan, np.inf, "0.01", None, 10**400])
def test_a_backend_has_a_control_period(period_s):
    for made in (MockBackend, partial(MujocoBackend, load_box_robot("res"), None)):
        with pytest.raises(CommandError, match="need seconds above 0"):
            made(period_s)


@pytest.mark.parametrize("robot", ["res", None, 5])
def test_what_is_no_robot_is_not_simulated(robot):
    with pytest.raises(CommandError, match="is no robot; give a Robot, as load_robot"):
        MujocoBackend(robot)


def test_a_mock_is_connected_first():
    backend = MockBackend(0.01)
    with pytest.raises(BackendError, match="call connect"):
        backend.read()
    with pytest.raises(BackendError, match="call connect"):
        backend.write(np.zeros(12))
