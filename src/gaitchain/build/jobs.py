"""Jobs in parallel processes, whose results can be kept in a journal.

Builds of the same config run the same jobs in the same order. So the n-th result of an
interrupted build is the n-th of the resumed one, and the library has the same bytes.
"""

import contextlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, TypeVar

import msgspec
import numpy as np
from joblib import Parallel, delayed

from gaitchain.build.journal import Journal
from gaitchain.build.workers import can_stream

_T = TypeVar("_T")


class _Kept:
    """A journal, and the position in it of the next result."""

    def __init__(self, journal: Journal) -> None:
        self.journal, self._next, self._stages = journal, 0, 0

    def begin(self) -> int:
        """Count a call of `run_jobs`; return its number."""
        self._stages += 1
        return self._stages

    def take(self, key: list[Any], kind: type[_T]) -> _T | None:
        """Return the next result if it has this key; else None, and drop the rest."""
        if self._next == len(self.journal.found):
            return None
        piece = self.journal.found[self._next]
        with contextlib.suppress(TypeError, ValueError):  # msgspec's errors are these
            of, plain = piece
            if of == key:
                result = msgspec.convert(plain, kind, dec_hook=_array)
                self._next += 1
                return result
        # Damaged, or of a search with a time limit that ran for more or fewer rounds.
        self.journal.keep(self._next)
        return None

    def add(self, key: list[Any], result: Any) -> None:
        plain = msgspec.to_builtins(result, enc_hook=lambda numbers: numbers.tolist())
        self.journal.add([key, plain])


_kept: ContextVar[_Kept | None] = ContextVar("kept", default=None)


@contextmanager
def keeping(journal: Journal) -> Iterator[None]:
    """Read finished results from a journal, and add the others to it."""
    with journal:
        token = _kept.set(_Kept(journal))
        try:
            yield
        finally:
            _kept.reset(token)


def run_jobs(
    work: Callable[..., _T],
    jobs: Sequence[tuple[Any, ...]],
    result: type[_T],
    workers: int,
    batch_size: int | str = "auto",
) -> Iterator[_T]:
    """Call a function for each job, in parallel processes.

    Args:
        work: the function; its result depends on its arguments only.
        jobs: arguments of each call.
        result: type of the results.
        workers: number of processes.
        batch_size: number of jobs sent to a process at once.

    Yields:
        The results, in order.
    """
    kept, done = _kept.get(), 0
    keys: list[list[Any]] = []
    if kept is not None:
        stage = [kept.begin(), work.__name__, len(jobs)]
        keys = [[*stage, number] for number in range(len(jobs))]
        for key in keys:
            found = kept.take(key, result)
            if found is None:
                break
            done += 1
            yield found
    calls = (delayed(work)(*job) for job in jobs[done:])
    order = "generator" if can_stream() else "list"
    pool = Parallel(workers, return_as=order, batch_size=batch_size)
    for number, finished in enumerate(pool(calls), start=done):
        if kept is not None:
            kept.add(keys[number], finished)
        yield finished


def _array(kind: Any, value: Any) -> Any:
    return np.array(value, dtype=np.float64)
