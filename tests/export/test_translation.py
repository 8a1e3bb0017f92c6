"""What the translator makes of Python: the same numbers in C, or an error."""

# ruff: noqa: PLW0120, PLW2901, SIM108 - written as a careless author might

import ctypes
from typing import NamedTuple

import numpy as np
import pytest

from gaitchain.balance.state import Planar
from gaitchain.errors import ExportError
from gaitchain.export.c_types import BOOL, INT, REAL, Scalar, Type, Value
from gaitchain.export.c_types import Array as ArrayType
from gaitchain.export.compiler import compile_c
from gaitchain.export.program import Program
from gaitchain.messages import Array

ROW = np.array([5.0, 6.0, 7.0, 8.0])
SQUARE = np.arange(9.0).reshape(3, 3)


class Found(NamedTuple):
    at: Array
    far: float


def ratio(i: int, j: int) -> float:
    return float(i) / float(j)


def half(i: int, j: int) -> float:
    return float(i) / 2 * j


def same_truth(x: float, y: float) -> bool:
    return bool(x) == bool(y)


def both(x: float, i: int) -> bool:
    return bool(x) and not bool(i)


def share(x: float, y: float) -> float:
    return (float(x > 0.0) + float(y > 0.0)) / 4


def one_of_the_last(v: Array) -> float:
    k = -3
    return v[-2] + 10.0 * v[k]


def all_but_the_last(v: Array) -> float:
    w, u = v[:-1].copy(), v[-2:].copy()
    return w.shape[0] + 10.0 * u.shape[0] + w[2] + u[0] + v[-3:-1][0]


def less_its_first(v: Array) -> Array:
    w = v.copy()
    w -= w[0]
    return w


def less_its_last_by_another_name(v: Array) -> Array:
    w = v.copy()
    u = w[1:4]
    u -= w[3] * 2.0
    return w


def all_as_one(v: Array) -> Array:
    w = v.copy()
    w[:] = 2.0 * w[1]
    return w


def moved_up(v: Array) -> Array:
    w = v.copy()
    w[1:4] = w[0:3]
    return w


def moved_up_by_another_name(v: Array) -> Array:
    w = v.copy()
    u = w[0:3]
    w[1:4] += u
    return w


def doubled(v: Array) -> Array:
    w = v.copy()
    w += w
    w[:] = w
    return w


def turned_over(a: Array) -> Array:
    b = a.copy()
    b[:, :] = b.T
    return b


def symmetric(a: Array) -> Array:
    b = a.copy()
    b += b.T
    return b


def exchanged(v: Array) -> Array:
    w = v.copy()
    u = w
    w[0], u[1] = u[1], w[0]
    return w


def exchanged_pairs(x: float, y: float) -> float:
    p, q = Planar(x, 1.0), Planar(y, 2.0)
    p, q = Planar(q.x, p.y), Planar(p.x, q.y)
    return p.x + 10.0 * p.y + 100.0 * q.x + 1000.0 * q.y


def one_array_of_two_names(v: Array) -> float:
    a = b = v.copy()
    a[0] = 7.5
    return b[0]


def one_number_of_two_names(x: float, y: float) -> float:
    x = y = x + y
    return x - y


def counted(n: int, m: int) -> float:
    total = 0.0
    for i in range(n):
        if i == m:
            continue
        for k in range(i, 0, -1):
            if k > 3:
                break
            total += 10.0 * i + k
    for i in range(m + 1):
        total -= i
    return total


def last_of_a_row(v: Array) -> float:
    for x in v:
        if x > 6.5:
            break
    return x


def parts_in_turn(v: Array) -> float:
    own = slice(0, 2)
    total = v[own][1]
    own = slice(2, 4)
    return total + 10.0 * v[own][1]


def row_of_a_branch(a: Array, x: float) -> float:
    row = a[0]
    if x > 0.0:
        row = a[1]
    return row[2]


def argument_of_a_branch(x: float, k: int) -> float:
    if x > 0.0:
        k = 3
    return k / 2


def names_of_ours(t1: float, i0: float) -> float:
    t2 = t1 * 2.0
    v = np.zeros(3)
    v += i0
    w = v + t2 / 3.0
    return w[2] + t1 + t2


SAME = (
    *((ratio, (7, 2)), (half, (7, 3)), (share, (0.5, 2.0)), (both, (0.5, 0))),
    *((same_truth, (0.5, 2.0)), (same_truth, (0.5, 0.0)), (one_of_the_last, (ROW,))),
    *((all_but_the_last, (ROW,)), (less_its_first, (ROW,)), (all_as_one, (ROW,))),
    *((less_its_last_by_another_name, (ROW,)), (moved_up, (ROW,))),
    *((moved_up_by_another_name, (ROW,)), (doubled, (ROW,)), (exchanged, (ROW,))),
    *((turned_over, (SQUARE,)), (symmetric, (SQUARE,)), (counted, (7, 2))),
    *((exchanged_pairs, (3.0, 4.0)), (one_array_of_two_names, (ROW,))),
    *((one_number_of_two_names, (0.5, 0.7)), (last_of_a_row, (ROW,))),
    *((parts_in_turn, (ROW,)), (row_of_a_branch, (SQUARE, 1.0))),
    *((row_of_a_branch, (SQUARE, -1.0)), (argument_of_a_branch, (1.0, 4))),
    *((argument_of_a_branch, (-1.0, 4)), (names_of_ours, (2.0, 5.0))),
)
_KINDS = {float: REAL, int: INT}
_IN_C = {REAL: ctypes.c_double, INT: ctypes.c_int, BOOL: ctypes.c_bool}
_AROUND = """
#include <math.h>
#include <stdbool.h>
"""


def kind_of(value) -> Type:
    if isinstance(value, np.ndarray):
        return ArrayType(value.shape)
    return _KINDS[type(value)]


def translate(program, function, arguments):
    """Return the name in C, and the type of what it returns."""
    names = function.__code__.co_varnames
    values = [
        Value(kind_of(argument), name)
        for name, argument in zip(names, arguments, strict=False)
    ]
    return program.instance(function, values)


@pytest.fixture(scope="module")
def compiled(tmp_path_factory):
    """All functions in one library, and the names and types of each."""
    program, folder = Program(), tmp_path_factory.mktemp("c")
    found = {case[0]: translate(program, *case) for case in SAME}
    functions = program.functions.replace("static ", "")
    source, made = folder / "all.c", folder / "all.so"
    source.write_text(_AROUND + program.structs + functions, "utf-8")
    compile_c([source], made, "-std=c99", "-O1", "-shared", "-fPIC", libraries=["-lm"])
    return ctypes.CDLL(str(made)), found


def run(code, name, returns, arguments, shape):
    function = getattr(code, name)
    handed = [
        argument.ctypes.data_as(ctypes.c_void_p)
        if isinstance(argument, np.ndarray)
        else _IN_C[kind_of(argument)](argument)
        for argument in arguments
    ]
    if isinstance(returns, Scalar):
        function.restype = _IN_C[returns]
        return function(*handed)
    out = np.full(shape, np.nan)
    function(*handed, out.ctypes.data_as(ctypes.c_void_p))
    return out


@pytest.mark.parametrize("case", SAME, ids=lambda case: case[0].__name__)
def test_c_gives_what_python_gives(compiled, case):
    code, found = compiled
    function, arguments = case
    wanted = function(*arguments)
    got = run(code, *found[function], arguments, np.shape(wanted))
    assert np.array_equal(got, wanted)


def beyond(v: Array) -> float:
    return v[4]


def before(v: Array) -> float:
    return v[-5]


def between(v: Array) -> float:
    return v[v[0]]


def longer(v: Array) -> Array:
    return v[2:5] + 1.0


def before_the_first(v: Array) -> Array:
    return v[-5:2] + 1.0


def longer_by_name(v: Array) -> Array:
    own = slice(2, 5)
    return v[own] + 1.0


def nothing(v: Array) -> Array:
    return v[2:2] + 1.0


def every_other(v: Array) -> Array:
    return v[::2] + 1.0


def last_by_name(v: Array) -> Array:
    own = slice(-2, 4)
    return v[own] + 1.0


def either(x: float, y: float) -> float:
    return x or y


def last_of_both(x: float, y: float) -> float:
    return x and y


def truths(x: float, y: float) -> float:
    return (x > 0.0) + (y > 0.0)


def parts_of_real(x: float, y: float) -> float:
    return x // y


def nobody(x: float, y: float) -> bool:
    return x is y


def for_else(n: int) -> float:
    total = 0.0
    for _ in range(n):
        total += 1.0
    else:
        total += 100.0
    return total


def of_a_tuple(n: int) -> float:
    total = 0.0
    for _ in range(n):
        for x in (1.0, 2.0):
            total += x
            break
    return total


def bound_that_moves(n: int) -> float:
    total, k = 0.0, n
    for _ in range(k):
        k -= 1
        total += 1.0
    return total


def target_that_jumps(n: int) -> float:
    total = 0.0
    for i in range(n):
        total += 1.0
        i = i + 1
    return total


def target_afterwards(n: int) -> float:
    total = 0.0
    for i in range(n):
        total += i
    return total + i


def target_of_two(n: int) -> float:
    total = 0.0
    for i in range(n):
        for i in range(2):
            total += i
    return total


def row_that_is_exchanged(v: Array) -> float:
    total, w = 0.0, v.copy()
    for x in w:
        w = v
        total += x
    return total


def swapped(v: Array) -> float:
    c, d = v.copy(), v.copy()
    c, d = d, c
    return c[0] + d[0]


def spread(a: Array) -> Array:
    b = a.copy()
    b[:, :] = a[0]
    return b


def spread_sum(a: Array) -> Array:
    b = a.copy()
    b += a[0]
    return b


def slice_of_a_branch(v: Array) -> float:
    if v[0] > 0.0:
        own = slice(0, 2)
    else:
        own = slice(2, 4)
    return v[own][0]


def view_of_a_branch(a: Array) -> float:
    row = a[0]
    if a[0, 0] > 0.0:
        row = a[:, 0]
    return row[1]


def copies(v: Array) -> float:
    one = other = Found(v, 1.0)
    return one.at[0] + other.at[0]


def tuple_and_name(x: float, y: float) -> float:
    (a, b) = c = Planar(x, y)
    return a + b + c.x


def kept_with_a_type(v: Array) -> Array:
    w = v
    for _ in range(3):
        w: Array = w + v
    return w


def kept_beside_a_number(v: Array) -> float:
    old, total = v, 0.0
    for _ in range(3):
        made = v + total
        old, total = made, total + old[0]
    return total


X, N = 1.0, 3
REFUSED = (
    *((beyond, (ROW,), "4"), (before, (ROW,), "-5"), (between, (ROW,), "v[0]")),
    *((longer, (ROW,), "2:5"), (before_the_first, (ROW,), "-5:2")),
    *((longer_by_name, (ROW,), "own"), (nothing, (ROW,), "2:2")),
    *((every_other, (ROW,), "::2"), (last_by_name, (ROW,), "slice(-2, 4)")),
    *((either, (X, X), "x"), (last_of_both, (X, X), "x"), (nobody, (X, X), "x is y")),
    *((truths, (X, X), "(x > 0.0) + (y > 0.0)"), (parts_of_real, (X, X), "x // y")),
    *((for_else, (N,), "for _ in range(n)"), (of_a_tuple, (N,), "for x in (1.0, 2.0)")),
    *((bound_that_moves, (N,), "for _ in range(k)"), (target_afterwards, (N,), "i")),
    *((target_that_jumps, (N,), "for i in range(n)"), (target_of_two, (N,), "for i")),
    *((row_that_is_exchanged, (ROW,), "for x in w"), (swapped, (ROW,), "d")),
    *((spread, (SQUARE,), "a[0]"), (spread_sum, (SQUARE,), "a[0]")),
    *((slice_of_a_branch, (ROW,), "own"), (view_of_a_branch, (SQUARE,), "row")),
    *((copies, (ROW,), "Found(v, 1.0)"), (tuple_and_name, (X, X), "(a, b)")),
    *((kept_with_a_type, (ROW,), "w = w + v"), (kept_beside_a_number, (ROW,), "old")),
)


@pytest.mark.parametrize("case", REFUSED, ids=lambda case: case[0].__name__)
def test_what_c_would_do_otherwise_is_refused(case):
    function, arguments, line = case
    with pytest.raises(ExportError) as refused:
        translate(Program(), function, arguments)
    assert str(refused.value).startswith(f"{function.__name__}: '{line}")
