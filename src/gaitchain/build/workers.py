"""Who does the physics, and who hears about it."""

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import TypeVar

from gaitchain.sim.world_range import WorldRange

Progress = Callable[[str, int, int], None]
"""Called with (stage, done, total)."""
_T = TypeVar("_T")


@dataclass(frozen=True)
class Crew:
    """Processes for the physics, and a listener."""

    workers: int
    tell: Progress
    worlds: WorldRange = field(default_factory=WorldRange)
    """How much the physics varies."""

    def track(self, stage: str, results: Iterator[_T], total: int) -> Iterator[_T]:
        """Pass results on and report each."""
        self.tell(stage, 0, total)
        for done, result in enumerate(results, start=1):
            self.tell(stage, done, total)
            yield result


def available_cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 1
