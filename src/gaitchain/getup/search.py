"""Search key poses that lead from lying to standing, in physics. Ours.

Nothing is known of the robot but which of its joints mirror each other, and how it
squats. `Exploration` finds ways that stand from a few ways of lying. A side from which
none stands from most others may have one over the other side (`rolling`). Where that is
not so, CMA-ES (Hansen 2016) goes on from the best; each of its generations has other
ways of lying, those it failed at last among them. Where nothing stands for long, the
search begins anew.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from gaitchain.build.jobs import run_jobs
from gaitchain.build.progress import Progress
from gaitchain.errors import CommandError
from gaitchain.gait.get_up import GetUp, Side, Way
from gaitchain.getup.exploration import Exploration
from gaitchain.getup.fallen_robot import Start, Subject, fallen_robot
from gaitchain.getup.rolling import ENOUGH, OTHERS, RollSearch
from gaitchain.getup.ways import TAIL, Tried, judge, way_of
from gaitchain.messages import Array

_CROWD = 24  # ways of a generation
_SPREAD = 0.2  # of CMA-ES in its first generation [rad]
_PATIENCE = 70  # generations of climbing, until it begins anew
_EXPLORES = 30  # rounds without a way, until it begins anew
_MORE = 4  # rounds of exploring, after the first way that stands
_LYINGS = 3  # from which at once it explores
_FEW, _FAILED = 4, 2  # starts of a generation; of them those that it failed at
_MOST = 3  # of these, from which a way stands that is tried from others


class Effort(NamedTuple):
    """How long to search, and with what."""

    generations: int
    seed: int
    workers: int


def search_ways(
    subject: Subject, sides: tuple[Side, ...], effort: Effort, progress: Progress
) -> dict[Side, Way]:
    """Return for each side the way that stood from most starts; none may have.

    Args:
        subject: the robot.
        sides: what it lies on.
        effort: how long to search.
        progress: called after each generation.

    Raises:
        CommandError: no joints of the robot could lift it.
    """
    searches = {side: WaySearch(subject, side, effort, progress) for side in sides}
    rolls = {s: RollSearch(subject, s, effort.seed, effort.workers) for s in sides}
    ways = {side: search.way for side, search in searches.items()}
    while left := [s for s in sides if ways[s].stood < ENOUGH and searches[s].left]:
        for side in left:
            ways[side] = _better(searches[side].go_on(), ways[side])
        _roll_over(rolls, ways, progress)
    return ways


def _roll_over(
    rolls: dict[Side, RollSearch], ways: dict[Side, Way], progress: Progress
) -> None:
    """Take ways over the other side where those that are known stand too seldom."""
    for side, known in ways.items():
        for other in ways.values():
            if known.stood < ENOUGH <= other.stood:
                ways[side] = _better(rolls[side].run(other, progress), known)


def _better(one: Way, other: Way) -> Way:
    return max(one, other, key=lambda way: way.stood)


class WaySearch:
    """The search of a way to get up from one side."""

    def __init__(
        self, subject: Subject, side: Side, effort: Effort, progress: Progress
    ) -> None:
        """Make ready.

        Args:
            subject: the robot.
            side: what it lies on.
            effort: how long to search.
            progress: called after each generation.

        Raises:
            CommandError: no joints of the robot could lift it.
        """
        self._robot = fallen_robot(subject)
        if not self._robot.pairs:
            name = subject.library.robot.name
            raise CommandError(f"{name}: no joint has a mirror image on the other side")
        self._subject, self._side, self._effort = subject, side, effort
        self._progress, self.left = progress, effort.generations
        """Generations that it may still search."""
        self._rng = np.random.default_rng(effort.seed)
        # At first the way that goes nowhere from where it lies.
        self._best, self._count = np.zeros(TAIL), 0
        self._fresh = 0
        self._failed: list[Start] = []

    @property
    def way(self) -> Way:
        """The way that stood from most starts so far."""
        return way_of(self._robot, self._best, self._count, OTHERS)

    def go_on(self) -> Way:
        """Explore, where nothing stands yet; climb, and explore if that is not enough.

        Returns:
            The way that stood from most starts so far.
        """
        self._count_down(0)
        if self._count:
            self._climb_from(self._best)
        if self._count < ENOUGH:
            self._try_to_begin()
        return self.way

    def _count_down(self, done: int = 1) -> None:
        self.left -= done
        most = self._effort.generations
        self._progress(f"up from the {self._side}", most - self.left, most)

    def _try_to_begin(self) -> None:
        """Explore, until some ways stand or nothing does for long."""
        starts, workers = self._draw_starts(_LYINGS), self._effort.workers
        of = self._subject, self._side, tuple(starts)
        rounds = Exploration(*of, self._rng, workers).rounds()
        ways: list[Array] = []
        self._failed, patience = [], _EXPLORES
        while self.left and patience:
            ways += next(rounds)
            self._count_down()
            patience = min(patience - 1, _MORE) if ways else patience - 1
        if ways:
            self._try_others(self._best_of(ways))

    def _climb_from(self, begin: Array) -> None:
        """Go on from a way; try those from others that stand from most starts."""
        for numbers, tried in self._generations(begin):
            if sum(one.stood for one in tried) >= _MOST:
                self._try_others(numbers)
            if self._count >= ENOUGH:
                return

    def _best_of(self, ways: list[Array]) -> Array:
        """Return the way that is worth most from other starts."""
        came = self._try(ways, self._draw_starts(_FEW))
        return ways[int(np.argmax([_worth(tried) for tried in came]))]

    def _try_others(self, numbers: Array) -> None:
        """Try a way from other starts; note it if it is best, and what it fails at."""
        others = self._draw_starts(OTHERS)
        came = zip(others, self._try([numbers], others)[0], strict=True)
        self._failed = [start for start, one in came if not one.stood]
        stood = len(others) - len(self._failed)
        if stood > self._count:
            self._best, self._count = numbers, stood

    def _mixed_starts(self) -> list[Start]:
        """Return some of the starts that it failed at last, and others."""
        return [*self._failed[:_FAILED], *self._draw_starts(_FEW)][:_FEW]

    def _draw_starts(self, count: int) -> list[Start]:
        self._fresh += count
        numbers = range(self._fresh - count, self._fresh)
        return [(self._effort.seed, number) for number in numbers]

    def _generations(self, begin: Array) -> Iterator[tuple[Array, list[Tried]]]:
        """Yield the best way of each generation, and what came of it."""
        from cmaes import CMA  # noqa: PLC0415 - slow, brings scipy.stats

        climber = CMA(
            mean=begin,
            sigma=_SPREAD,
            population_size=_CROWD,
            seed=int(self._rng.integers(2**31)),
        )
        for _ in range(min(_PATIENCE, self.left)):
            self._count_down()
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
