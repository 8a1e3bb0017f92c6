"""Search key poses that lead from lying to standing, in physics. Ours.

Nothing is known of the robot but which of its joints mirror each other, and how it
squats. `Exploration` finds ways that stand from a few ways of lying. Where none of them
stands from most others, CMA-ES (Hansen 2016) goes on from the best; each of its
generations has other ways of lying, those it failed at last among them. Where nothing
stands for long, the search begins anew.
"""

from collections.abc import Callable, Generator, Iterator
from typing import NamedTuple

import numpy as np

from gaitchain.build.jobs import run_jobs
from gaitchain.errors import CommandError
from gaitchain.gait.get_up import GetUp, Side, Way
from gaitchain.getup.exploration import Exploration
from gaitchain.getup.fallen_robot import Start, Subject, fallen_robot
from gaitchain.getup.ways import TAIL, Tried, judge, way_of
from gaitchain.messages import Array

_CROWD = 24  # ways of a generation
_SPREAD = 0.2  # of CMA-ES in its first generation [rad]
_PATIENCE = 70  # generations of climbing, until it begins anew
_EXPLORES = 50  # rounds without a way, until it begins anew
_MORE = 4  # rounds of exploring, after the first way that stands
_LYINGS = 3  # from which at once it explores
_FEW, _FAILED = 4, 2  # starts of a generation; of them those that it failed at
_MOST = 3  # of these, from which a way stands that is tried from others
_OTHERS, _ENOUGH = 24, 23  # starts of a trial of a way, and of these that stand

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
        self._still = np.zeros(TAIL)  # the way that goes nowhere from where it lies
        self._fresh, self._left = 0, 0
        self._failed: list[Start] = []

    def run(self, tell: Tell) -> Way:
        """Return the way that stood from most starts; none may have.

        Args:
            tell: called after each generation.
        """
        stage, most = f"up from the {self._side}", self._effort.generations
        best, count, self._left = self._still, 0, most
        tell(stage, 0, most)
        while self._left and count < _ENOUGH:
            for numbers, stood in self._one_attempt():
                tell(stage, most - self._left, most)
                if stood > count:
                    best, count = numbers, stood
        tell(stage, most, most)
        return way_of(self._robot, best, count, _OTHERS)

    def _one_attempt(self) -> Iterator[tuple[Array, int]]:
        """Yield the best way of each generation, and from how many starts it stands."""
        begin = yield from self._explore()
        if begin is None:
            return
        stood = self._try_others(begin)
        yield begin, stood
        if stood >= _ENOUGH:
            return
        for numbers, tried in self._climb(begin):
            most = sum(one.stood for one in tried) >= _MOST
            stood = self._try_others(numbers) if most else 0
            yield numbers, stood
            if stood >= _ENOUGH:
                return

    def _explore(self) -> Generator[tuple[Array, int], None, Array | None]:
        """Return a way that stands from some starts, and from most others.

        None where nothing stands for long.
        """
        starts, workers = self._draw_starts(_LYINGS), self._effort.workers
        of = self._subject, self._side, tuple(starts)
        rounds = Exploration(*of, self._rng, workers).rounds()
        ways: list[Array] = []
        self._failed, patience = [], _EXPLORES
        while self._left and patience:
            ways += next(rounds)
            self._left -= 1
            patience = min(patience - 1, _MORE) if ways else patience - 1
            yield self._still, 0
        return self._best_of(ways) if ways else None

    def _best_of(self, ways: list[Array]) -> Array:
        """Return the way that is worth most from other starts."""
        came = self._try(ways, self._draw_starts(_FEW))
        return ways[int(np.argmax([_worth(tried) for tried in came]))]

    def _try_others(self, numbers: Array) -> int:
        """Return from how many other starts a way stands; keep those that fail."""
        others = self._draw_starts(_OTHERS)
        came = zip(others, self._try([numbers], others)[0], strict=True)
        self._failed = [start for start, one in came if not one.stood]
        return len(others) - len(self._failed)

    def _mixed_starts(self) -> list[Start]:
        """Return some of the starts that it failed at last, and others."""
        return [*self._failed[:_FAILED], *self._draw_starts(_FEW)][:_FEW]

    def _draw_starts(self, count: int) -> list[Start]:
        self._fresh += count
        numbers = range(self._fresh - count, self._fresh)
        return [(self._effort.seed, number) for number in numbers]

    def _climb(self, begin: Array) -> Iterator[tuple[Array, list[Tried]]]:
        """Yield the best way of each generation, and what came of it."""
        from cmaes import CMA  # noqa: PLC0415 - slow, brings scipy.stats

        climber = CMA(
            mean=begin,
            sigma=_SPREAD,
            population_size=_CROWD,
            seed=int(self._rng.integers(2**31)),
        )
        for _ in range(min(_PATIENCE, self._left)):
            self._left -= 1
            crowd = [climber.ask() for _ in range(_CROWD)]
            found = self._try(crowd, self._mixed_starts())
            worth = [_worth(tried) for tried in found]
            climber.tell([(x, -w) for x, w in zip(crowd, worth, strict=True)])
            top = int(np.argmax(worth))
            yield crowd[top], found[top]
            if climber.should_stop():
                return

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
