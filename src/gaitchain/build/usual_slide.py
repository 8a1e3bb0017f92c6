"""Learn how far feet usually slide in a step, from walks in physics. Ours."""

from collections.abc import Sequence

import numpy as np
import scipy

from gaitchain.analysis.walked_way import Way, Ways
from gaitchain.gait.slide import Slide, Slides
from gaitchain.messages import Array

_FEWEST = 8  # walks from which three numbers are learned
_LEAST_M = 1e-4  # by which a walk is off
_LIKELY = 0.02  # of the way: what one walk weighs against


def learn_slides(walks: Sequence[Ways]) -> Slides:
    """Return the slides that explain walks best; none by a few walks.

    Args:
        walks: in all directions, in the worlds that are usual.
    """
    if len(walks) < _FEWEST:
        return Slides()
    return Slides(*(_slide([getattr(w, by) for w in walks]) for by in Slides._fields))


def _slide(ways: Sequence[Way]) -> Slide:
    steps = np.array([way.steps for way in ways], dtype=float)
    told = np.array([way.told for way in ways])
    off = np.array([way.true for way in ways]) - told
    each, ahead = _fit(np.stack([steps, told[:, 0]], axis=1), off[:, 0])
    (left,) = _fit(told[:, 1:], off[:, 1])
    return Slide(each, ahead, left)


def _fit(columns: Array, off: Array) -> list[float]:
    """Fit numbers by least squares, in proportion where a walk is off more than usual.

    A walk whose feet slipped says nothing of the others. The last number is the part of
    the way, of which walks say nothing that hardly go that way: it is `_LIKELY` at most
    unless they do.
    """
    start = np.linalg.lstsq(columns, off, rcond=None)[0]
    usual = max(float(np.median(np.abs(columns @ start - off))), _LEAST_M)

    def errors(numbers: Array) -> Array:
        return np.append(columns @ numbers - off, usual * numbers[-1] / _LIKELY)

    found = scipy.optimize.least_squares(errors, start, loss="soft_l1", f_scale=usual)
    return [float(number) for number in found.x]
