"""Search key poses that lead from lying to standing, in physics. Ours.

Nothing is known of the robot but which of its joints mirror each other. The best of
many random ways is where CMA-ES (Hansen 2016) begins, with one start. A way that stands
from it is tried from others; those that fail take part from then on. Where nothing
stands for long, the search begins anew.
"""

import math
from collections.abc import Callable, Iterator
from itertools import islice
from typing import NamedTuple

import numpy as np
from cmaes import CMA

from gaitchain.build.jobs import run_jobs
from gaitchain.errors import CommandError
from gaitchain.gait.get_up import GetUp, Side, Way
from gaitchain.getup.fallen_robot import Start, Subject, fallen_robot
from gaitchain.getup.ways import POSES, Tried, judge, way_of
from gaitchain.messages import Array

_DRAWN = 192  # random ways
_CROWD = 24  # ways of a generation
_SPREAD, _AGAIN = 0.5, 0.2  # of CMA-ES at first, and with more starts [rad]
_PATIENCE = 70  # generations with the same starts
_MORE, _MOST = 4, 12  # starts that take part at once, and at all
_OTHERS, _ENOUGH = 12, 11  # starts of a trial between, and of these that stand

Tell = Callable[[str, int, int], None]
"""Takes what is done, the generations so far, and their largest number."""


class Effort(NamedTuple):
    """How long to search, and with what."""

    generations: int
    seed: int
    workers: int


class WaySearch:
    """The search of a way to get up from one side."""

    def __init__(self, subject: Subject, side: Side, effort: Effort) -> None:
        """Make ready.

        Args:
            subject: the robot.
            side: what it lies on.
            effort: how long to search.

        Raises:
            CommandError: no joints of the robot could lift it.
        """
        self._robot = fallen_robot(subject)
        if not self._robot.pairs:
            name = subject.library.robot.name
            raise CommandError(f"{name}: no joint has a mirror image on the other side")
        self._subject, self._side, self._effort = subject, side, effort
        self._rng = np.random.default_rng(effort.seed)
        self._fresh, self._left = 0, 0

    def run(self, tell: Tell) -> Way:
        """Return the way that stood from most starts; none may have.

        Args:
            tell: called after each generation.
        """
        most, self._left = self._effort.generations, self._effort.generations
        stage = f"up from the {self._side}"

        def note() -> None:
            tell(stage, most - self._left, most)

        note()
        starts, numbers, spread = self._anew()
        best, count = numbers, 0
        while self._left and count < _ENOUGH:
            numbers, tried = self._improve(numbers, starts, spread, note)
            if not any(one.stood for one in tried):
                starts, numbers, spread = self._anew()
                continue
            stood, failed = self._try_others(numbers)
            if stood > count:
                best, count = numbers, stood
            starts, spread = [*failed[:_MORE], *starts][:_MOST], _AGAIN
        tell(stage, most, most)
        return way_of(self._robot, best, count, _OTHERS)

    def _improve(
        self, begin: Array, starts: list[Start], spread: float, note: Callable[[], None]
    ) -> tuple[Array, list[Tried]]:
        """Return the best way after some generations, and what came of it."""
        found = begin, list[Tried]()
        climb = self._climb(begin, starts, spread)
        for found in islice(climb, min(_PATIENCE, self._left)):
            self._left -= 1
            note()
            if all(one.stood for one in found[1]):
                break
        return found

    def _try_others(self, numbers: Array) -> tuple[int, list[Start]]:
        """Return from how many other starts a way stands, and those that fail."""
        others = self._draw_starts(_OTHERS)
        came = self._try([numbers], others)[0]
        failed = [s for s, one in zip(others, came, strict=True) if not one.stood]
        return len(others) - len(failed), failed

    def _anew(self) -> tuple[list[Start], Array, float]:
        """Return a start, where to begin with it, and how widely to search."""
        starts = self._draw_starts(1)
        return starts, self._best_drawn(starts), _SPREAD

    def _draw_starts(self, count: int) -> list[Start]:
        self._fresh += count
        numbers = range(self._fresh - count, self._fresh)
        return [(self._effort.seed, number) for number in numbers]

    def _best_drawn(self, starts: list[Start]) -> Array:
        """Return the random way that comes furthest."""
        size = POSES * (len(self._robot.pairs) + 1)
        drawn = list(self._rng.normal(0.0, 1.0, (_DRAWN, size)))
        worth = [_worth(tried) for tried in self._try(drawn, starts)]
        return np.asarray(drawn[int(np.argmax(worth))])

    def _climb(
        self, begin: Array, starts: list[Start], spread: float
    ) -> Iterator[tuple[Array, list[Tried]]]:
        """Yield the best way so far after each generation, and what came of it."""
        climber = CMA(
            mean=begin,
            sigma=spread,
            population_size=_CROWD,
            seed=int(self._rng.integers(2**31)),
        )
        best, most, came = begin, -math.inf, list[Tried]()
        while not climber.should_stop():
            crowd = [climber.ask() for _ in range(_CROWD)]
            found = self._try(crowd, starts)
            worth = [_worth(tried) for tried in found]
            climber.tell([(x, -w) for x, w in zip(crowd, worth, strict=True)])
            top = int(np.argmax(worth))
            if worth[top] > most:
                best, most, came = crowd[top], worth[top], found[top]
            yield best, came

    def _try(self, ways: list[Array], starts: list[Start]) -> list[list[Tried]]:
        """Return of each way what came of it from each start."""
        jobs = [(self._subject, self._side, way, s) for way in ways for s in starts]
        came = list(run_jobs(try_way, jobs, Tried, self._effort.workers))
        count = len(starts)
        return [came[i : i + count] for i in range(0, len(came), count)]


def _worth(tried: list[Tried]) -> float:
    """Return what a way is worth: half of it is how it does at its worst."""
    values = [one.value for one in tried]
    return 0.5 * (float(np.mean(values)) + min(values))


def try_way(subject: Subject, side: Side, numbers: Array, start: Start) -> Tried:
    """Lie down at random and go the way that some numbers stand for."""
    robot = fallen_robot(subject)
    robot.lie(side, start)
    return judge(robot.move(way_of(robot, numbers)))


def assemble(subject: Subject, ways: dict[Side, Way]) -> GetUp:
    """Return what was found of one robot."""
    robot, known = fallen_robot(subject), subject.library.robot
    lying = tuple(np.round(robot.stand, 4).tolist())
    names = robot.backend.joint_names
    return GetUp(known.name, known.fingerprint, names, lying, ways)
