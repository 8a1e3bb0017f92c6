"""Steps by smooth slopes, on rough residuals that can be written down."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from gaitchain.identify.chord import MOST_STEPS, GaussianPrior, follow, slopes

SIZE, ROWS, SENSORS = 5, 30, 4
DESIGN = np.random.default_rng(3).normal(size=(ROWS, SENSORS, SIZE))
PRIOR = GaussianPrior(
    np.zeros(SIZE), 1e-6 * np.eye(SIZE), np.full(SIZE, -9.0), np.full(SIZE, 9.0)
)
RIPPLE = 0.2  # of which the slopes are some twenty times those of the rest


def missed_of(true, ripple=RIPPLE):
    """Return what is missed: linear in the error, and rough with it."""

    def missed(vectors):
        linear = np.moveaxis(DESIGN @ (vectors - true).T, -1, 0)
        return linear + ripple * np.sign(np.sin(40.0 * linear))

    return missed


def even(rows):
    return np.ones(rows.shape[1])


def reached(true, missed, prior=PRIOR):
    slope = slopes(np.eye(SIZE), -np.eye(SIZE), missed_of(true, 0.0))
    return follow(np.zeros(SIZE), slope, prior, missed, even)


@given(st.integers(0, 2**31))
def test_smooth_slopes_lead_through_rough_residuals(seed):
    true = np.random.default_rng(seed).uniform(-3.0, 3.0, SIZE)
    rough = missed_of(true)
    found = reached(true, rough)
    np.testing.assert_allclose(found, true, atol=0.2)
    by = 1e-3 * np.eye(SIZE)
    own = follow(np.zeros(SIZE), slopes(by, -by, rough), PRIOR, rough, even)
    assert np.abs(found - true).max() < np.abs(own - true).max(), "its own slopes"


def test_slopes_are_those_of_numbers_that_move():
    """Where a replay fell there is none, nor of a number that is not moved."""
    moved = np.diag([0.5, 0.0, 0.5, 0.1, 0.5])
    plain = missed_of(np.ones(SIZE), 0.0)

    def missed(vectors):
        rows = plain(vectors)
        rows[2] = np.nan
        return rows

    slope = slopes(moved, -moved, missed)
    assert slope.shape == DESIGN.shape
    np.testing.assert_allclose(slope[..., [0, 3, 4]], DESIGN[..., [0, 3, 4]])
    np.testing.assert_array_equal(slope[..., [1, 2]], 0.0)


def test_what_is_believed_holds_against_few_rows():
    """As of linear least squares with a prior, whose solution is known."""
    true, precision = np.full(SIZE, 2.0), 40.0 * np.eye(SIZE)
    flat = DESIGN.reshape(-1, SIZE)
    expected = np.linalg.solve(flat.T @ flat + precision, flat.T @ flat @ true)
    found = reached(true, missed_of(true, 0.0), PRIOR._replace(precision=precision))
    np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_numbers_stay_within_their_bounds():
    true = np.full(SIZE, 2.0)
    held = PRIOR._replace(most=np.array([9.0, 1.0, 9.0, 9.0, 9.0]))
    found = reached(true, missed_of(true, 0.0), held)
    assert found[1] == 1.0
    assert (found <= held.most).all()
    least = np.array([-9.0, -1.0, -9.0, -9.0, -9.0])
    low = reached(-true, missed_of(-true, 0.0), PRIOR._replace(least=least))
    assert low[1] == -1.0
    assert (low >= least).all()


def test_a_step_that_makes_nothing_better_is_the_last():
    """Slopes of the wrong sign lead nowhere, and cost one round of replays."""
    true, asked = np.ones(SIZE), []

    def missed(vectors):
        asked.append(len(vectors))
        return missed_of(true, 0.0)(vectors)

    found = follow(np.zeros(SIZE), -DESIGN, PRIOR, missed, even)
    np.testing.assert_array_equal(found, np.zeros(SIZE))
    assert len(asked) == 2 < MOST_STEPS
