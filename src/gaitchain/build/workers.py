"""Processes for the physics, and the report of their progress."""

import os
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from numbers import Integral
from typing import TypeVar

from joblib.parallel import get_active_backend

from gaitchain.build.progress import Progress
from gaitchain.errors import CommandError
from gaitchain.sim.world_range import WorldRange

_T = TypeVar("_T")


@dataclass(frozen=True)
class Crew:
    """Processes, progress callback and worlds of a build."""

    workers: int
    """Number of processes."""
    progress: Progress
    """Called to report progress."""
    worlds: WorldRange = field(default_factory=WorldRange)
    """Range of the worlds."""

    def __post_init__(self) -> None:
        """Refuse a number of processes with which no job would ever be done.

        Raises:
            CommandError: it is no whole number from 1 on.
        """
        if not isinstance(self.workers, Integral) or self.workers < 1:
            raise CommandError(f"workers is {self.workers!r}, must be 1 or more, whole")

    def on(self, what: str) -> "Crew":
        """Return the same crew, which says in each stage what it works on."""

        def progress(stage: str, done: int, total: int) -> None:
            self.progress(f"{what}: {stage}", done, total)

        return replace(self, progress=progress)

    def track(self, stage: str, results: Iterator[_T], total: int) -> Iterator[_T]:
        """Yield the results, and report the progress after each.

        Args:
            stage: name of the stage of the build.
            results: the results.
            total: their number.
        """
        self.progress(stage, 0, total)
        for done, result in enumerate(results, start=1):
            self.progress(stage, done, total)
            yield result


def in_round(stage: str, number: int) -> str:
    """Return a stage's name in one of its rounds, which count from 0."""
    return f"{stage}, round {number + 1}" if number else stage


def can_stream() -> bool:
    """Return whether joblib's backend yields results while others are computed.

    Ray's does not; it returns them all at the end.
    """
    return bool(get_active_backend()[0].supports_return_generator)


def available_cores() -> int:
    """Return the number of cores that this process may use; of all, off Linux."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
