"""As short a proof as there can be, of the library that comes with the package."""

import pytest

from gaitchain.build.workers import Crew
from gaitchain.cli.libraries import shipped_library
from gaitchain.gait.library_file import library_bytes, load_library
from gaitchain.proof import proof_walks
from gaitchain.proof.fall_rate import prove
from gaitchain.proof.proof_walks import Criterion

BRIEF = Criterion(bound=0.05, seconds=3.0)
WORDS = ("qualify", "res", "--bound", "0.05", "--seconds", "3")
"""The same from the command line."""


def proven(workers):
    """Return the bytes of the library that is proven.

    Of 32 walks that are begun together half would be in vain.

    Args:
        workers: number of processes.
    """
    library = load_library(shipped_library())
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(proof_walks, "_BATCH", 18)
        return library_bytes(prove(library, BRIEF, Crew(workers, lambda *news: None)))
