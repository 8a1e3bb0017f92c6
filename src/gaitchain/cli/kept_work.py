"""Work that goes on where it was interrupted."""

from collections.abc import Iterator
from contextlib import contextmanager

from gaitchain.build.jobs import keeping
from gaitchain.build.journal import Journal
from gaitchain.cli.console import resumable
from gaitchain.errors import GaitchainError, UnfinishedError


@contextmanager
def kept_in(journal: Journal) -> Iterator[None]:
    """Keep what is finished, unless the same command would be refused again."""
    try:
        with resumable(journal.path), keeping(journal):
            yield
    except UnfinishedError:
        raise  # what is finished goes on
    except GaitchainError:
        journal.remove()
        raise
