"""Learn how far feet usually slide in a step, from walks in physics. Ours."""

from collections.abc import Sequence

import numpy as np
import scipy

from gaitchain.analysis.walked_way import Way, Ways
from gaitchain.gait.slide import Slide, Slides
from gaitchain.messages import Array

_FEWEST = 8  # walks from which four numbers are learned
_LEAST_M = 1e-4  # by which a walk is off
_LIKELY = 0.1  # of the way of the furthest step: what one walk weighs against


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
    ahead, left = told.T / steps
    furthest = max(float(np.abs([ahead, left]).max()), _LEAST_M)
    fore, back = np.maximum(ahead, 0.0), np.minimum(ahead, 0.0)
    terms = steps * [np.ones_like(ahead), fore**2, back**2]
    parts = [1.0 / furthest, furthest, furthest]
    each, of_fore, of_back = _fit(terms, off[:, 0], parts)
    (aside,) = _fit(steps * [left * np.abs(left)], off[:, 1], [furthest])
    return Slide(each, of_fore, of_back, aside)


def _fit(terms: Array, off: Array, parts: Sequence[float]) -> list[float]:
    """Fit numbers by least squares, in proportion where a walk is off more than usual.

    A walk whose feet slipped says nothing of the others. Of ways that they hardly go
    walks say nothing: their numbers are small.

    Args:
        terms: (N, W) what each number, times one, adds to each walk.
        off: (W,) by which the walks are off [m].
        parts: (N,) what each number, times one, adds to the furthest step of all, as a
            part of its way.
    """
    start = np.linalg.lstsq(terms.T, off, rcond=None)[0]
    usual = max(float(np.median(np.abs(start @ terms - off))), _LEAST_M)
    weight = usual * np.array(parts) / _LIKELY

    def errors(numbers: Array) -> Array:
        return np.append(numbers @ terms - off, weight * numbers)

    found = scipy.optimize.least_squares(errors, start, loss="soft_l1", f_scale=usual)
    return [float(number) for number in found.x]
