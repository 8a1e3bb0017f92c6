"""Least squares by Jacobi rotations against LAPACK's."""

import numpy as np
import pytest

from gaitchain.balance.least_squares import least_squares


@pytest.mark.parametrize("equations", [5, 6, 7])
@pytest.mark.parametrize("rank", [6, 4])
def test_it_finds_what_lapack_finds(equations, rank):
    rng = np.random.default_rng(10 * equations + rank)
    rows = rng.normal(size=(equations, rank)) @ rng.normal(size=(rank, 6))
    values = rng.normal(size=(equations, 2))
    found = least_squares(rows.copy(), values.copy())
    known = np.linalg.lstsq(rows, values, rcond=1e-12)[0]
    np.testing.assert_allclose(found, known, rtol=1e-9, atol=1e-12)


def test_nothing_to_solve_is_nothing():
    assert not least_squares(np.zeros((5, 6)), np.ones((5, 1))).any()
