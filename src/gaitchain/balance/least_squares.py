"""Least squares with a handful of unknowns, by one-sided Jacobi rotations. Compiled.

Rotations of the equations, in pairs, make the rows of A orthogonal to each other
[Hestenes58]: with V^T A = S U^T the solution of least size is U S^-1 V^T b. What the
equations do not tell apart, rows of no length, is left out.
"""

import math

import numpy as np

from gaitchain.balance.compiled import compiled
from gaitchain.messages import Array

_SWEEPS = 30  # five to eight are needed
_ORTHOGONAL = 1e-15  # cosine of the angle between two rows
_NOTHING = 2e-15  # of the longest row, one shorter tells nothing


@compiled
def least_squares(rows: Array, values: Array) -> Array:
    """Solve A x = b in the sense of least squares, by the x of least size.

    Args:
        rows: (m, n) A; overwritten.
        values: (m, k) b, a column for each problem; overwritten.

    Returns:
        (n, k) x.
    """
    count, unknowns, problems = rows.shape[0], rows.shape[1], values.shape[1]
    for _ in range(_SWEEPS):
        turned = False
        for one in range(count - 1):
            for other in range(one + 1, count):
                if _make_orthogonal(rows, values, one, other):
                    turned = True
        if not turned:
            break
    longest = 0.0
    for i in range(count):
        longest = max(longest, _product(rows, i, i))
    found = np.zeros((unknowns, problems))
    for i in range(count):
        square = _product(rows, i, i)
        if square <= _NOTHING * _NOTHING * longest:
            continue
        for j in range(unknowns):
            for k in range(problems):
                found[j, k] += rows[i, j] * values[i, k] / square
    return found


@compiled
def _product(rows: Array, one: int, other: int) -> float:
    """Return the scalar product of two rows."""
    total = 0.0
    for j in range(rows.shape[1]):
        total += rows[one, j] * rows[other, j]
    return total


@compiled
def _make_orthogonal(rows: Array, values: Array, one: int, other: int) -> bool:
    """Rotate two equations so that their rows are orthogonal; False if they were."""
    first, second = _product(rows, one, one), _product(rows, other, other)
    both = _product(rows, one, other)
    if abs(both) <= _ORTHOGONAL * math.sqrt(first * second):
        return False
    ratio = 0.5 * (second - first) / both
    tangent = 1.0 / (abs(ratio) + math.hypot(1.0, ratio))
    tangent = tangent if ratio > 0.0 else -tangent
    c = 1.0 / math.hypot(1.0, tangent)
    s = c * tangent
    _rotate(rows, one, other, c, s)
    _rotate(values, one, other, c, s)
    return True


@compiled
def _rotate(rows: Array, one: int, other: int, c: float, s: float) -> None:
    """Rotate two rows in their plane."""
    for j in range(rows.shape[1]):
        x, y = rows[one, j], rows[other, j]
        rows[one, j], rows[other, j] = c * x - s * y, s * x + c * y
