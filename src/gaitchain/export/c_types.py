"""Types of translated code: numbers, arrays of known shape, structs of them.

All shapes are known, as a library is for one robot: so arrays need no header, views no
run-time strides, and nothing has to be allocated.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import accumulate
from operator import mul


@dataclass(frozen=True)
class Scalar:
    """A number or a truth value."""

    name: str
    """Of the type in C."""


REAL, INT, BOOL = Scalar("double"), Scalar("int"), Scalar("bool")


@dataclass(frozen=True)
class Array:
    """Numbers in memory at fixed distances, seen from the first one."""

    shape: tuple[int, ...]
    strides: tuple[int, ...] = ()
    """Between neighbours along each axis, in numbers; in C order if not given."""
    const: bool = False
    """Whether it must not be written to."""

    def __post_init__(self) -> None:
        """Lay the numbers out in C order, if no strides are given."""
        if len(self.strides) != len(self.shape):
            object.__setattr__(self, "strides", c_order(self.shape))

    @property
    def size(self) -> int:
        """How many numbers there are."""
        return math.prod(self.shape)

    @property
    def packed(self) -> "Array":
        """The type of a new array with this shape."""
        return Array(self.shape)


def c_order(shape: tuple[int, ...]) -> tuple[int, ...]:
    """Return the strides of an array in C order."""
    sizes = accumulate(shape[:0:-1], mul, initial=1)
    return tuple(sizes)[::-1] if shape else ()


@dataclass(frozen=True)
class Struct:
    """A named tuple, a part of a record, or a plain tuple."""

    name: str
    fields: tuple[tuple[str, "Type"], ...]

    def __getitem__(self, name: str) -> "Type":
        """Return the type of a field."""
        return dict(self.fields)[name]


@dataclass(frozen=True)
class Nothing:
    """What a function returns that returns nothing."""


Type = Scalar | Array | Struct | Nothing


@dataclass(frozen=True)
class Linear:
    """A whole number as a sum of multiples of names; tells the length of slices."""

    constant: int = 0
    parts: Mapping[str, int] = field(default_factory=dict)

    def plus(self, other: "Linear", factor: int = 1) -> "Linear":
        """Return self + factor other."""
        names = {*self.parts, *other.parts}
        total = {
            n: self.parts.get(n, 0) + factor * other.parts.get(n, 0) for n in names
        }
        left = {name: count for name, count in total.items() if count}
        return Linear(self.constant + factor * other.constant, left)

    def times(self, other: "Linear") -> "Linear | None":
        """Return the product, None where it is not linear."""
        if self.known is not None:
            return Linear().plus(other, self.known)
        return None if other.known is None else other.times(self)

    @property
    def known(self) -> int | None:
        """The number, where it has no parts."""
        return None if self.parts else self.constant


@dataclass(frozen=True)
class Value:
    """An expression of translated code."""

    type: Type
    code: str
    """In C; of an array the address of its first number."""
    linear: Linear | None = None
    """Of whole numbers, where it is known."""
    lasting: bool = False
    """Of structs: whether it is a part of what was handed in, not a copy."""
    const: bool = False
    """Of structs: whether it must not be written to."""
    blank: bool = False
    """Whether it is a new array that holds no numbers yet."""

    def member(self, name: str) -> "Value":
        """Return a field of a struct."""
        assert isinstance(self.type, Struct)
        kind = self.type[name]
        pointer = self.code.startswith("(*") and self.code[2:-1].isidentifier()
        code = f"{self.code[2:-1]}->{name}" if pointer else f"{self.code}.{name}"
        if isinstance(kind, Array):
            kind = Array(kind.shape, kind.strides, kind.const or self.const)
        linear = Linear(0, {code: 1}) if kind == INT else None
        return Value(kind, code, linear, self.lasting, self.const)

    def members(self) -> Iterator["Value"]:
        """Yield all fields of a struct."""
        assert isinstance(self.type, Struct)
        return (self.member(name) for name, _ in self.type.fields)

    @property
    def address(self) -> str:
        """How it is handed to a function."""
        if not isinstance(self.type, Struct):
            return self.code
        pointer = self.code.startswith("(*") and self.code[2:-1].isidentifier()
        return self.code[2:-1] if pointer else f"&{self.code}"


@dataclass(frozen=True)
class Span:
    """A slice of known length: first index in C, and how many."""

    first: str
    count: int


@dataclass(frozen=True)
class Static:
    """A Python object that is known before the code runs: a function, a constant."""

    value: object
