"""Walks for splitting: what their seeds determine, and that falls are found."""

from functools import wraps

import numpy as np
import pytest

from gaitchain.build.push import impulse_unit_ns
from gaitchain.build.workers import Crew
from gaitchain.cli.libraries import shipped_library
from gaitchain.gait.library_file import load_library
from gaitchain.proof import split_walks
from gaitchain.proof.proof_walks import mild_cells
from gaitchain.proof.split_walks import (
    SLICE_S,
    Disturbed,
    SplitSize,
    split_falls,
    walk_slices,
)
from gaitchain.proof.splitting import EVENT, overlap
from gaitchain.walker.walker import Walker

LIBRARY = load_library(shipped_library())
SCALE_NS = impulse_unit_ns(LIBRARY)


def walked(seeds, hardest=0.2):
    disturbed = Disturbed(LIBRARY, hardest, len(seeds))
    return walk_slices(disturbed, mild_cells(LIBRARY), SCALE_NS, 7, seeds)


def test_branches_are_the_same_up_to_where_they_part():
    one, other = walked((1, 2, 3, 4, 5)), walked((1, 2, 3, 9, 8))
    assert one.levels[:3] == other.levels[:3]
    assert one.levels[3:] != other.levels[3:]
    assert walked((1, 2, 3, 4, 5)) == one


def test_a_level_says_how_near_a_fall_is():
    calm, felled = walked((1, 2, 3), 0.01), walked((1, 2, 3), 1.5)
    assert max(calm.levels) < 0.5
    assert felled.levels[-1] == EVENT
    assert all(0.0 < level < EVENT for level in felled.levels[:-1])


def told_report(hardest, slices, size):
    told = []
    crew = Crew(1, lambda *news: told.append(news))
    return split_falls(Disturbed(LIBRARY, hardest, slices), size, 0.95, crew), told


@pytest.mark.slow
def test_a_report_has_splitting_beside_brute_force():
    found, told = told_report(0.3, 3, SplitSize(paths=8, repetitions=2, alone=16))
    assert found.walks >= 16 == found.alone[0]
    assert 0.0 < found.per_walk.mean < 1.0
    assert found.per_walk.low <= found.per_walk.mean <= found.per_walk.high
    assert 0.0 < found.per_step.mean < found.per_walk.mean
    assert found.agrees == overlap(found.per_walk, found.brute)
    assert ("splitting", 2, 2) in told
    assert told[-1] == ("walking without splitting", 1, 1)


@pytest.fixture(scope="module")
def walked_seeds():
    """A report of walks that all fall, and the seeds of each walk."""
    walk, seeds = split_walks.walk_slices, []

    @wraps(walk)
    def noted(*job):
        seeds.append(job[-1])
        return walk(*job)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(split_walks, "walk_slices", noted)
        return told_report(1.5, 3, SplitSize(4, 2, 6))[0], seeds


@pytest.mark.slow
def test_where_every_walk_falls_steps_are_counted_and_nothing_is_sure(walked_seeds):
    """What falls has made steps, too, and eight falls in eight are not a law."""
    found, _ = walked_seeds
    assert (found.walks, found.per_walk.mean) == (8, 1.0)
    assert found.per_walk.low < 0.7
    steps = found.per_walk.mean / found.per_step.mean
    assert 1.0 <= steps < 3.0 * SLICE_S / LIBRARY.timing.step
    assert found.per_step.high == found.per_walk.high / steps


@pytest.mark.slow
def test_brute_force_walks_other_walks_than_splitting(walked_seeds):
    found, seeds = walked_seeds
    assert found.alone == (6, 6)
    assert found.agrees
    assert len(seeds) == len(set(seeds)) == 8 + 6


def test_commands_are_drawn_as_the_proof_draws_them():
    """Uniformly from what is possible together, where few are at its ends."""
    commands = []

    class Noting(Walker):
        def command(self, command):
            commands.append(command)
            return super().command(command)

    most = LIBRARY.command_range
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(split_walks, "Walker", Noting)
        for first in range(12):
            walked((first,))
    shares = np.array([most.share(command) for command in commands])
    assert len(shares) == 12
    assert np.sum(shares > 0.999) == 0
