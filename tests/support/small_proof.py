"""As short a proof as there can be, of the library that comes with the package.

Run as a program, this is the command line that proves as briefly.
"""

from contextlib import contextmanager
from dataclasses import replace

import pytest

from gaitchain.build.qualify import default_grid
from gaitchain.build.workers import Crew
from gaitchain.cli import main
from gaitchain.cli.libraries import shipped_library
from gaitchain.gait.library_file import library_bytes, load_library
from gaitchain.proof import proof_walks
from gaitchain.proof.fall_rate import prove
from gaitchain.proof.proof_walks import Criterion

BRIEF = Criterion(bound=0.05, seconds=3.0)
WORDS = ("qualify", "res", "--bound", "0.05", "--seconds", "3")
"""The same from the command line."""


@contextmanager
def few_worlds():
    """Walk in 15 of 33 worlds: four instead of 20 are then left to be chosen."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(proof_walks, "default_grid", _few_levels)
        yield


def _few_levels(library):
    grid = default_grid(library)
    return replace(grid, levels=grid.levels[:12])


@contextmanager
def few_at_once():
    """Seventeen draws suffice; of 32 that are begun together half would be in vain."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(proof_walks, "_BATCH", 18)
        yield


def proven(workers):
    """Return the bytes of the library that is proven.

    Args:
        workers: number of processes.
    """
    library = load_library(shipped_library())
    with few_worlds(), few_at_once():
        return library_bytes(prove(library, BRIEF, Crew(workers, lambda *news: None)))


if __name__ == "__main__":
    with few_worlds():
        main()
