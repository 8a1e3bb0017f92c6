"""Find first ways up: go on from what was reached, also where it looks worse. Ours.

A search that climbs ends where a robot kneels or sits, as each small change from there
is worse. So what was reached is kept in cells by tilt, height, balance and feet, each
with the best robot that came there (as Ecoffet et al., 2021, keep the cells of a game).
Poses are tried from the cells, those that are higher and seldom tried more often; and
from each new cell near its feet, to squat and rise.

The robot lies in several ways at once, in several worlds, and a pose counts only where
it leads to about the same from all of them: what is thrown or rolls ends otherwise each
time, and a way of such poses stands from no other lying.
"""

from collections.abc import Callable, Iterator
from typing import NamedTuple, TypeVar

import numpy as np

from gaitchain.build.jobs import run_jobs
from gaitchain.gait.get_up import Side
from gaitchain.getup.fallen_robot import Start, Subject, fallen_robot
from gaitchain.getup.reached import Cell, Numbers, Reached, go_on, lying, rises_on
from gaitchain.getup.ways import TAIL, squatting
from gaitchain.messages import Array

_STEPS = 48  # poses tried in a round
_LONGEST = 24  # poses of a way, before the squat
_RISES = 2  # from a cell
_HIGHER = 3.0, 6.0  # logarithms of how much more often one is tried that is 1 higher
_SQUATTING, _ANEW, _CHANGED, _CHANGE = 0.25, 0.5, 0.5, 0.4  # parts of poses; [rad]
_BETTER = 0.02  # higher, at least, than what came to a cell before
_SPREAD = 0.15  # of the parts of squats from which it rises
_ALL = slice(None)

_T = TypeVar("_T")


class _Known(NamedTuple):
    """The best that came to a cell."""

    numbers: Numbers
    reached: Reached


class Exploration:
    """The cells reached from some lyings, and how."""

    def __init__(
        self,
        subject: Subject,
        side: Side,
        starts: tuple[Start, ...],
        rng: np.random.Generator,
        workers: int,
    ) -> None:
        """Begin where the robot lies.

        Args:
            subject: the robot.
            side: what it lies on.
            starts: how, and in what worlds.
            rng: of the poses.
            workers: processes at once.
        """
        self._subject, self._side, self._starts = subject, side, starts
        self._rng, self._workers = rng, workers
        self._robot = fallen_robot(subject)
        begin = lying(self._robot, side, starts)
        self._known = {begin.cell: _Known((), begin)}
        self._tried = dict.fromkeys(self._known, 1)

    def rounds(self) -> Iterator[list[Array]]:
        """Yield the ways of each round of trials that stand from all lyings."""
        while True:
            new = [self._known[cell] for cell in self._go_on()]
            near = [known for known in new if known.reached.near_its_feet]
            ways = [self._with_tail(known) for known in near for _ in range(_RISES)]
            came = zip(ways, self._run(rises_on, ways, bool), strict=True)
            yield [np.concatenate(way.numbers) for way, stood in came if stood]

    def _go_on(self) -> list[Cell]:
        """Try poses from the cells; return those that are new, or reached better.

        From the first lying at first: what is no better there is not tried from others.
        """
        tried = [self._with_pose(self._known[cell]) for cell in self._chosen()]
        first = self._run(go_on, tried, Reached, slice(0, 1))
        came = [
            way._replace(reached=one) for way, one in zip(tried, first, strict=True)
        ]
        better = [number for number, way in enumerate(came) if self._is_better(way)]
        again = [tried[number] for number in better]
        others = self._run(go_on, again, Reached, slice(1, None))
        new: dict[Cell, None] = {}
        for number, more in zip(better, others, strict=True):
            way = came[number]._replace(reached=came[number].reached.with_more(more))
            if way.reached.alike and self._is_better(way):
                self._known[way.reached.cell] = way
                self._tried.setdefault(way.reached.cell, 1)
                new[way.reached.cell] = None
        return list(new)

    def _is_better(self, way: _Known) -> bool:
        """Whether it is the first in its cell, higher, or as high in fewer poses."""
        old = self._known.get(way.reached.cell)
        if old is None:
            return True
        more = way.reached.worth - old.reached.worth
        shorter = len(way.numbers) < len(old.numbers)
        return more > (-_BETTER if shorter else _BETTER)

    def _chosen(self) -> list[Cell]:
        """Draw cells from which a way can go on, some more greedily than others."""
        cells = [c for c, known in self._known.items() if len(known.numbers) < _LONGEST]
        high = np.array([self._known[cell].reached.worth for cell in cells])
        tried = np.array([self._tried[cell] for cell in cells])
        chosen = []
        for greed in _HIGHER:
            weight = np.exp(greed * (high - high.max())) / np.sqrt(tried)
            count = _STEPS // len(_HIGHER)
            chosen += self._rng.choice(
                len(cells), count, p=weight / weight.sum()
            ).tolist()
        for number in chosen:
            self._tried[cells[number]] += 1
        return [cells[number] for number in chosen]

    def _with_pose(self, known: _Known) -> _Known:
        return known._replace(numbers=(*known.numbers, self._drawn(known)))

    def _drawn(self, known: _Known) -> Array:
        """Draw a pose: any, or like the last one; some with the legs of a squat."""
        numbers, size = known.numbers, len(self._robot.pairs) + 1
        if not numbers or self._rng.random() < _ANEW:
            row = self._rng.normal(0.0, 1.0, size)
        else:
            changed = self._rng.random(size) < _CHANGED
            row = numbers[-1] + changed * self._rng.normal(0.0, _CHANGE, size)
        if self._rng.random() < _SQUATTING:
            row = squatting(self._robot, row, self._rng.random())
        return np.asarray(row)

    def _with_tail(self, known: _Known) -> _Known:
        """Draw how it gets into a squat about as high as it is."""
        high = known.reached.looks[0].high
        time, off = self._rng.normal(0.0, 1.0, TAIL)
        part = self._robot.squats.part_of(high) + _SPREAD * off
        return known._replace(numbers=(*known.numbers, np.array([time, part])))

    def _run(
        self,
        work: Callable[..., _T],
        ways: list[_Known],
        kind: type[_T],
        of: slice = _ALL,
    ) -> Iterator[_T]:
        begin = self._subject, self._side, self._starts[of]
        jobs = [(*begin, way.numbers, way.reached.states[of]) for way in ways]
        return run_jobs(work, jobs, kind, self._workers)
