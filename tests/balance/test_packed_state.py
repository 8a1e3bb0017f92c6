"""A walk's row: what goes in comes out, in Python and in machine code."""

from typing import get_type_hints

import pytest

from gaitchain.balance.gains import derive_gains
from gaitchain.balance.leg_kinematics import legs_of
from gaitchain.balance.packed_state import (
    WalkRow,
    attitude_in,
    put_attitude,
    put_state,
    put_view,
    state_in,
)
from gaitchain.balance.state import Attitude, GaitState, StepTimes, View
from gaitchain.gait.step_target import StepTarget
from gaitchain.robot.reduced_biped import load_biped

GAINS = derive_gains(legs_of(load_biped("res")))


def counted(kind, start=1.0):
    """A named tuple of 1.0, 2.0, 3.0 ..., through all that it holds."""
    values, number = [], start
    for hint in get_type_hints(kind).values():
        if hasattr(hint, "_fields"):
            values.append(counted(hint, number))
            number += len(hint._fields)
        else:
            values.append(hint(number))
            number += 1.0
    return kind(*values)


@pytest.fixture
def row():
    return WalkRow(GAINS, counted(StepTimes))


@pytest.mark.parametrize(
    ("part", "kind"),
    [("state", GaitState), ("goal", StepTarget), ("attitude", Attitude)],
)
def test_a_row_gives_back_what_was_put_in(row, part, kind):
    values = counted(kind)
    setattr(row, part, values)
    assert getattr(row, part) == values


def test_the_short_ways_are_those_of_the_state(row):
    state = row.state = counted(GaitState)
    assert (row.phase, row.time, row.error) == (state.phase, state.time, state.error)


def test_gains_and_times_are_in_the_row(row):
    assert row.numbers["gains"].item() == tuple(GAINS)
    assert row.numbers["times"].item() == tuple(counted(StepTimes))


def test_machine_code_writes_and_reads_every_field(row):
    walk = row.numbers[0]
    state, attitude, view = counted(GaitState), counted(Attitude), counted(View)
    put_state(walk.state, state)
    put_attitude(walk.attitude, attitude)
    put_view(walk.seen, view)
    assert (row.state, row.attitude, row.view) == (state, attitude, view)
    assert state_in(walk.state) == state
    assert attitude_in(walk.attitude) == attitude
