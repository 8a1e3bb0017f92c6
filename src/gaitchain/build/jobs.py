"""Jobs in parallel processes, whose results can be kept in a journal.

Builds of the same config run the same jobs in the same order. So the call of `run_jobs`
and the number of a job in it say what a result is of, in whatever order jobs finish,
and the library of a resumed build has the same bytes.
"""

import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from itertools import islice
from typing import Any, TypeVar

import msgspec
import numpy as np
from joblib import Parallel, delayed

from gaitchain.build.journal import Journal
from gaitchain.build.workers import can_stream
from gaitchain.errors import WorkerError

_T = TypeVar("_T")
# Jobs for each process that are handed over together where no result comes before the
# last one: an interrupt loses so many at most, and processes that are done wait.
_AT_ONCE = 8
# By which a backend says that a process of its was killed, as for want of memory. Those
# of a backend that is not in use are not imported.
_KILLED = (
    ("joblib.externals.loky.process_executor", "BrokenProcessPool"),
    ("distributed", "KilledWorker"),
    ("ray.exceptions", "RayActorError"),
    ("ray.exceptions", "WorkerCrashedError"),
    ("ray.exceptions", "OutOfMemoryError"),
)
_KILLED_AGAIN = (
    "processes that work were killed {} times, and none of the {} jobs that are left "
    "was finished in between; memory may be short: give fewer --workers, or 1"
)
_TRIES = 2  # of jobs together, none of which is finished before a process is killed
# Meshes of a robot's own model let a process grow by the 300 MB at which joblib starts
# another one in its place. That keeps the memory bounded, and is no news to a user.
warnings.filterwarnings("ignore", message="A worker stopped while some jobs")


class _Kept:
    """A journal, and the position in it of the next call's results."""

    def __init__(self, journal: Journal) -> None:
        self.journal, self._next, self._stages = journal, 0, 0

    def begin(self, name: str, jobs: int) -> list[Any]:
        """Count a call of `run_jobs`; return what its results are known by."""
        self._stages += 1
        return [self._stages, name, jobs]

    def take(self, stage: list[Any], kind: type[_T]) -> dict[int, _T]:
        """Return the results of a call, by the numbers of their jobs."""
        found: dict[int, _T] = {}
        while self._next < len(self.journal.found):
            piece = self.journal.found[self._next]
            try:  # msgspec's errors are these, too
                (*of, number), plain = piece
                if of != stage or number in found or number not in range(stage[-1]):
                    break
                found[number] = msgspec.convert(plain, kind, dec_hook=_array)
            except (TypeError, ValueError):
                break
            self._next += 1
        return found

    def add(self, stage: list[Any], number: int, result: Any) -> None:
        if self._next < len(self.journal.found):
            # Damaged, or of a search with a time limit that ran for more or fewer
            # rounds.
            self.journal.keep(self._next)
        plain = msgspec.to_builtins(result, enc_hook=lambda numbers: numbers.tolist())
        self.journal.add([[*stage, number], plain])


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
    of: str = "",
) -> Iterator[_T]:
    """Call a function for each job, in parallel processes.

    Args:
        work: the function; its result depends on its arguments only.
        jobs: arguments of each call.
        result: type of the results.
        workers: number of processes.
        batch_size: number of jobs sent to a process at once.
        of: what the jobs are of, if neither their function nor their number tells it
            from others that the same call may have.

    Yields:
        The results, in order. The journal has each as soon as it arrives.
    """
    kept, stage = _kept.get(), list[Any]()
    done: dict[int, _T] = {}
    if kept is not None:
        stage = kept.begin(work.__name__ + of, len(jobs))
        done = kept.take(stage, result)
    missing = [(n, work, *job) for n, job in enumerate(jobs) if n not in done]
    arriving = arrivals(missing, workers, batch_size)
    for number in range(len(jobs)):
        while number not in done:
            arrived, came = next(arriving)
            if kept is not None:
                kept.add(stage, arrived, came)
            done[arrived] = came
        yield done.pop(number)


def run_once(name: str, work: Callable[[], _T], result: type[_T]) -> _T:
    """Do work that has processes of its own, unless the journal has what came of it.

    Args:
        name: what its result is known by in the journal.
        work: the work; what comes of it is the same each time.
        result: type of the result.
    """
    kept = _kept.get()
    if kept is None:
        return work()
    stage = kept.begin(name, 1)
    found = kept.take(stage, result)
    if not found:
        found[0] = work()
        kept.add(stage, 0, found[0])
    return found[0]


def arrivals(
    jobs: Sequence[tuple[Any, ...]], workers: int, batch_size: int | str = "auto"
) -> Iterator[tuple[int, Any]]:
    """Yield number and result of each job in the order in which they arrive.

    What was lost with a process that was killed is sent again, in the end each alone:
    a job that kills its process takes no other one with it then.

    Args:
        jobs: of each its number, the function to call, and its arguments.
        workers: number of processes.
        batch_size: number of jobs sent to a process at once.

    Raises:
        WorkerError: processes are killed again and again, and no job is finished.
    """
    missing, tries = {job[0]: job for job in jobs}, 0
    while missing:
        left = [*missing.values()]
        parts = [left] if tries < _TRIES else [[job] for job in left]
        try:
            for part in parts:
                for number, came in _sent(part, workers, batch_size):
                    del missing[number]
                    tries = 0
                    yield number, came
        except _killed() as error:
            tries += 1
            if tries > _TRIES:
                raise WorkerError(_KILLED_AGAIN.format(tries, len(missing))) from error


def _killed() -> tuple[type[Exception], ...]:
    """Return the errors of killed processes that a backend in use may raise."""
    loaded = ((sys.modules.get(module), name) for module, name in _KILLED)
    return tuple(getattr(module, name) for module, name in loaded if module)


def _sent(
    jobs: Sequence[tuple[Any, ...]], workers: int, batch_size: int | str
) -> Iterator[tuple[int, Any]]:
    calls = (delayed(_numbered)(*job) for job in jobs)
    if can_stream():
        order = "generator_unordered"
        pool = Parallel(workers, return_as=order, batch_size=batch_size)
        yield from pool(calls)
        return
    with Parallel(workers, batch_size=batch_size) as pool:
        while part := list(islice(calls, _AT_ONCE * workers)):
            yield from pool(part)


def _numbered(number: int, work: Callable[..., _T], *job: Any) -> tuple[int, _T]:
    return number, work(*job)


def _array(kind: Any, value: Any) -> Any:
    return np.array(value, dtype=np.float64)
