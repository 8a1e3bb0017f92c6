"""Walks for splitting: what their seeds determine, and that falls are found."""

import numpy as np
import pytest

from gaitchain.build.push import impulse_scale
from gaitchain.build.workers import Crew
from gaitchain.cli.libraries import shipped_library
from gaitchain.gait.library_file import load_library
from gaitchain.proof import split_walks
from gaitchain.proof.fall_rate import mild_cells
from gaitchain.proof.split_walks import Disturbed, SplitSize, split_falls, walk_slices
from gaitchain.proof.splitting import EVENT
from gaitchain.walker.walker import Walker

LIBRARY = load_library(shipped_library())
SCALE_NS = impulse_scale(LIBRARY)[2]


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


@pytest.mark.slow
def test_a_report_has_splitting_beside_brute_force():
    told = []
    crew = Crew(1, lambda *news: told.append(news))
    size = SplitSize(paths=8, repetitions=2)
    found = split_falls(Disturbed(LIBRARY, 0.3, 3), size, 0.95, crew)
    assert found.walks >= found.first[0] == 16
    assert 0.0 < found.per_walk.mean < 1.0
    assert found.per_walk.low <= found.per_walk.mean <= found.per_walk.high
    assert 0.0 < found.per_step.mean < found.per_walk.mean
    assert told[-1] == ("splitting", 2, 2)
