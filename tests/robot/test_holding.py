"""Joints outside the legs are held by the weight that they carry."""

import pytest

from gaitchain.robot.holding import holding_stiffness


@pytest.mark.parametrize(
    ("load", "hinge", "stiffness"),
    [
        (10.0, True, 80.0),  # 8 times the load
        (0.1, True, 3.0),  # at least 0.01 m g h
        (10.0, False, 8000.0),  # on a lever of 0.1 m
    ],
)
def test_stiffness_follows_the_load(load, hinge, stiffness):
    found = holding_stiffness(load, 300.0, hinge=hinge)
    assert found == pytest.approx(stiffness)
