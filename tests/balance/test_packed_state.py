"""A walk's row: what goes in comes out, in Python and in machine code."""

from typing import NamedTuple, get_type_hints

import numpy as np
import pytest

from gaitchain.balance import packed_state
from gaitchain.balance.compiled import compiled
from gaitchain.balance.gains import derive_gains
from gaitchain.balance.leg_kinematics import legs_of
from gaitchain.balance.packed_state import Walk, new_row, part, put
from gaitchain.balance.state import GaitState, SoleLoads, StepTimes
from gaitchain.robot.box_robot import load_box_robot

GAINS = derive_gains(legs_of(load_box_robot("res")))
PARTS = get_type_hints(Walk)


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


class Owner:
    """Has a row, and all of its parts as attributes."""

    phase = part("state", "phase")
    time = part("state", "time")
    error = part("state", "error")

    def __init__(self):
        self.numbers = new_row(GAINS, counted(StepTimes))


for name in PARTS:
    setattr(Owner, name, part(name))


@compiled
def write(place, value):
    put(place, value)


@pytest.fixture
def owner():
    return Owner()


@pytest.mark.parametrize("name", PARTS)
def test_a_row_gives_back_what_was_put_in(owner, name):
    values = counted(PARTS[name])
    setattr(owner, name, values)
    assert getattr(owner, name) == values
    assert type(getattr(owner, name)) is PARTS[name]


def test_the_short_ways_are_those_of_the_state(owner):
    state = owner.state = counted(GaitState)
    assert (owner.phase, owner.time, owner.error) == (
        state.phase,
        state.time,
        state.error,
    )
    owner.time = 7.0
    assert owner.state == state._replace(time=7.0)


def test_gains_and_times_are_in_a_new_row_and_the_rest_is_zero(owner):
    assert (owner.gains, owner.times) == (GAINS, counted(StepTimes))
    assert not any(np.ravel(owner.attitude)) and owner.phase == 0


@pytest.mark.parametrize("write", [write, put])
@pytest.mark.parametrize("name", PARTS)
def test_machine_code_and_python_write_every_field(owner, name, write):
    values = counted(PARTS[name])
    write(getattr(owner.numbers[0], name), values)
    assert getattr(owner, name) == values


def test_a_row_that_is_overwritten_stays_the_owners(owner):
    """A snapshot is taken up again in place."""
    owner.state = counted(GaitState)
    kept = owner.numbers.copy()
    owner.state = GaitState()
    owner.numbers[:] = kept
    assert owner.state == counted(GaitState)


def test_a_new_field_is_declared_in_its_named_tuple_alone():
    """Layout, writer and reader of a state with one more field, nested or not."""
    fields = get_type_hints(GaitState)
    more = NamedTuple(
        "GaitState", [*fields.items(), ("new", float), ("newer", SoleLoads)]
    )
    row = np.zeros(1, np.dtype((np.record, packed_state._record_type(more))))
    write(row[0], counted(more))
    assert packed_state._reader(more)(row[0].item()) == counted(more)
    assert row[0].new == counted(more).new


def test_a_name_that_records_have_themselves_is_refused():
    """Of a record, `view` would be NumPy's method and no field."""

    class Taken(NamedTuple):
        view: float

    with pytest.raises(AssertionError, match="'view'"):
        packed_state._record_type(Taken)
