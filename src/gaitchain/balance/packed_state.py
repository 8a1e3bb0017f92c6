"""All numbers of a walk in one NumPy record, which compiled functions change in place.

Numba examines every field of a named tuple at each call, which takes longer than the
control step itself; of a record it looks at the type alone. Compiled functions read the
fields of both alike. The record's layout, what writes to it (`put`) and what reads it
(`part`) follow from the named tuples: a new field is declared there and nowhere else.
"""

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple, get_type_hints

import numpy as np
from numpy.typing import NDArray

from gaitchain.balance.compiled import compiled_as
from gaitchain.balance.gains import Gains
from gaitchain.balance.state import (
    Attitude,
    GaitState,
    Pelvis,
    Planar,
    SoleLoads,
    StepTimes,
    View,
)
from gaitchain.gait.step_target import StepTarget

Row = NDArray[Any]
"""(1,) record array with the fields of `Walk`."""


class Walk(NamedTuple):
    """All numbers of a walk; compiled functions take this or a record of the same."""

    gains: Gains
    times: StepTimes
    target: StepTarget
    """What the chain chose for this step."""
    attitude: Attitude
    state: GaitState
    measured: View
    """In the latest control step; 0 before the first one."""
    load: SoleLoads
    """Measured."""
    com_offset: Planar
    """Learned: robot's CoM off the model's, ahead and left of the trunk [m]."""
    com: Pelvis
    """Reference CoM from the pelvis, ahead and left in the trunk's heading."""
    turning: Planar
    """What its turning adds to its speed, see `dcm_error`, in the same axes [m/s]."""
    reaction: Planar
    """ZMP of all links minus the pendulum's, step frame [m]."""
    sole_zmp: Planar
    """ZMP that the servo targets are to produce, step frame [m]."""


def _is_tuple(kind: Any) -> bool:
    return hasattr(kind, "_fields")


def _record_type(kind: type) -> np.dtype[Any]:
    """Return the record type of a named tuple of numbers, or of other such tuples."""
    hints = get_type_hints(kind)
    taken = sorted(name for name in hints if hasattr(np.record, name))
    assert not taken, f"{taken} of {kind.__name__}: NumPy's records have such a method"
    fields = [(n, _record_type(t) if _is_tuple(t) else t) for n, t in hints.items()]
    return np.dtype(fields)


_PLACE = "_place_of_"  # in the row: so attributes that remember one begin

# One type for all rows: Numba knows it again by its identity.
_ROW = np.dtype((np.record, _record_type(Walk)))


def new_row(gains: Gains, times: StepTimes) -> Row:
    """Return the row of a walk with these gains and times, all the rest 0."""
    row = np.zeros(1, _ROW)
    row["gains"], row["times"] = gains, times
    return row


def put(place: Any, value: Any) -> None:
    """Write a named tuple to its place in a record.

    Args:
        place: a part of a row, as `row[0].state.zmp`; changed in place.
        value: the named tuple of numbers, or of other such tuples, that it is made of.
    """
    for name, part in zip(value._fields, value, strict=True):
        if _is_tuple(part):
            put(getattr(place, name), part)
        else:
            setattr(place, name, part)


@compiled_as(put)
def _put(place: Any, value: Any) -> Callable[..., None]:
    """Make the machine code of `put`: one assignment a number, without a loop."""
    names = _number_names(value.instance_class)
    lines = "\n".join(f"    place.{name} = value.{name}" for name in names)
    scope: dict[str, Any] = {"Any": Any}  # Numba compares the annotations, too
    exec(f"def write(place: Any, value: Any):\n{lines}\n", scope)
    write: Callable[..., None] = scope["write"]
    return write


def _number_names(kind: type) -> Iterator[str]:
    """Name every number of a named tuple; those of nested ones as `com.x`."""
    for name, part in get_type_hints(kind).items():
        if _is_tuple(part):
            yield from (f"{name}.{inner}" for inner in _number_names(part))
        else:
            yield name


def _reader(kind: Any) -> Callable[[Any], Any]:
    """Make what builds a named tuple from the nested plain tuple of a record."""
    scope: dict[str, Any] = {}

    def build(kind: Any, values: str) -> str:
        scope[kind.__name__] = kind
        parts = list(get_type_hints(kind).values())
        if not any(map(_is_tuple, parts)):
            return f"{kind.__name__}(*{values})"
        places = [f"{values}[{i}]" for i in range(len(parts))]
        inner = [
            build(part, place) if _is_tuple(part) else place
            for part, place in zip(parts, places, strict=True)
        ]
        return f"{kind.__name__}({', '.join(inner)})"

    expression = build(kind, "values")
    read: Callable[[Any], Any] = eval(f"lambda values: {expression}", scope)
    return read


class OfRow:
    """What has a row as its `numbers`, one array as long as it lives.

    A deep copy, or one from a pickle, has a row of its own.
    """

    numbers: Row
    """(1,) all numbers of the walk."""

    def __getstate__(self) -> dict[str, Any]:
        """Return what a copy is made of; it finds the places in its own row itself."""
        own = self.__dict__.items()
        return {name: value for name, value in own if not name.startswith(_PLACE)}


def part(*path: str) -> Any:
    """Return a property for a part of the row that an `OfRow` has as its `numbers`.

    Reading returns a copy, a named tuple or a number; assigning writes to the row.

    Args:
        path: the names that lead to the part, as "state", "phase".
    """
    kind: Any = Walk
    for name in path:
        kind = get_type_hints(kind)[name]
    slot = _PLACE + "_".join(path)
    read = _reader(kind) if _is_tuple(kind) else None

    def find(owner: Any) -> Row:
        place: Row = owner.numbers
        for name in path:
            place = place[name]
        owner.__dict__[slot] = place  # found once: a control step reads it many times
        return place

    def get(owner: Any) -> Any:
        try:
            return owner.__dict__[slot].item()
        except KeyError:
            return find(owner).item()

    def assign(owner: Any, value: Any) -> None:
        place = owner.__dict__.get(slot)
        if place is None:
            place = find(owner)
        place[0] = value

    return property(get if read is None else lambda owner: read(get(owner)), assign)
