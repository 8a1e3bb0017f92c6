"""No stage of a build walks in the worlds of another one, or of a user's trial."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from planned_library import planned_res

from gaitchain.build import no_walk, seed_banks
from gaitchain.build.seed_banks import SeedBank
from gaitchain.build.workers import Crew
from gaitchain.cli.options import _SEED
from gaitchain.gait.build_config import BuildConfig
from gaitchain.gait.limits import Limits, declared
from gaitchain.sim.world import World
from gaitchain.sim.world_range import WorldRange

BANKS = {n: b for n, b in vars(seed_banks).items() if isinstance(b, SeedBank)}
LARGEST = int(declared(BuildConfig, Limits)["seed"].high)


def spans(seed):
    """(begin, end, name) of each bank in a build, in order."""
    found = ((b.base + b.each * seed, b.each, name) for name, b in BANKS.items())
    return sorted((begin, begin + each, name) for begin, each, name in found)


def test_banks_do_not_touch_in_any_build():
    """Lines that do not meet at both ends, and do not change places, never meet."""
    for seed in (0, LARGEST):
        assert all(one[1] <= other[0] for one, other in pairwise(spans(seed)))
    assert [n for *_, n in spans(0)] == [n for *_, n in spans(LARGEST)]
    rng = np.random.default_rng(0)
    for seed in rng.integers(LARGEST, size=2000).tolist():
        assert all(one[1] <= other[0] for one, other in pairwise(spans(seed)))


def test_banks_are_above_those_of_trials_and_worlds_have_such_seeds():
    runs = 1_000_000  # of a trial, the most that there can be
    assert spans(0)[0][0] > _SEED.high
    most = declared(World, Limits)["seed"].high
    assert max(end for _, end, _ in spans(LARGEST)) * runs <= most


@pytest.mark.parametrize("seed", [0, 7, LARGEST])
def test_asking_why_it_does_not_walk_has_seeds_of_the_builds_own(seed, monkeypatch):
    """They were those of harder worlds in the build of seed 0, whatever the build."""
    asked = set()

    def walked(work, jobs, kind, workers):
        asked.update(own for _, (own, _) in jobs)
        return (no_walk._End(False, "", "") for _ in jobs)

    monkeypatch.setattr(no_walk, "run_jobs", walked)
    library = planned_res()
    library = replace(library, config=replace(library.config, seed=seed))
    crew = Crew(1, lambda *news: None, WorldRange(model_error=0.0))
    no_walk._walk_all(library, 0.1, crew)
    assert asked == {seed_banks.NO_WALK.base + seed}
