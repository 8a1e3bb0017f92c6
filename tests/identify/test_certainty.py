"""How well replays tell numbers, against closed forms."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gaitchain.identify.certainty import fisher_information, posterior_covariance

PAIRS, NUMBERS, ROWS = 48, 20, 4000


def replays(rng, size, noise):
    """Return pairs of replays of a linear robot, whose rows are as rough as said."""
    slopes = size * rng.standard_normal((NUMBERS, ROWS)) / np.sqrt(ROWS)
    moved = 0.1 * rng.standard_normal((PAIRS, NUMBERS))
    rows = moved @ slopes + noise * rng.standard_normal((PAIRS, ROWS))
    return moved, rows, slopes @ slopes.T


def covariance(rng):
    root = rng.standard_normal((NUMBERS, NUMBERS))
    return root @ root.T + 0.1 * np.eye(NUMBERS)


def test_roughness_tells_nothing():
    """Rows without a slope would say that each number is known to 4 %."""
    moved, rows, _ = replays(np.random.default_rng(0), 0.0, 0.3)
    slopes = np.linalg.lstsq(moved, rows)[0]
    wrong = np.linalg.inv(np.eye(NUMBERS) + slopes @ slopes.T)
    right = posterior_covariance(np.eye(NUMBERS), fisher_information(moved, rows))
    assert np.sqrt(np.diag(wrong)).max() < 0.05
    assert np.sqrt(np.mean(np.diag(right))) > 0.2


def test_what_rows_tell_is_unbiased():
    """Over many sets of replays it is J^T J; slopes alone say far more."""
    rng = np.random.default_rng(1)
    ratios, plain = [], []
    for _ in range(40):
        moved, rows, true = replays(rng, 5.0, 0.05)
        slopes = np.linalg.lstsq(moved, rows)[0]
        ratios.append(np.trace(fisher_information(moved, rows)) / np.trace(true))
        plain.append(np.trace(slopes @ slopes.T) / np.trace(true))
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.05)
    assert np.mean(plain) > 2.0


def test_replays_without_roughness_tell_their_slopes():
    moved, rows, true = replays(np.random.default_rng(2), 5.0, 0.0)
    np.testing.assert_allclose(
        fisher_information(moved, rows), true, rtol=1e-6, atol=1e-6
    )


@pytest.mark.parametrize("pairs", [0, 1, 10])
def test_too_few_pairs_tell_nothing(pairs):
    """As many directions as pairs leave no roughness to be seen; or all fell."""
    moved, rows, _ = replays(np.random.default_rng(3), 5.0, 0.05)
    few = fisher_information(moved[:pairs], rows[:pairs])
    np.testing.assert_array_equal(few, np.zeros((NUMBERS, NUMBERS)))


@given(st.integers(0, 2**32 - 1))
def test_what_is_told_is_added_to_what_was_believed(seed):
    rng = np.random.default_rng(seed)
    before, told = covariance(rng), covariance(rng)
    after = np.linalg.inv(np.linalg.inv(before) + told)
    np.testing.assert_allclose(
        posterior_covariance(before, told), after, rtol=1e-6, atol=1e-8
    )


@given(st.integers(0, 2**32 - 1))
def test_nothing_is_known_less_than_before(seed):
    """Whatever chance makes of what rows tell."""
    rng = np.random.default_rng(seed)
    before, told = covariance(rng), covariance(rng) - covariance(rng)
    lost = np.linalg.eigvalsh(before - posterior_covariance(before, told))
    assert lost.min() > -1e-8 * np.linalg.norm(before)
    np.testing.assert_allclose(posterior_covariance(before, 0.0 * told), before)
