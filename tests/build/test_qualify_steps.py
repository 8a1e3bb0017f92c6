"""Verdicts on single steps: who is blamed for a fall."""

import numpy as np

from gaitchain.build.qualify import _Counts, _walk_stops_alone
from gaitchain.build.rollout import PhysicsCost
from gaitchain.build.stride import STRIDE_BUILD
from gaitchain.build.workers import Crew
from gaitchain.cli.libraries import shipped_library
from gaitchain.gait.family import STAND
from gaitchain.gait.library import best_gaits
from gaitchain.gait.library_file import load_library

LIBRARY = load_library(shipped_library())


WORLDS = STRIDE_BUILD.training_worlds(LIBRARY.poses, 150.0)
SOURCE = PhysicsCost(LIBRARY.poses, LIBRARY.timing, worlds=WORLDS, workers=2)


def counted(fell):
    """What walks showed, with a fall in the stops from some poses."""
    passes = LIBRARY.pair_passes.copy()
    passes[fell, STAND] -= 1
    return _Counts(LIBRARY.pair_runs, passes, LIBRARY.pair_advance * passes)


def test_stops_that_fell_in_longer_walks_are_walked_alone_and_counted_anew():
    """In walks of two steps, in training worlds; all other counts stay."""
    fell = np.flatnonzero(LIBRARY.allowed_pairs[:, STAND])[[0, 2, 5]]
    before, told = counted(fell), []
    crew = Crew(2, lambda *news: told.append(news), WORLDS)
    after = _walk_stops_alone(best_gaits(LIBRARY.path_costs), before, SOURCE, crew)
    assert (after.runs[fell, STAND] == 8).all()
    assert after.held[fell, STAND].sum() >= 2
    assert not before.held[fell, STAND].any()
    others = np.ones(before.runs.shape, dtype=bool)
    others[fell, STAND] = False
    for old, new in zip(before, after, strict=True):
        np.testing.assert_array_equal(old[others], new[others])
    assert told[-1] == ("walking stops alone", 24, 24)


def test_where_no_stop_fell_nothing_is_walked_again():
    before, told = counted([]), []
    crew = Crew(1, lambda *news: told.append(news), WORLDS)
    gait_of = best_gaits(LIBRARY.path_costs)
    assert _walk_stops_alone(gait_of, before, SOURCE, crew) is before
    assert not told
