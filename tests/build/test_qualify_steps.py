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


def test_stops_that_all_were_blamed_for_other_steps_are_walked_alone():
    """In walks of two steps, in training worlds; the other steps keep their counts."""
    runs, passes = LIBRARY.pair_runs.copy(), LIBRARY.pair_passes.copy()
    passes[:, STAND] -= 1
    few = np.flatnonzero(passes[STAND] == runs[STAND])[:3]
    runs[STAND, ~np.isin(np.arange(len(runs)), few)] = 0
    counts = _Counts(runs, passes, LIBRARY.pair_advance * passes)
    assert not counts.held[:, STAND].any()
    told = []
    worlds = STRIDE_BUILD.training_worlds(LIBRARY.poses, 150.0)
    crew = Crew(2, lambda *news: told.append(news), worlds)
    source = PhysicsCost(LIBRARY.poses, LIBRARY.timing, worlds=worlds, workers=2)
    found = _walk_stops_alone(best_gaits(LIBRARY.path_costs), counts, source, crew)
    walked = np.zeros(len(runs), dtype=int)
    walked[few] = 8
    np.testing.assert_array_equal(found.runs[:, STAND], walked)
    assert (found.passes[:, STAND] == walked).sum() > len(runs) - 2
    assert found.held[:, STAND].any()
    for before, after in zip(counts, found, strict=True):
        np.testing.assert_array_equal(before[:, 1:], after[:, 1:])
    assert told[-1] == ("walking every stop alone", 24, 24)
