"""The picture of a fit shows the joint that is fitted worst, measured and replayed."""

from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from gaitchain.figures import identification
from gaitchain.figures.identification import Compared, plot_missed, worst_excerpt
from gaitchain.messages import CONTROL_PERIOD_S

ROWS = 1000


def compared(name, rng, missed=0.001):
    """A motion of two joints that a fit leaves noise of."""
    time_s = CONTROL_PERIOD_S * np.arange(ROWS)
    measured = 0.4 * np.sin(np.outer(time_s, [1.0, 2.0]))
    after = rng.normal(0.0, missed, (ROWS, 2))
    return Compared(name, measured, after + 0.02, after)


@pytest.fixture
def motions():
    """Of which the second joint of the second one is fitted worst from 6 s on."""
    rng = np.random.default_rng(0)
    held, standing = compared("held up", rng), compared("standing", rng)
    standing.after[600:900, 1] += 0.01
    held.after[50:60, 0] = np.nan
    return [held, standing]


def test_the_worst_joint_is_that_of_the_rows_that_came(motions):
    """A row that was lost is none that is missed, nor one that is fitted."""
    at, joint, rows, rms = worst_excerpt(motions)
    assert (at, joint) == (1, 1)
    assert rows.start <= 600
    assert rows.stop == rows.start + 400 >= 900
    assert rms == pytest.approx(np.sqrt(np.mean(motions[1].after[:, 1] ** 2)))
    motions[1].after[:300, 1] = motions[1].after[900:, 1] = np.nan
    assert worst_excerpt(motions).rms > 1.2 * rms


def test_measured_angles_are_drawn_against_replayed_ones(motions, monkeypatch):
    figure = Figure(layout="constrained")
    monkeypatch.setattr(identification, "drawing", lambda *size: nullcontext(figure))
    plot_missed(("hip", "knee"), motions, "RES", Path("fit.png"))
    worst, *below = figure.get_axes()
    assert worst.get_title() == "knee, standing: fitted worst, 0.32 deg RMS"
    assert worst.get_xlabel() == "time [s]"
    assert worst.get_ylabel() == "angle [deg]"
    _, measured, before, after = motions[1]
    rows = worst_excerpt(motions).rows
    drawn = [np.radians(line.get_ydata()) for line in worst.get_lines()]
    wanted = [angle[rows, 1] for angle in (measured, measured - before)]
    np.testing.assert_allclose(drawn, [*wanted, (measured - after)[rows, 1]])
    shown_s = worst.get_lines()[0].get_xdata()
    np.testing.assert_allclose(shown_s, CONTROL_PERIOD_S * np.arange(ROWS)[rows])
    assert [axes.get_title() for axes in below] == ["held up", "standing", "", ""]
    labels = [text.get_text() for text in figure.subfigs[0].legends[0].get_texts()]
    assert labels[0] == "measured"
