"""Find first ways up: go on from what was reached, also where it looks worse. Ours.

A search that climbs ends where a robot kneels or sits, as each small change from there
is worse. So what was reached is kept in cells by tilt, height, balance and feet, each
with the best robot that came there (as Ecoffet et al., 2021, keep the cells of a game).
Poses are tried from the cells, those that are higher and seldom tried more often; and
from each new cell, to stand up.
"""

import math
from collections.abc import Callable, Iterator
from typing import NamedTuple, TypeVar

import numpy as np

from gaitchain.build.jobs import run_jobs
from gaitchain.gait.get_up import Side, Way
from gaitchain.getup.fallen_robot import Look, Start, Subject, fallen_robot
from gaitchain.getup.ways import height, pose_of, rise_of
from gaitchain.messages import Array

_STEPS = 96  # poses tried in a round
_LONGEST = 10  # poses of a way, before the standing one
_TILT, _HIGH, _OFF, _LIFTED = 0.35, 0.08, 0.2, 0.2  # of a cell [rad, -, legs, legs]
_FURTHEST_OFF, _MOST_LIFTED = 1.5, 1.0
_FAST, _FASTEST = 0.1, 4.0  # what speed takes from a robot's height [s/leg, legs/s]
_HIGHER = 3.0  # logarithm of how much more often a cell is tried that is 1 higher
_ANEW, _CHANGED, _CHANGE = 0.5, 0.5, 0.4  # part of poses drawn anew; of joints; [rad]

Cell = tuple[int, ...]
_T = TypeVar("_T")


class Reached(NamedTuple):
    """Where a pose led."""

    state: Array
    look: Look


class _Known(NamedTuple):
    """The best that came to a cell."""

    numbers: tuple[Array, ...]
    reached: Reached


class Exploration:
    """The cells reached from one start, and how."""

    def __init__(
        self,
        subject: Subject,
        side: Side,
        start: Start,
        rng: np.random.Generator,
        workers: int,
    ) -> None:
        """Begin where the robot lies.

        Args:
            subject: the robot.
            side: what it lies on.
            start: how, and in what world.
            rng: of the poses.
            workers: processes at once.
        """
        self._from = subject, side, start
        self._rng, self._workers = rng, workers
        robot = fallen_robot(subject)
        robot.lie(side, start)
        self._size = len(robot.pairs) + 1
        lying = Reached(robot.state, robot.look())
        self._known = {_cell(lying.look): _Known((), lying)}
        self._tried = dict.fromkeys(self._known, 1)

    def rounds(self) -> Iterator[list[Array]]:
        """Yield the ways of each round of trials that stand."""
        while True:
            new = [self._known[cell] for cell in self._go_on()]
            times = self._rng.normal(0.0, 1.0, (len(new), 1))
            ways = [
                known._replace(numbers=(*known.numbers, time))
                for known, time in zip(new, times, strict=True)
            ]
            came = zip(ways, self._run(rise_on, ways, Look), strict=True)
            yield [np.concatenate(way.numbers) for way, look in came if look.stands]

    def _go_on(self) -> list[Cell]:
        """Try poses from the cells; return those that are new, or reached better."""
        begun = [self._known[cell] for cell in self._chosen()]
        rows = [self._drawn(known) for known in begun]
        tried = [
            _Known((*known.numbers, row), known.reached)
            for known, row in zip(begun, rows, strict=True)
        ]
        new: dict[Cell, None] = {}
        for known, reached in zip(tried, self._run(go_on, tried, Reached), strict=True):
            cell = _cell(reached.look)
            if self._better(cell, len(known.numbers), reached.look):
                self._known[cell] = _Known(known.numbers, reached)
                self._tried.setdefault(cell, 1)
                new[cell] = None
        return list(new)

    def _chosen(self) -> list[Cell]:
        """Draw cells from which a way can go on."""
        cells = [c for c, known in self._known.items() if len(known.numbers) < _LONGEST]
        high = np.array([_promise(self._known[cell].reached.look) for cell in cells])
        tried = np.array([self._tried[cell] for cell in cells])
        weight = np.exp(_HIGHER * high) / np.sqrt(tried)
        chosen = self._rng.choice(len(cells), _STEPS, p=weight / weight.sum())
        for number in chosen:
            self._tried[cells[number]] += 1
        return [cells[number] for number in chosen]

    def _drawn(self, known: _Known) -> Array:
        """Draw a pose: any, or like the last one."""
        if not known.numbers or self._rng.random() < _ANEW:
            return self._rng.normal(0.0, 1.0, self._size)
        changed = self._rng.random(self._size) < _CHANGED
        return known.numbers[-1] + changed * self._rng.normal(0.0, _CHANGE, self._size)

    def _better(self, cell: Cell, poses: int, look: Look) -> bool:
        """Whether it is the first in its cell, came in fewer poses, or is higher."""
        old = self._known.get(cell)
        if old is None:
            return True
        return poses < len(old.numbers) or _promise(look) > _promise(old.reached.look)

    def _run(
        self, work: Callable[..., _T], of: list[_Known], kind: type[_T]
    ) -> Iterator[_T]:
        jobs = [(*self._from, one.numbers, one.reached.state) for one in of]
        return run_jobs(work, jobs, kind, self._workers)


def go_on(
    subject: Subject, side: Side, start: Start, numbers: tuple[Array, ...], state: Array
) -> Reached:
    """Take the last of some poses, from where those before it led.

    Args:
        subject: the robot.
        side: what it lay on.
        start: how, and in what world.
        numbers: of the poses.
        state: of the robot.
    """
    robot = fallen_robot(subject)
    robot.go_back(side, start, state)
    last = robot.stand
    for row in numbers[:-1]:
        last = np.array(pose_of(robot, row, last).angles)
    robot.move(Way((pose_of(robot, numbers[-1], last),), 0, 1), last, hold_s=0.0)
    return Reached(robot.state, robot.look())


def rise_on(
    subject: Subject, side: Side, start: Start, numbers: tuple[Array, ...], state: Array
) -> Look:
    """Stand up from where poses led, in the time of the last number; see `go_on`."""
    robot = fallen_robot(subject)
    robot.go_back(side, start, state)
    last = robot.stand
    for row in numbers[:-1]:
        last = np.array(pose_of(robot, row, last).angles)
    rise = rise_of(robot, float(numbers[-1][0]), last)
    return robot.move(Way((rise,), 0, 1), last)[-1]


def _promise(look: Look) -> float:
    """Return how far up a robot is, and how calmly."""
    return height(look) - _FAST * min(look.speed, _FASTEST)


def _cell(look: Look) -> Cell:
    off, lifted = min(look.off, _FURTHEST_OFF), min(look.lifted, _MOST_LIFTED)
    tilt = math.atan2(look.ahead, look.up)
    parts = tilt / _TILT, look.high / _HIGH, off / _OFF, lifted / _LIFTED
    return tuple(round(part) for part in parts)
